// A log on a thread of its own: nothing is lost, a slow or full disk does not hold up the scene, and what was
// acknowledged outlives the process.
#include <rtsg/sync/log_recorder.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <random>
#include <thread>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Recorder = LogFolder;

TEST_F(Recorder, WritesEveryStateAndAcknowledgesIt) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Recorded recorded;
        auto recorder = LogRecorder::start(scene, file(), seed % 2 ? LogOptions{} : denseKeyframes());
        ASSERT_TRUE(recorder);
        RandomEdits edits(scene, seed);
        for (int frame = 0; frame < 100; ++frame) {
            for (int i = 0; i < 6; ++i) edits.step();
            scene.newFrame(frame * .1);
            recorded.dumps[scene.sequence()] = scene.dump();
        }
        EXPECT_TRUE((*recorder)->waitFor(scene.sequence(), 60s)) << (*recorder)->failure();
        EXPECT_TRUE((*recorder)->stop());
        EXPECT_EQ((*recorder)->acknowledged(), scene.sequence());
        EXPECT_EQ((*recorder)->bytes(), std::filesystem::file_size(file())) << "the index, too";
        const Replayed replayed = replay(file(), recorded);
        EXPECT_EQ(replayed.damage, 0u);
        EXPECT_EQ(replayed.states.back(), scene.sequence());
        EXPECT_EQ(replayed.states.size() + (*recorder)->merged(), recorded.dumps.size());
    }
}

TEST_F(Recorder, OneThatIsWaitedForStartsWithTheFirstStateInTheFile) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        Scene scene;
        RandomEdits edits(scene, seed);
        for (int i = 0; i < 2000; ++i) edits.step();
        scene.newFrame(0);
        const std::uint64_t first = scene.sequence();
        auto recorder = LogRecorder::start(scene, file(), {}, LogRecorder::WhenBehind::wait);
        ASSERT_TRUE(recorder);
        EXPECT_EQ((*recorder)->acknowledged(), first);
        EXPECT_GT((*recorder)->bytes(), 0u);
        EXPECT_TRUE((*recorder)->stop());
        std::filesystem::remove(file());
    }
}

/// Reads a pipe to its end, on a thread of its own.
struct PipeDrain {
    int reader;
    std::atomic<bool> done{false};
    std::string bytes;
    std::thread thread;
    explicit PipeDrain(int r) : reader(r) {}
    void begin() {
        thread = std::thread([this] {
            char part[65536];
            while (true) {
                const ssize_t got = ::read(reader, part, sizeof(part));
                if (got > 0) bytes.append(part, static_cast<std::size_t>(got));
                if (got == 0 || (got < 0 && done)) break;
                if (got < 0) std::this_thread::sleep_for(1ms);
            }
        });
    }
    void end() {
        done = true;
        thread.join();
        ::close(reader);
    }
};

/// A pipe that nobody empties is the slowest disk there is.
TEST_F(Recorder, ADiskThatStandsStillDoesNotHoldUpTheScene) {
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    PipeDrain drain(::open(file("pipe").c_str(), O_RDONLY | O_NONBLOCK));
    ASSERT_GE(drain.reader, 0);
    Scene scene;
    Recorded recorded;
    auto recorder = LogRecorder::start(scene, file("pipe"));
    ASSERT_TRUE(recorder) << recorder.error().text;
    RandomEdits edits(scene, 3);
    for (int frame = 0; frame < 1500; ++frame) {
        for (int i = 0; i < 20; ++i) edits.step();
        scene.newFrame(frame * .1);
        if (frame % 10 == 9 || frame < 300) recorded.dumps[scene.sequence()] = scene.dump();
    }
    EXPECT_LT((*recorder)->acknowledged(), scene.sequence());
    drain.begin();  // the disk comes back
    EXPECT_TRUE((*recorder)->waitFor(scene.sequence(), 60s)) << (*recorder)->failure();
    const Result<> stopped = (*recorder)->stop();
    EXPECT_TRUE(stopped) << stopped.error().text;
    drain.end();
    EXPECT_GT((*recorder)->merged(), 0u);
    writeAll(file(), drain.bytes);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer) << replayer.error().text;
    while (*(*replayer)->step()) {
    }
    EXPECT_EQ((*replayer)->scene().dump(), scene.dump());
    EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
    EXPECT_EQ((*replayer)->gaps(), 0u);
}

