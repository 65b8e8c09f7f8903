// A session as a test: records a running scene into a log, replays it, and verifies that each replayed state has the
// hash that the original had. Then the log of another session, in which something else happened, is compared with it:
// the first divergence is named. This is how a recorded session becomes an integration test.
//
//     05_replay_as_test examples/room.x3dv OUT_FOLDER
#include <filesystem>
#include <iostream>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/replay.h>

namespace fs = std::filesystem;

/// Two seconds of the scene; after one of them the clock is stopped, if `stop`.
bool record(const fs::path& file, const fs::path& log, bool stop) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    if (!rtsg::loadFile(scene, file, diagnostics)) return false;
    const auto writer = rtsg::LogWriter::create(log, rtsg::builtinTypes());
    if (!writer) return std::cerr << writer.error().format() << '\n', false;
    const rtsg::Attachment attachment = scene.bus().attach(**writer);
    const rtsg::NodeId clock = scene.findName("CLOCK");
    for (int frame = 0; frame <= 50; ++frame) {
        if (stop && frame == 25 && !scene.set(clock, rtsg::x3d::TimeSensor::enabled, false)) return false;
        scene.newFrame(frame / 25.0);
    }
    return (*writer)->close().has_value();
}

int main(int argc, char** argv) {
    if (argc != 3) return std::cerr << "usage: 05_replay_as_test SCENE OUT_FOLDER\n", 2;
    const fs::path first = fs::path(argv[2]) / "first.rlog", second = fs::path(argv[2]) / "second.rlog";
    if (!record(argv[1], first, false) || !record(argv[1], second, true)) return 1;

    const auto replayer = rtsg::Replayer::open(first);
    if (!replayer) return std::cerr << replayer.error().format() << '\n', 1;
    rtsg::Result<bool> more = true;
    while (more && *more) more = (*replayer)->step();
    if (!more) return std::cerr << more.error().format() << '\n', 1;
    std::cout << (*replayer)->verified() << " of " << (*replayer)->frames() << " states verified\n";

    const auto difference = rtsg::diffLogs(first, second);
    if (!difference || !*difference) return std::cerr << "the two sessions should differ\n", 1;
    std::cout << "the second session parts at t = " << (*difference)->time << ", " << (*difference)->node << '.'
              << (*difference)->field << '\n';
    return (*replayer)->verified() == (*replayer)->frames() && (*replayer)->frames() > 0 ? 0 : 1;
}
