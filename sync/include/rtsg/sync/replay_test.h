// Replay tests: a recorded session as an integration test of the application that it was recorded from.
//
//   replay   the log's states come back one by one, each checked against its hash; what follows the scene is under test
//   rerun    the scene is built afresh and gets the recorded input (events, edits, clock); each frame's state has to be
//            the recorded one, so a change in scene, scripts or behaviours is named by frame, node and field
//
// States are compared whole, by their hash, or in chosen fields, within a tolerance (field_comparison.h): then edits
// of the document elsewhere change nothing, and what it does counts rather than what it says.
//
// Invariant: a test passes only if there was at least one frame, none was missing or damaged, and every one agreed.
// A rerun that compares states whole stops at its first divergence: what comes after follows from it.
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

    /// Rerun: builds the scene under test as the application does, without running a frame; the clock
    /// stands where the log begins. Empty: replay.
    std::function<Result<>(Scene&)> build;
    /// Rerun: the application's own work before each frame, given the frame's time. With it, only recorded events are
    /// sent; without it the edits that the application made are made again as recorded.
    std::function<Result<>(Scene&, double)> application;

    /// Rerun: what is compared of each state. Empty: all of it, bit for bit.
    FieldSelection compared;

    /// Called once with the scene in its first state: where subscribers under test attach.
    std::function<Result<>(Scene&)> attach;
    /// Called at every state; an error fails the test there. This is where results of subscribers are compared.
    std::function<Result<>(const Scene&)> check;
    /// Called once every state of an instant has come: several share one where an Inline came, or the application
    /// edited between frames. This is where frames of pictures and sound are made. An error fails the test there.
    std::function<Result<>(const Scene&)> frame;
    /// Rerun: called once, in the first state that differs: the recorded scene and the one under test.
    std::function<void(const Scene&, const Scene&)> differ;
    /// Called at the end, however it went, while the scene is still there.
    std::function<Result<>()> finish;

    /// Rerun: writes what the scene does now over the log (in one step, at the end) instead of comparing with it.
    bool update = false;
};

struct ReplayReport {
    std::uint64_t frames = 0;    // states reached
    std::uint64_t verified = 0;  // of these, equal to the recorded ones
    std::optional<Divergence> divergence;
    bool updated = false;
    bool closed = true;         // the log was: nothing of the session came after the last state
    bool goesOn = false;        // it is a piece that another one follows
    double start = 0, end = 0;  // times of the first and the last state reached
    /// With chosen fields: how many there were, those that differed, in the order in which they began, and their
    /// values.
    std::size_t fields = 0;
    std::vector<FieldDifference> differences;
    std::vector<FieldHistory> histories;
    std::vector<std::string> ignoredInVain;  // FieldComparison::ignoredInVain()

    bool passed() const { return frames > 0 && verified == frames && !divergence; }
    /// One line for a test's output.
    std::string format() const;
};

/// Errors are what kept the test from being run at all: no such log, nothing intact in it, a scene that cannot be
/// built.
Result<ReplayReport> runReplayTest(const ReplayTest& test);

/// A test program's main: `PROGRAM LOG [--update] [--field P]... [--ignore P]... [--tolerance N]`, as
/// rtsg_add_replay_test(... PROGRAM ...) calls it; what is given there goes before `test.compared`. Prints the report
/// and returns the exit status: 0 passed, 1 not, 2 wrong usage.
int replayTestMain(int argc, char** argv, ReplayTest test);

}  // namespace rtsg