/// Like a mirror's log whose server starts anew while the disk is stuck.
TEST_F(Recorder, OneThatIsWaitedForLosesNoStateWhenTheSceneStartsOver) {
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    PipeDrain drain(::open(file("pipe").c_str(), O_RDONLY | O_NONBLOCK));
    ASSERT_GE(drain.reader, 0);
    const auto anotherSession = [] {
        Scene other;
        RandomEdits edits(other, 8);
        for (int i = 0; i < 60; ++i) edits.step();
        other.newFrame(1);
        return std::make_shared<const ChangeSet>(other.snapshot());
    };
    Scene scene;
    auto recorder = LogRecorder::start(scene, file("pipe"), denseKeyframes(), LogRecorder::WhenBehind::wait);
    ASSERT_TRUE(recorder) << recorder.error().text;
    RandomEdits edits(scene, 7);
    for (int frame = 0; frame < 100; ++frame) {
        for (int i = 0; i < 20; ++i) edits.step();
        scene.newFrame(frame * .1);
    }
    EXPECT_LT((*recorder)->acknowledged(), 100u) << "the pipe is full";
    drain.begin();
    ASSERT_TRUE(scene.reset());
    EXPECT_EQ((*recorder)->acknowledged(), 100u) << "all that was";
    ASSERT_TRUE(scene.apply(anotherSession()));
    EXPECT_TRUE((*recorder)->stop()) << (*recorder)->failure();
    drain.end();
    writeAll(file(), drain.bytes);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer) << replayer.error().text;
    std::vector<std::uint64_t> states, wanted;
    while (*(*replayer)->step()) states.push_back((*replayer)->scene().sequence());
    for (std::uint64_t i = 0; i <= 100; ++i) wanted.push_back(i);
    wanted.push_back(1);
    EXPECT_EQ(states, wanted);
    EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
}

