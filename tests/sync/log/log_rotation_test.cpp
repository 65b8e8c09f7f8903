// Logs in pieces: each a whole log of the same session, together every state once; and those that are too old let go.
#include <algorithm>
#include <csignal>

#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log_check.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

/// No file may become longer, as on a disk that is full.
class FileSizeLimit {
  public:
    explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
        ::getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit limit{bytes, before_.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~FileSizeLimit() {
        ::setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }
    FileSizeLimit(const FileSizeLimit&) = delete;
    FileSizeLimit& operator=(const FileSizeLimit&) = delete;

  private:
    rlimit before_{};
    void (*handler_)(int);
};

class Rotation : public LogFolder {
  protected:
    std::vector<std::filesystem::path> files() const {
        std::vector<std::filesystem::path> result;
        for (const auto& entry : std::filesystem::directory_iterator(folder)) result.push_back(entry.path());
        std::ranges::sort(result);  // a.0001.rlog … a.rlog: in order of time
        return result;
    }
    struct Piece {
        std::uint64_t epoch = 0, first = 0, last = 0;
        bool closed = false, goesOn = false;
    };
    /// Replays it, and expects every state to be the recorded one.
    Piece check(const std::filesystem::path& path, const Recorded& recorded) {
        Piece piece;
        auto replayer = Replayer::open(path);
        EXPECT_TRUE(replayer) << replayer.error().format();
        while (true) {
            const auto more = (*replayer)->step();
            EXPECT_TRUE(more) << more.error().format();
            if (!more || !*more) break;
            const std::uint64_t state = (*replayer)->scene().sequence();
            if (state > 0) {
                EXPECT_EQ((*replayer)->scene().dump(), recorded.dumps.at(state));
            }
            if (piece.last == 0) piece.first = state;
            piece.last = state;
        }
        piece.epoch = (*replayer)->head().epoch;
        piece.closed = (*replayer)->log().closed();
        piece.goesOn = (*replayer)->log().goesOn();
        EXPECT_EQ((*replayer)->gaps(), 0u);
        EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
        return piece;
    }
    void expectOneSession(const Recorded& recorded) {
        const auto all = files();
        ASSERT_GT(all.size(), 3u);
        Piece before;
        for (const auto& path : all) {
            SCOPED_TRACE(path);
            const Piece piece = check(path, recorded);
            EXPECT_EQ(piece.closed, path == all.back());
            EXPECT_EQ(piece.goesOn, path != all.back());
            if (before.last > 0) {
                EXPECT_EQ(piece.epoch, before.epoch);
                EXPECT_EQ(piece.first, before.last);  // where the one before ends, again as a keyframe
            }
            before = piece;
        }
        EXPECT_EQ(before.last, recorded.last);
        EXPECT_EQ(all.back().filename(), "a.rlog");
        EXPECT_EQ(all.front().filename(), "a.0001.rlog");
    }
};

TEST_F(Rotation, BySizeKeepsEveryStateOnce) {
    for (const Coding coding : {Coding::raw, Coding::smallest}) {
        for (const auto& path : files()) std::filesystem::remove(path);
        LogOptions options;
        options.mode.coding = coding;
        options.rotateBytes = 6000;
        expectOneSession(record(file(), 300, 3, options));
    }
}

TEST_F(Rotation, ByTime) {
    LogOptions options;
    options.rotateSeconds = 1;
    const Recorded recorded = record(file(), 60, 4, options);
    expectOneSession(recorded);
    EXPECT_EQ(files().size(), 6u);  // 5.9 s
}

TEST_F(Rotation, OldPiecesAreLetGo) {
    LogOptions options;
    options.rotateSeconds = .5;
    options.keepSeconds = 2;
    const Recorded recorded = record(file(), 100, 5, options);
    const auto all = files();
    // The last two seconds are complete, and at most one more piece is kept.
    const Piece oldest = check(all.front(), recorded);
    EXPECT_LE(recorded.times.at(oldest.first), 9.9 - 2);
    EXPECT_GE(recorded.times.at(oldest.first), 9.9 - 2 - 1.2);
    EXPECT_EQ(check(all.back(), recorded).last, recorded.last);
}

TEST_F(Rotation, OldPiecesAreLetGoByBytes) {
    LogOptions options;
    options.rotateBytes = 6000;
    options.keepBytes = 200'000;
    const Recorded recorded = record(file(), 500, 3, options);
    const auto all = files();
    std::uintmax_t bytes = 0;
    for (const auto& path : all) bytes += std::filesystem::file_size(path);
    EXPECT_LE(bytes, options.keepBytes + options.keepBytes / 10);  // a file may be larger than the one before
    EXPECT_GT(bytes, options.keepBytes / 2);
    EXPECT_NE(all.front().filename(), "a.0001.rlog");
    EXPECT_EQ(check(all.back(), recorded).last, recorded.last);
    const auto newest = Replayer::open(all.back());
    ASSERT_TRUE(newest);
    EXPECT_TRUE((*newest)->step());
    EXPECT_GT((*newest)->laterPiece().value_or(LaterPiece{}).letGo, 0);
}

/// No disk is so empty: only the newest stay.
TEST_F(Rotation, OldPiecesAreLetGoForWhatMustStayFree) {
    LogOptions options;
    options.rotateBytes = 6000;
    options.keepFree = .999999;
    const Recorded recorded = record(file(), 200, 3, options);
    const auto all = files();
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(check(all.front(), recorded).last, check(all.back(), recorded).first);
    EXPECT_EQ(check(all.back(), recorded).last, recorded.last);
}

/// Recording goes on, younger pieces go in their turn, and that one once it can.
TEST_F(Rotation, AnOldPieceThatCannotBeRemovedIsTriedAgain) {
    LogOptions options;
    options.rotateSeconds = .5;
    options.keepSeconds = 2;
    Scene scene;
    test::RandomEdits edits(scene, 5);
    auto log = LogWriter::create(file(), builtinTypes(), options);
    ASSERT_TRUE(log) << log.error().format();
    const Attachment attachment = scene.bus().attach(**log);
    int frame = 0;
    const auto run = [&](int until) {
        for (; frame < until; ++frame) {
            edits.step();
            scene.newFrame(frame * .1);
        }
    };
    run(20);
    const std::filesystem::path oldest = files().front(), second = files().at(1);
    ASSERT_NE(second, file());
    std::filesystem::remove(oldest);
    std::filesystem::create_directory(oldest);  // with something in it nobody can remove it, root neither
    writeAll(oldest / "something", "");
    run(60);
    EXPECT_TRUE(std::filesystem::exists(oldest));
    EXPECT_FALSE(std::filesystem::exists(second));
    std::filesystem::remove(oldest / "something");
    run(70);
    EXPECT_FALSE(std::filesystem::exists(oldest));
    EXPECT_EQ(attachment.failure(), "");
    EXPECT_TRUE((*log)->close());
}

/// As after a kill: earlier pieces of the session grow old too, and the kept ones have no gap.
TEST_F(Rotation, ASessionThatGoesOnLetsItsOldPiecesGo) {
    record(file("a.0001.rlog"), 30, 4);  // another session, which only has such a name
    constexpr std::size_t strange = 1;
    Scene scene;
    test::RandomEdits edits(scene, 5);
    int frame = 0;
    std::uint64_t epoch = 0;
    for (const int until : {60, 110}) {
        LogOptions options;
        options.rotateSeconds = .5;
        options.keepSeconds = 2;
        options.epoch = epoch;
        options.append = epoch != 0;
        options.existing = Existing::replace;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().format();
        epoch = (*log)->epoch();
        const Attachment attachment = scene.bus().attach(**log);
        for (; frame < until; ++frame) {
            edits.step();
            scene.newFrame(frame * .1);
        }
        EXPECT_EQ(attachment.failure(), "");
        (*log)->abandon();
    }
    auto all = files();
    ASSERT_GT(all.size(), strange + 3);
    all.erase(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(strange));
    std::string together;
    for (const auto& path : all) together += readAll(path);
    writeAll(file("together"), together);
    auto replayer = Replayer::open(file("together"));
    ASSERT_TRUE(replayer);
    ASSERT_TRUE(*(*replayer)->step());
    EXPECT_LE((*replayer)->scene().now(), 10.9 - 2);
    EXPECT_GE((*replayer)->scene().now(), 10.9 - 2 - 1.2);
    EXPECT_EQ((*replayer)->head().epoch, epoch);
    while (*(*replayer)->step()) continue;
    EXPECT_EQ((*replayer)->gaps(), 0U);
    EXPECT_EQ((*replayer)->unclosedSessions(), 0U);
    EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
}

/// Each start less than a piece after the last: what the file holds already counts.
TEST_F(Rotation, ASessionThatStartsAgainAndAgainRotatesAllTheSame) {
    Scene scene;
    test::RandomEdits edits(scene, 5);
    int frame = 0;
    std::uint64_t epoch = 0;
    for (int start = 0; start < 10; ++start) {
        LogOptions options;
        options.rotateSeconds = 1;
        options.epoch = epoch;
        options.append = epoch != 0;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().format();
        epoch = (*log)->epoch();
        const Attachment attachment = scene.bus().attach(**log);
        for (const int until = frame + 8; frame < until; ++frame) {
            edits.step();
            scene.newFrame(frame * .1);
        }
        EXPECT_EQ(attachment.failure(), "");
        (*log)->abandon();
    }
    EXPECT_GE(files().size(), 7U) << "of 8 s, in pieces of 1 s";
}

/// They would look like the first ones of the new session.
TEST_F(Rotation, PiecesOfAnEarlierRecordingGoWithIt) {
    LogOptions options;
    options.rotateSeconds = 1;
    for (const bool whole : {true, false}) {
        record(file(), 40, 6, options);
        ASSERT_EQ(files().size(), 4u);
        if (!whole) std::filesystem::remove(file());
        const auto before = files();
        options.existing = Existing::keep;
        const auto refused = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().file, whole ? file() : file("a.0001.rlog"));
        EXPECT_EQ(files(), before);
        options.existing = Existing::replace;
        const std::string other = readAll(file("a.0001.rlog"));
        const Recorded recorded = record(file(), 20, 8, options);
        EXPECT_EQ(files(), (std::vector{file("a.0001.rlog"), file()}));
        EXPECT_NE(readAll(file("a.0001.rlog")), other);
        check(file("a.0001.rlog"), recorded);
    }
}

