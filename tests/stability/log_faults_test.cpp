// Disks that are full, files that are read-only, deleted, cut or taken by another: each with a stated outcome.
#include <csignal>
#include <functional>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

class LogFaults : public LogFolder {
  protected:
    /// Random frames while the log is attached; what the bus reported when it no longer was.
    std::string runUntilDetached(LogWriter& log, int frames) {
        std::string reported;
        scene.bus().setReporter([&](const Diagnostic& d) { reported = d.text; });
        Attachment attachment = scene.bus().attach(log);
        RandomEdits edits(scene, 5);
        for (int frame = 0; frame < frames && attachment.attached(); ++frame) {
            for (int i = 0; i < 6; ++i) edits.step();
            scene.newFrame(time += .1);
            if (atFrame && attachment.attached()) atFrame(frame);
        }
        return reported;
    }
    static std::uint64_t framesIn(const std::filesystem::path& path, std::size_t damage = 0) {
        auto replayer = Replayer::open(path);
        EXPECT_TRUE(replayer) << replayer.error().text;
        if (!replayer) return 0;
        while (true) {
            const Result<bool> more = (*replayer)->step();
            EXPECT_TRUE(more) << more.error().text;
            if (!more || !*more) break;
        }
        EXPECT_EQ((*replayer)->log().damage().size(), damage);
        EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
        return (*replayer)->frames();
    }

    Scene scene;
    double time = 0;
    std::function<void(int)> atFrame;
};

TEST_F(LogFaults, NoRoomAtAllIsAnErrorWithItsReason) {
    const Result<std::unique_ptr<LogWriter>> none = LogWriter::create("/dev/full", builtinTypes());
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().text.find("No space left"), std::string::npos) << none.error().text;
    EXPECT_EQ(none.error().file, "/dev/full");
}

TEST_F(LogFaults, ADiskThatFillsUpDetachesTheLogAndLeavesWholeRecords) {
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    auto log = LogWriter::create(file(), builtinTypes());
    ASSERT_TRUE(log);
    rlimit limit = before;
    limit.rlim_cur = (*log)->bytes() + 20000;
    setrlimit(RLIMIT_FSIZE, &limit);
    const std::string reported = runUntilDetached(**log, 200);
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_NE(reported.find("cannot write"), std::string::npos) << reported;
    // The scene has gone on; only the log ends there.
    const std::uint64_t state = scene.sequence();
    scene.newFrame(time += 1);
    EXPECT_EQ(scene.sequence(), state + 1);
    EXPECT_TRUE((*log)->close());
    EXPECT_GT(framesIn(file()), 1u);
}