TEST_F(Recorder, OneThatIsWaitedForLosesNoSessionOfSeveralWhoseNumbersAreAlike) {
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    PipeDrain drain(::open(file("pipe").c_str(), O_RDONLY | O_NONBLOCK));
    ASSERT_GE(drain.reader, 0);
    const auto session = [](const std::string& name, std::size_t bytes) {
        Scene other;
        Diagnostics diagnostics;
        std::string title(bytes, ' ');  // that no compression makes short
        std::mt19937 random(5);
        for (char& c : title) c = static_cast<char>('0' + random() % 75);
        std::ranges::replace(title, '\\', '/');
        loadText(other, "DEF " + name + " WorldInfo { title \"" + title + "\" }", diagnostics);
        other.newFrame(1);
        return std::make_shared<const ChangeSet>(other.snapshot());
    };
    Scene scene;
    auto recorder = LogRecorder::start(scene, file("pipe"), denseKeyframes(), LogRecorder::WhenBehind::wait);
    ASSERT_TRUE(recorder) << recorder.error().text;
    // Nobody reads for a while: the second session fills the pipe, and those behind it wait for it.
    std::jthread late([&drain] {
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        drain.begin();
    });
    for (const auto& [name, bytes] : {std::pair{"A", 10}, {"B", 300'000}, {"C", 10}, {"D", 10}}) {
        ASSERT_TRUE(scene.reset());
        ASSERT_TRUE(scene.apply(session(name, static_cast<std::size_t>(bytes))));
    }
    late.join();
    EXPECT_TRUE((*recorder)->stop()) << (*recorder)->failure();
    drain.end();
    writeAll(file(), drain.bytes);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer) << replayer.error().text;
    std::string names;
    while (*(*replayer)->step())
        for (const char* name : {"A", "B", "C", "D"})
            if ((*replayer)->scene().findName(name)) names += name;
    EXPECT_EQ(names, "ABCD");
}

TEST_F(Recorder, AFullDiskIsReportedAndTheSceneGoesOn) {
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit limit = before;
    limit.rlim_cur = 20000;
    setrlimit(RLIMIT_FSIZE, &limit);
    Scene scene;
    std::string reported;
    scene.bus().setReporter([&](const Diagnostic& d) { reported = d.text; });
    auto recorder = LogRecorder::start(scene, file());
    ASSERT_TRUE(recorder);
    scene.newFrame(0);
    ASSERT_TRUE((*recorder)->waitFor(scene.sequence(), 60s));  // else all frames may come as one, too long for the disk
    RandomEdits edits(scene, 5);
    for (int frame = 1; frame < 20000 && reported.empty(); ++frame) {
        for (int i = 0; i < 6; ++i) edits.step();
        scene.newFrame(frame);
    }
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_NE(reported.find("cannot write"), std::string::npos) << reported;
    EXPECT_FALSE((*recorder)->waitFor(scene.sequence() + 1, 60s));
    EXPECT_NE((*recorder)->failure().find("cannot write"), std::string::npos);
    EXPECT_FALSE((*recorder)->stop());
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    while (*(*replayer)->step()) {
    }
    EXPECT_GE((*replayer)->scene().sequence(), (*recorder)->acknowledged());
    EXPECT_TRUE((*replayer)->log().damage().empty());
}

TEST_F(Recorder, KilledAtAnyMomentKeepsEveryAcknowledgedState) {
#ifdef __SANITIZE_THREAD__
    GTEST_SKIP() << "ThreadSanitizer does not let a forked process start threads";
#endif
    const std::uint64_t seed = 91;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    std::uint64_t acknowledgedInAll = 0;
    for (int round = 0; round < 20; ++round) {
        int pipes[2];
        ASSERT_EQ(pipe(pipes), 0);
        const pid_t child = fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            Scene scene;
            LogOptions options;
            options.keyframeBytes = 2000;
            auto recorder = LogRecorder::start(scene, file(), options);
            if (!recorder) _exit(1);
            RandomEdits edits(scene, seed + static_cast<std::uint64_t>(round));
            for (int frame = 0;; ++frame) {
                for (int i = 0; i < 6; ++i) edits.step();
                scene.newFrame(frame * .1);
                const std::uint64_t acknowledged = (*recorder)->acknowledged();
                if (::write(pipes[1], &acknowledged, sizeof(acknowledged)) < 0) _exit(1);
            }
        }
        ::close(pipes[1]);
        std::uint64_t acknowledged = 0;
        const std::uint64_t wanted = random() % 100;
        while (acknowledged < wanted && ::read(pipes[0], &acknowledged, 8) == 8) {
        }
        ::usleep(static_cast<useconds_t>(random() % 2000));
        ::kill(child, SIGKILL);
        ::waitpid(child, nullptr, 0);
        while (::read(pipes[0], &acknowledged, 8) == 8) {
        }
        ::close(pipes[0]);
        acknowledgedInAll += acknowledged;
        if (acknowledged == 0) continue;
        auto replayer = Replayer::open(file());
        ASSERT_TRUE(replayer) << replayer.error().text;
        while (*(*replayer)->step()) {
        }
        EXPECT_GE((*replayer)->scene().sequence(), acknowledged);
        EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
        EXPECT_EQ((*replayer)->gaps(), 0u);
    }
    EXPECT_GT(acknowledgedInAll, 200u);
}

TEST_F(Recorder, ASceneThatGoesFirstEndsTheLogInOrder) {
    auto scene = std::make_unique<Scene>();
    auto recorder = LogRecorder::start(*scene, file());
    ASSERT_TRUE(recorder);
    scene->newFrame(1);
    const std::uint64_t state = scene->sequence();
    ASSERT_TRUE((*recorder)->waitFor(state, 60s));
    EXPECT_TRUE((*recorder)->stop());
    scene.reset();
    recorder->reset();
    EXPECT_TRUE(LogReader::open(file())->damage().empty());
}

TEST_F(Recorder, WhatCannotBeStartedIsAnError) {
    Scene scene;
    EXPECT_FALSE(LogRecorder::start(scene, folder / "gone" / "a.rlog"));
    LogOptions options;
    options.mode.mode = Mode::input;
    EXPECT_FALSE(LogRecorder::start(scene, file(), options));
}

}  // namespace
}  // namespace rtsg