/// Not before the new one has a state: a disk that is full costs nobody a log.
TEST_F(Rotation, PiecesOfAnEarlierRecordingStayUntilTheNewOneIsThere) {
    LogOptions options;
    options.rotateSeconds = 1;
    record(file(), 40, 6, options);
    const auto before = files();
    auto log = LogWriter::create(file(), builtinTypes(), options);
    ASSERT_TRUE(log);
    for (const auto& path : before) EXPECT_TRUE(std::filesystem::exists(path)) << path;
    (*log)->abandon();
    EXPECT_EQ(files(), before);
    // A recorder that does not rotate replaces that file only.
    record(file(), 5, 8);
    EXPECT_EQ(files(), before);
}

/// In a release of before, a first piece said nothing of those that follow: what they say is of its session.
TEST_F(Rotation, APieceIsOneByWhatIsInIt) {
    record(file("a.2024.rlog"), 5, 3);
    writeAll(file("a.2025.rlog"), "no log");
    EXPECT_TRUE(recordedPieces(file()).empty());
    LogOptions options;
    options.rotateSeconds = 1;
    record(file(), 40, 6, options);
    EXPECT_EQ(recordedPieces(file()).size(), 3u);
    record(file(), 40, 6, options);
    EXPECT_TRUE(std::filesystem::exists(file("a.2024.rlog")));
    EXPECT_TRUE(std::filesystem::exists(file("a.2025.rlog")));
    const auto pieces = recordedPieces(file());
    ASSERT_EQ(pieces.size(), 3u);
    writeAll(pieces[0], readAll(pieces[0]).substr(0, readAll(pieces[0]).size() - 20));
    EXPECT_EQ(recordedPieces(file()), pieces);
    std::filesystem::remove(file());
    EXPECT_EQ(recordedPieces(file()), pieces);
}

