// Everybody at their own rate: one thread runs the scene, others picture it, listen to it and log it, each on a copy
// that it brings up to date when it has time. The scene waits for nobody, and nobody misses a change.
//
//     08_overlap examples/room.x3dv session.rlog
#include <atomic>
#include <chrono>
#include <iostream>
#include <thread>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/replica.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/sync/log.h>

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    const bool loaded = argc == 3 && rtsg::loadFile(scene, argv[1], diagnostics);
    for (const rtsg::Diagnostic& d : diagnostics.all()) std::cerr << d.format() << '\n';
    if (!loaded) return 1;

    std::atomic<bool> running = true;
    struct Follower {
        rtsg::Replica replica;
        int rounds = 0;
        bool ok = true;
    } light{rtsg::Replica(scene)}, sound{rtsg::Replica(scene)}, log{rtsg::Replica(scene)};

    std::jthread lightThread([&] {
        rtsg::SharedWorld world(light.replica.scene());
        rtsg::LightRenderer renderer(world);
        rtsg::ImageOptions options;
        options.settings.width = 160;
        options.settings.height = 90;
        options.settings.threads = 1;
        for (bool last = false; !last; ++light.rounds) {
            last = !running;
            light.replica.poll();  // everything since the last picture, as one change set
            light.ok = light.ok && renderer.picture(options);
        }
    });
    std::jthread soundThread([&] {
        sound.replica.poll();
        rtsg::ListenOptions options;
        options.metrics = false;
        rtsg::SharedWorld world(sound.replica.scene());
        rtsg::SoundRenderer renderer(world, options);
        for (bool last = false; sound.ok && !last; ++sound.rounds) {
            last = !running;
            sound.replica.poll();
            sound.ok = renderer.renderFrame().has_value();
        }
    });
    std::jthread logThread([&] {
        const auto file = rtsg::LogWriter::create(argv[2], rtsg::builtinTypes());
        log.ok = file.has_value();
        rtsg::Attachment attachment;
        if (log.ok) attachment = log.replica.scene().bus().attach(**file);
        for (bool last = false; log.ok && !last; ++log.rounds) {
            last = !running;
            log.replica.drain();  // frame by frame
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
        }
    });

    int frames = 0;
    const auto begin = std::chrono::steady_clock::now();
    for (; frames < 240; ++frames) {
        scene.newFrame(frames / 120.0);
        std::this_thread::sleep_until(begin + std::chrono::milliseconds(1000 * frames / 120));
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    running = false;
    lightThread.join(), soundThread.join(), logThread.join();

    std::cout << "scene " << frames / seconds << " Hz, hash " << scene.hash().hex() << '\n';
    bool equal = true;
    for (auto& [name, one] : {std::pair{"light", &light}, {"sound", &sound}, {"log", &log}}) {
        equal = equal && one->ok && one->replica.scene().hash() == scene.hash();
        std::cout << name << ' ' << one->rounds / seconds << " Hz, state " << one->replica.scene().sequence() << " of "
                  << scene.sequence() << ", hash " << one->replica.scene().hash().hex() << '\n';
    }
    std::cout << (equal ? "nobody missed a change\n" : "somebody missed a change\n");
    return equal ? 0 : 1;
}