/// Root may write anywhere, so this is tried as nobody.
TEST_F(LogFaults, AFileThatMayNotBeWrittenIsRefusedAndLeftAlone) {
    record(file(), 5, 1);
    const std::string before = readAll(file());
    std::filesystem::permissions(file(), std::filesystem::perms(0444));
    std::filesystem::permissions(folder, std::filesystem::perms(0555));
    const pid_t child = fork();
    if (child == 0) {
        if (::geteuid() == 0 && ::setuid(65534) != 0) _exit(4);
        for (const auto& path : {file(), file("new.rlog")}) {
            const auto log = LogWriter::create(path, builtinTypes());
            if (log) _exit(1);
            if (log.error().text.find("Permission denied") == std::string::npos) _exit(2);
        }
        _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    std::filesystem::permissions(folder, std::filesystem::perms(0755));
    EXPECT_EQ(WEXITSTATUS(status), 0);
    EXPECT_EQ(readAll(file()), before);
    EXPECT_EQ(framesIn(file()), 5u + 1u);
}

TEST_F(LogFaults, AFolderThatIsNotThereIsAnError) {
    const auto log = LogWriter::create(folder / "gone" / "a.rlog", builtinTypes());
    ASSERT_FALSE(log);
    EXPECT_NE(log.error().text.find("No such file"), std::string::npos) << log.error().text;
}

TEST_F(LogFaults, ADeletedLogIsReportedAtTheNextKeyframe) {
    for (const bool wholeFolder : {false, true}) {
        std::filesystem::create_directories(folder / "in");
        auto log = LogWriter::create(folder / "in" / "a.rlog", builtinTypes(), denseKeyframes());
        ASSERT_TRUE(log);
        atFrame = [&](int frame) {
            if (frame == 5) std::filesystem::remove_all(wholeFolder ? folder / "in" : folder / "in" / "a.rlog");
        };
        const std::string reported = runUntilDetached(**log, 100);
        EXPECT_NE(reported.find("deleted while it was written"), std::string::npos) << reported;
    }
    // Without a keyframe in between, at the end.
    auto log = LogWriter::create(file(), builtinTypes());
    ASSERT_TRUE(log);
    std::filesystem::remove(file());
    const Result<> closed = (*log)->close();
    ASSERT_FALSE(closed);
    EXPECT_NE(closed.error().text.find("deleted"), std::string::npos);
}

TEST_F(LogFaults, ALogCutByAnotherIsReportedAndReadsUpToTheCut) {
    auto log = LogWriter::create(file(), builtinTypes(), denseKeyframes());
    ASSERT_TRUE(log);
    std::uint64_t bytesAtCut = 0;
    atFrame = [&](int frame) {
        if (frame != 20) return;
        bytesAtCut = (*log)->bytes() - 100;
        std::filesystem::resize_file(file(), bytesAtCut);
    };
    const std::string reported = runUntilDetached(**log, 100);
    EXPECT_NE(reported.find("changed by someone else"), std::string::npos) << reported;
    EXPECT_GT(framesIn(file(), 1), 15u);
}

TEST_F(LogFaults, AnotherWriterIsRefusedAndTheFirstOneGoesOn) {
    auto log = LogWriter::create(file(), builtinTypes());
    ASSERT_TRUE(log);
    runUntilDetached(**log, 10);
    for (const bool append : {false, true}) {
        LogOptions options;
        options.append = append;
        const auto second = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_FALSE(second);
        EXPECT_NE(second.error().text.find("another log writer"), std::string::npos);
    }
    EXPECT_TRUE((*log)->close());
    EXPECT_EQ(framesIn(file()), 11u);
}

/// A record that is being written is neither intact nor damaged; once its writer is gone, it is damaged.
TEST_F(LogFaults, TheRecordThatIsBeingWrittenIsNoDamage) {
    auto log = LogWriter::create(file(), builtinTypes());
    ASSERT_TRUE(log);
    runUntilDetached(**log, 20);
    const auto records = recordsOf(file());
    const auto begin = static_cast<std::size_t>(records.back().first), end = readAll(file()).size();
    const std::string last = readAll(file()).substr(begin);
    const std::uint64_t frames = framesIn(file());
    const auto cutTo = [&](std::size_t size) { std::filesystem::resize_file(file(), begin + size); };
    for (const std::size_t size : {std::size_t{1}, std::size_t{63}, std::size_t{64}, last.size() - 1}) {
        SCOPED_TRACE(size);
        cutTo(size);
        EXPECT_EQ(framesIn(file()), frames - 1);
        auto reader = LogReader::open(file());
        ASSERT_TRUE(reader);
        EXPECT_TRUE(reader->beingWritten());
        // Records that are complete at the time of reading count.
        cutTo(0);
        std::ofstream(file(), std::ios::app | std::ios::binary) << last << last;
        std::uint64_t to = 0;
        while (const auto record = reader->next()) to = record->offset + record->bytes.size();
        EXPECT_EQ(to, end);
        EXPECT_TRUE(reader->damage().empty());
    }
    cutTo(0);
    std::ofstream(file(), std::ios::app | std::ios::binary) << "no record" << last;
    EXPECT_EQ(framesIn(file(), 1), frames);  // damage is damage, whoever writes
    cutTo(100);
    (*log)->abandon();
    EXPECT_EQ(framesIn(file(), 1), frames - 1);
    EXPECT_FALSE(LogReader::open(file())->beingWritten());
}

/// A mapped file would end the reader with SIGBUS here.
TEST_F(LogFaults, ALogThatShrinksWhileItIsReadEndsWithTheDamageReported) {
    {
        auto log = LogWriter::create(file(), builtinTypes());
        ASSERT_TRUE(log);
        EXPECT_EQ(runUntilDetached(**log, 5000), "");
    }
    ASSERT_GT(std::filesystem::file_size(file()), 1u << 20);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    for (int i = 0; i < 100; ++i) ASSERT_TRUE((*replayer)->step());
    std::filesystem::resize_file(file(), std::filesystem::file_size(file()) / 2);
    while (true) {
        const Result<bool> more = (*replayer)->step();
        ASSERT_TRUE(more) << more.error().text;
        if (!*more) break;
    }
    EXPECT_GT((*replayer)->frames(), 500u);
    EXPECT_LT((*replayer)->frames(), 5000u);
    EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
    ASSERT_EQ((*replayer)->log().damage().size(), 1u);
    EXPECT_NE((*replayer)->log().damage()[0].text.find("truncated"), std::string::npos);
    // A reader that has opened it keeps a deleted log to its end.
    auto second = Replayer::open(file());
    std::filesystem::remove(file());
    std::uint64_t frames = 0;
    while (*(*second)->step()) ++frames;
    EXPECT_GT(frames, 500u);
    EXPECT_LE(frames, (*replayer)->frames());  // that one had read ahead
}

TEST_F(LogFaults, EveryWayToSyncIsTakenAndReadBack) {
    for (const auto sync : {LogOptions::Sync::atClose, LogOptions::Sync::atKeyframes, LogOptions::Sync::always}) {
        LogOptions options = denseKeyframes();
        options.sync = sync;
        const Recorded recorded = record(file(), 10, 12, options);
        EXPECT_EQ(replay(file(), recorded).states.size(), recorded.dumps.size());
    }
}

}  // namespace
}  // namespace rtsg