/// Copies by somebody else whose names look alike are left alone, and what is no file is not waited for.
TEST_F(Rotation, ACopyOrAPipeIsNoPiece) {
    LogOptions options;
    options.rotateSeconds = 1;
    record(file(), 40, 6, options);
    const auto pieces = recordedPieces(file());
    ASSERT_EQ(pieces.size(), 3u);
    const auto copy = file("a.20261128.rlog"), other = file("a.00003.rlog"), pipe = file("a.0009.rlog");
    std::filesystem::copy_file(file(), copy);
    std::filesystem::copy_file(file(), other);
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    EXPECT_EQ(recordedPieces(file()), pieces);
    options.existing = Existing::replace;
    record(file(), 20, 8, options);
    EXPECT_TRUE(std::filesystem::exists(copy));
    EXPECT_TRUE(std::filesystem::exists(other));
}

/// The next file has no room for its first state (which is there twice): the session keeps its name. It goes on, and
/// nobody writes how.
TEST_F(Rotation, WhereTheNextFileHasNoRoomTheSessionKeepsItsName) {
    Scene scene;
    const NodeId text = scene.createNode(x3d::MetadataString::type);
    scene.newFrame(0);
    LogOptions options;
    options.rotateSeconds = 1;
    auto log = LogWriter::create(file(), builtinTypes(), options);
    ASSERT_TRUE(log);
    const Attachment attachment = scene.bus().attach(**log);
    constexpr std::size_t kLetters = 300'000;
    ASSERT_TRUE(scene.set(text, x3d::MetadataString::value, Array<String>{String(std::string(kLetters, 'x'))}));
    scene.newFrame(.5);
    {
        const FileSizeLimit limit(kLetters * 3 / 2);
        scene.newFrame(2);
    }
    EXPECT_FALSE(attachment.attached());
    EXPECT_NE(attachment.failure().find("cannot write"), std::string::npos) << attachment.failure();
    (void)(*log)->close();
    ASSERT_EQ(files(), std::vector{file()});
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    while (*(*replayer)->step()) continue;
    EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
    EXPECT_TRUE((*replayer)->log().goesOn());
}

