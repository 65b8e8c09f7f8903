// Replay tests: a recorded session as an integration test of the application that it was recorded from.
//
//   replay   the log's states come back one by one, each checked against its hash; what follows the scene is under test
//   rerun    the scene is built afresh and gets the recorded input (events, edits, clock); each frame's state has to be
//            the recorded one, so a change in scene, scripts or behaviours is named by frame, node and field
//
// States are compared as a whole by their hash, or in chosen fields within a tolerance (field_comparison.h). With
// chosen fields, edits elsewhere in the document change nothing: the test compares what the document does, not what it
// says.
//
// Invariant: a test passes only if there was at least one frame, none was missing or damaged, and all agreed. A rerun
// that compares whole states stops at its first divergence, since later ones follow from it.
// Threading: the calling thread.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include <rtsg/core/scene.h>
#include <rtsg/sync/field_comparison.h>
#include <rtsg/sync/replay.h>

namespace rtsg {

struct ReplayTest {
    std::filesystem::path log;

    /// Rerun: builds the scene under test as the application does, without running a frame. The clock stands where the
    /// log begins. Empty: replay.
    std::function<Result<>(Scene&)> build;
    /// Rerun: does the application's own work before each frame, whose time it is given. With it only recorded events
    /// are sent; without it the recorded edits of the application are made, too.
    std::function<Result<>(Scene&, double)> application;

    /// Rerun: the fields to compare in each state. Empty: the whole state, bit for bit.
    FieldSelection compared;

    /// Called once with the scene in its first state, so that subscribers under test can attach.
    std::function<Result<>(Scene&)> attach;
    /// Called at every state, to compare results of subscribers. An error fails the test there.
    std::function<Result<>(const Scene&)> check;
    /// Called after the last state of each time, to make frames of pictures and sound. Several states have one time
    /// when an Inline loads or the application edits between frames. An error fails the test there.
    std::function<Result<>(const Scene&)> frame;
    /// Rerun: called once in the first state that differs, with the recorded scene and the one under test.
    std::function<void(const Scene&, const Scene&)> differ;
    /// Called at the end, whether the test passed or not, while the scene still exists.
    std::function<Result<>()> finish;

    /// Rerun: replaces the log by what the scene does now (in one step, at the end) instead of comparing.
    bool update = false;
};

struct ReplayReport {
    std::uint64_t frames = 0;    // states reached
    std::uint64_t verified = 0;  // those equal to the recorded ones
    std::optional<Divergence> divergence;
    bool updated = false;
    bool closed = true;         // the log was closed: nothing of the session came after the last state
    bool goesOn = false;        // it is a piece that has a later piece
    double start = 0, end = 0;  // times of the first and the last state reached
    /// With chosen fields: the number of fields, the differences in the order in which they began, and their values.
    std::size_t fields = 0;
    std::vector<FieldDifference> differences;
    std::vector<FieldHistory> histories;
    std::vector<std::string> ignoredInVain;  // FieldComparison::ignoredInVain()

    bool passed() const { return frames > 0 && verified == frames && !divergence; }
    /// One line for a test's output, with times since `start`.
    std::string format() const;
};

/// Errors are what kept the test from running: no such log, nothing intact in it, or a scene that cannot be built.
Result<ReplayReport> runReplayTest(const ReplayTest& test);

/// The main function of a test program: `PROGRAM LOG [--update] [--field P]... [--ignore P]... [--tolerance N]`, as
/// rtsg_add_replay_test(... PROGRAM ...) calls it. These options come before `test.compared`. Prints the report and
/// returns the exit status: 0 passed, 1 failed, 2 wrong usage.
int replayTestMain(int argc, char** argv, ReplayTest test);

}  // namespace rtsg
