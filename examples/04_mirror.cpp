// Mirrors a running scene: server and replica, here in one process, elsewhere on two machines. The replica is a scene
// like any other, so whatever can be attached to the original can be attached to it. After every frame both have the
// same 128-bit hash of their whole state.
//
//     04_mirror examples/room.x3dv
#include <iostream>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

int main(int argc, char** argv) {
    rtsg::Scene origin;
    rtsg::Diagnostics diagnostics;
    const bool loaded = argc == 2 && rtsg::loadFile(origin, argv[1], diagnostics);
    for (const rtsg::Diagnostic& d : diagnostics.all()) std::cerr << d.format() << '\n';
    if (!loaded) return 1;

    const auto server = rtsg::MirrorServer::start(origin, "tcp://127.0.0.1:*");  // any free port
    if (!server) return std::cerr << server.error().format() << '\n', 1;
    rtsg::Scene replica;
    const auto client = rtsg::MirrorClient::connect(replica, (*server)->endpoint());
    if (!client) return std::cerr << client.error().format() << '\n', 1;

    for (int frame = 0; frame < 100; ++frame) {
        origin.newFrame(frame / 25.0);
        // Elsewhere both sides go at their own pace; here we wait for each frame, so as to compare every one.
        for (int tries = 0; replica.sequence() != origin.sequence() || !(*client)->inStep(); ++tries) {
            if (tries == 1000) return std::cerr << "no frame for ten seconds\n", 1;
            (*client)->poll(std::chrono::milliseconds(10));
        }
        if (replica.hash() != origin.hash()) return std::cerr << "frame " << frame << " differs\n", 1;
    }
    const rtsg::MirrorStatistics& statistics = (*client)->statistics();
    std::cout << statistics.frames << " frames in " << statistics.bytes << " bytes, hash " << replica.hash().hex()
              << " on both sides\n";
    return statistics.divergences == 0 ? 0 : 1;
}