/// The reports about a file that is joined from pieces of one session, and of others.
class JoinedPieces : public Rotation {
  protected:
    void SetUp() override {
        LogOptions options;
        options.rotateSeconds = 1;
        record(file(), 45, 6, options);
        record(file("other.rlog"), 20, 8);
        pieces_ = files();
        std::erase(pieces_, file("other.rlog"));
        ASSERT_EQ(pieces_.size(), 5u);
    }
    /// The first finding of a check; empty: nothing.
    std::string check(const std::vector<std::filesystem::path>& parts) {
        std::string together;
        for (const auto& part : parts) together += readAll(part);
        writeAll(file("joined.rlog"), together);
        auto replayer = Replayer::open(file("joined.rlog"));
        EXPECT_TRUE(replayer);
        LogCheck check(**replayer);
        while (*check.step()) continue;
        check.expectClosed();
        later_ = (*replayer)->laterPiece();
        unclosed_ = (*replayer)->unclosedSessions();
        return check.first() ? check.first()->text : "";
    }

    std::vector<std::filesystem::path> pieces_;
    std::optional<LaterPiece> later_;
    std::uint64_t unclosed_ = 0;
};

TEST_F(JoinedPieces, AreWholeWhenNoneIsMissing) {
    EXPECT_EQ(check(pieces_), "");
    EXPECT_FALSE(later_);
    auto all = pieces_;
    all.push_back(file("other.rlog"));
    EXPECT_EQ(check(all), "") << "two whole sessions";
    all.insert(all.begin(), file("other.rlog"));
    all.pop_back();
    EXPECT_EQ(check(all), "");
}

TEST_F(JoinedPieces, TellThatTheLastOnesAreMissing) {
    for (std::size_t count = 1; count < pieces_.size(); ++count)
        EXPECT_TRUE(check({pieces_.begin(), pieces_.begin() + static_cast<std::ptrdiff_t>(count)})
                        .contains("the session goes on in a next piece, which is not in the log"))
            << count;
}

TEST_F(JoinedPieces, TellThatOneInTheMiddleIsMissing) {
    EXPECT_TRUE(check({pieces_[0], pieces_[1], pieces_[3], pieces_[4]}).contains("are missing"));
}

TEST_F(JoinedPieces, TellThatAnotherSessionFollowsAPiece) {
    const std::string text = check({pieces_[0], file("other.rlog")});
    EXPECT_TRUE(
        text.starts_with("the session goes on in a piece that is not in the log: nothing tells what came after"))
        << text;
    EXPECT_EQ(unclosed_, 1u);
}

TEST_F(JoinedPieces, TellThatWhatFollowsAnotherSessionBeganBefore) {
    const std::string text = check({file("other.rlog"), pieces_[3], pieces_[4]});
    EXPECT_TRUE(text.contains("in a later piece: nothing tells what came before its state")) << text;
    EXPECT_EQ(unclosed_, 1u);
}

/// Which is no error, but told.
TEST_F(JoinedPieces, MayBeginLate) {
    EXPECT_EQ(check({pieces_[2], pieces_[3], pieces_[4]}), "");
    ASSERT_TRUE(later_);
    EXPECT_NEAR(later_->begins, 2, .15);
    EXPECT_EQ(later_->letGo, 0);
    EXPECT_EQ(later_->format(), "what came before is in pieces before it");
}

TEST_F(JoinedPieces, OfARingSayWhatWasLetGo) {
    for (const auto& path : files()) std::filesystem::remove(path);
    LogOptions options;
    options.rotateSeconds = .5;
    options.keepSeconds = 2;
    record(file(), 100, 5, options);
    const auto all = files();
    ASSERT_GT(all.size(), 3u);
    EXPECT_EQ(check(all), "");
    ASSERT_TRUE(later_);
    EXPECT_GT(later_->begins, 6);
    EXPECT_EQ(later_->letGo, later_->begins);
    EXPECT_EQ(later_->format(), "what came before was let go");
    const double kept = later_->begins;
    EXPECT_EQ(check({all.back()}), "");
    ASSERT_TRUE(later_);
    EXPECT_GT(later_->begins, kept);
    EXPECT_EQ(later_->letGo, kept);
    EXPECT_TRUE(later_->format().starts_with("what came before is in pieces before it, but for the first "));
}

/// A later piece keeps its statement when its session is continued, and so do the pieces that follow.
TEST_F(JoinedPieces, SayTheSameOnceTheSessionGoesOn) {
    for (const auto& path : files()) std::filesystem::remove(path);
    Scene scene;
    test::RandomEdits edits(scene, 5);
    LogOptions options;
    options.rotateSeconds = .5;
    options.keepSeconds = 2;
    int frame = 0;
    for (const int until : {60, 63, 90}) {
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().format();
        options.epoch = (*log)->epoch();
        options.append = true;
        options.keepSeconds = 0;  // what was let go stays so
        const Attachment attachment = scene.bus().attach(**log);
        for (; frame < until; ++frame) {
            edits.step();
            scene.newFrame(frame * .1);
        }
        EXPECT_EQ(attachment.failure(), "");
        until == 90 ? void((*log)->close()) : (*log)->abandon();
    }
    EXPECT_EQ(check(files()), "");
    ASSERT_TRUE(later_);
    EXPECT_GE(later_->begins, 3);
    EXPECT_EQ(later_->letGo, later_->begins);
    EXPECT_EQ(check({file()}), "");
    ASSERT_TRUE(later_);
    EXPECT_GT(later_->begins, 8);
}

/// A log's own name is never without a file, nor with one that has no state yet: it only ever goes over to another.
TEST_F(Rotation, TheLogsOwnNameAlwaysLeadsToASession) {
    const int watch = ::inotify_init1(IN_CLOEXEC | IN_NONBLOCK);
    ASSERT_GE(watch, 0);
    LogOptions options;
    options.rotateSeconds = 1;
    ASSERT_GE(::inotify_add_watch(watch, folder.c_str(), IN_CREATE | IN_DELETE | IN_MOVED_FROM | IN_MOVED_TO), 0);
    record(file(), 60, 4, options);
    std::vector<std::string> events;  // of that name
    alignas(inotify_event) char buffer[65536];
    for (ssize_t length; (length = ::read(watch, buffer, sizeof(buffer))) > 0;)
        for (const char* at = buffer; at < buffer + length;) {
            const auto& event = *reinterpret_cast<const inotify_event*>(at);
            at += sizeof(event) + event.len;
            if (event.len == 0 || std::string_view(event.name) != "a.rlog") continue;
            events.push_back(event.mask & IN_CREATE     ? "made"
                             : event.mask & IN_MOVED_TO ? "another takes its place"
                                                        : "gone");
        }
    ::close(watch);
    std::vector<std::string> expected(files().size(), "another takes its place");
    expected.front() = "made";
    EXPECT_EQ(events, expected);
}

/// Killed while the file had both its names: it goes on under its own, and is no piece.
TEST_F(Rotation, AFileThatWasToBecomeAPieceIsNone) {
    LogOptions options;
    options.rotateSeconds = 1;
    record(file(), 15, 4, options);
    ASSERT_EQ(files().size(), 2u);
    std::filesystem::create_hard_link(file(), file("a.0002.rlog"));
    options.append = true;
    options.epoch = 1;
    auto log = LogWriter::create(file(), builtinTypes(), options);
    ASSERT_TRUE(log) << log.error().format();
    EXPECT_EQ(files(), (std::vector{file("a.0001.rlog"), file()}));
}

/// The pieces in the order of their numbers are in the order of their writing, though old ones were let go.
TEST_F(Rotation, PiecesOfALaterWriterComeBehindThoseThatAreThere) {
    Scene scene;
    test::RandomEdits edits(scene, 5);
    LogOptions options;
    options.rotateSeconds = 1;
    int frame = 0;
    std::size_t before = 0;
    for (const int until : {30, 60}) {
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().format();
        options.append = true;
        options.epoch = (*log)->epoch();
        const Attachment attachment = scene.bus().attach(**log);
        for (; frame < until; ++frame) {
            edits.step();
            scene.newFrame(frame * .1);
        }
        EXPECT_EQ(attachment.failure(), "");
        ASSERT_TRUE((*log)->close());
        if (until == 60) break;
        before = files().size();
        ASSERT_TRUE(std::filesystem::exists(file("a.0002.rlog")));
        std::filesystem::remove(file("a.0001.rlog"));
        writeAll(file("a.20260101.rlog"), "a date is no number of a piece");
    }
    EXPECT_FALSE(std::filesystem::exists(file("a.0001.rlog")));
    EXPECT_GT(files().size(), before + 2);
}

}  // namespace
}  // namespace rtsg
