// The findings of a log check about incomplete logs, with their frames; and the result of comparing such logs.
#include <rtsg/sync/log_check.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <algorithm>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log_compact.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

class LogChecks : public LogFolder {
  protected:
    struct Checked {
        std::optional<Divergence> first;
        std::uint64_t gaps = 0, last = 0, unclosed = 0;
    };
    /// `whole`: with what the end tells.
    static Checked check(const std::filesystem::path& path, bool whole = false) {
        auto replayer = Replayer::open(path);
        if (!replayer) {
            ADD_FAILURE() << replayer.error().format();
            return {};
        }
        LogCheck check(**replayer);
        while (check.step().value_or(true)) continue;
        if (whole) check.expectClosed();
        return {check.first(), (*replayer)->gaps(), (*replayer)->scene().sequence(), (*replayer)->unclosedSessions()};
    }
    /// The bytes of the records `from` to `to`, without the latter.
    static std::string bytesOf(const std::filesystem::path& path, std::size_t from, std::size_t to) {
        const auto records = recordsOf(path);
        const std::string bytes = readAll(path);
        return bytes.substr(records[from].first,
                            (to < records.size() ? records[to].first : bytes.size()) - records[from].first);
    }
    static std::size_t indexOf(const std::filesystem::path& path, RecordKind kind, std::uint64_t to) {
        const auto records = recordsOf(path);
        const auto found =
            std::ranges::find_if(records, [&](const auto& r) { return r.second.kind == kind && r.second.to == to; });
        EXPECT_NE(found, records.end());
        return static_cast<std::size_t>(found - records.begin());
    }
};

/// A replica that was given its state anew, as its own log has it: states 1 to 4, twice.
void recordRejoining(const std::filesystem::path& file, bool closes) {
    auto log = LogWriter::create(file, builtinTypes());
    ASSERT_TRUE(log);
    for (const double start : {10., 20.}) {
        Scene scene;
        scene.createNode(x3d::Group::type);
        const Attachment attachment = scene.bus().attach(**log);
        for (int frame = 0; frame < 3; ++frame) scene.newFrame(start + frame);
        if (closes) {
            ASSERT_TRUE((*log)->endSession());
        }
        if (start < 20) continue;
        ASSERT_TRUE((*log)->close());
    }
}

TEST_F(LogChecks, ASessionThatAnotherFollowsIsNotWholeUnlessItWasClosed) {
    recordRejoining(file("closed.rlog"), true);
    const Checked closed = check(file("closed.rlog"), true);
    EXPECT_FALSE(closed.first) << closed.first->format();
    EXPECT_EQ(closed.unclosed, 0U);

    recordRejoining(file(), false);
    EXPECT_FALSE(check(file()).first) << "asked for by expectClosed() alone";
    const Checked open = check(file(), true);
    EXPECT_EQ(open.gaps, 0U);
    EXPECT_EQ(open.unclosed, 1U);
    ASSERT_TRUE(open.first);
    EXPECT_EQ(open.first->frame, 5U);
    EXPECT_EQ(open.first->time, 12.);
    EXPECT_EQ(
        open.first->text,
        "the session was not closed: nothing tells what came after state 4 and before state 1 of the session that "
        "follows it in the log");

    // Compacted, each is what it was.
    for (const auto& [name, expected] : {std::pair("closed.rlog", 0U), std::pair("a.rlog", 1U)}) {
        ASSERT_TRUE(compactLog(file(name), file(std::string("short-") + name), {}));
        EXPECT_EQ(check(file(std::string("short-") + name), true).unclosed, expected) << name;
    }
}

/// The first fault is named: a session's open end, or damage before it.
TEST_F(LogChecks, AnOpenEndDoesNotHideWhatCameBeforeIt) {
    recordRejoining(file(), false);
    const std::size_t third = indexOf(file(), RecordKind::frame, 3);
    writeAll(file("b.rlog"), bytesOf(file(), 0, third) + "rubbish" + bytesOf(file(), third, 1000));
    const Checked damaged = check(file("b.rlog"), true);
    EXPECT_EQ(damaged.unclosed, 1U);
    ASSERT_TRUE(damaged.first);
    EXPECT_TRUE(damaged.first->text.contains("damaged")) << damaged.first->text;
    // Cut at its end: the open end in its middle is still what came first.
    writeAll(file("c.rlog"), bytesOf(file(), 0, recordsOf(file()).size() - 1) + "torn");
    const Checked torn = check(file("c.rlog"), true);
    ASSERT_TRUE(torn.first);
    EXPECT_TRUE(torn.first->text.contains("the session was not closed")) << torn.first->text;
    // If there are several, the first one.
    writeAll(file("d.rlog"), bytesOf(file(), 0, recordsOf(file()).size() - 1) + readAll(file()));
    const Checked several = check(file("d.rlog"), true);
    EXPECT_EQ(several.unclosed, 3U);
    ASSERT_TRUE(several.first);
    EXPECT_EQ(several.first->time, 12.);
}

/// Frames without their keyframe, and behind them a keyframe of a session that counts from 1 again.
TEST_F(LogChecks, AGapThatEndsInALowerStateNamesNoRangeOfFrames) {
    const Recorded recorded = record(file(), 30, 5);
    record(file("other.rlog"), 4, 5);
    const std::size_t frame = indexOf(file(), RecordKind::frame, recorded.last);
    const std::string head = bytesOf(file("other.rlog"), 0, 1);
    writeAll(file("b.rlog"),
             bytesOf(file(), 0, frame) + head + bytesOf(file(), frame, frame + 1) + readAll(file("other.rlog")));
    const Checked found = check(file("b.rlog"));
    EXPECT_EQ(found.gaps, 1U);
    EXPECT_LT(found.last, recorded.last);
    ASSERT_TRUE(found.first);
    EXPECT_EQ(found.first->frame, recorded.last);
    EXPECT_TRUE(found.first->text.starts_with(
        fmt::format("frames stand behind state {} that do not lead on from it", recorded.last - 1)))
        << found.first->text;
}

TEST_F(LogChecks, MissingFramesAreNamedFromTheFirstOn) {
    record(file(), 60, 5, denseKeyframes());
    const auto records = recordsOf(file());
    const auto frame = std::ranges::find_if(records.begin() + 20, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    const auto at = static_cast<std::size_t>(frame - records.begin());
    const auto next =
        std::ranges::find_if(frame, records.end(), [](const auto& r) { return r.second.kind == RecordKind::keyframe; });
    writeAll(file("b.rlog"), bytesOf(file(), 0, at) + bytesOf(file(), at + 1, records.size()));
    const Checked found = check(file("b.rlog"));
    ASSERT_TRUE(found.first);
    EXPECT_EQ(found.first->frame, frame->second.to);
    EXPECT_EQ(found.first->text.substr(0, 30),
              fmt::format("frames {} to {} are missing", frame->second.to, next->second.to).substr(0, 30));
}

/// One that cannot be applied, though intact: told with the frame it would have led to.
TEST_F(LogChecks, ARecordThatCannotBeAppliedIsNamedByItsFrame) {
    const Recorded recorded = record(file(), 30, 5);
    std::string bytes = readAll(file());
    const std::size_t frame = indexOf(file(), RecordKind::frame, recorded.last - 3);
    const auto [offset, header] = recordsOf(file())[frame];
    ByteBuffer forged;
    forged.append(asBytes(bytes).subspan(offset, kRecordHeaderSize));
    forged.append(asBytes("\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff"));
    sealRecord(forged, header);
    writeAll(file("b.rlog"), bytesOf(file(), 0, frame) +
                                 std::string(reinterpret_cast<const char*>(forged.data()), forged.size()) +
                                 bytesOf(file(), frame + 1, 1000));
    const Checked found = check(file("b.rlog"));
    ASSERT_TRUE(found.first);
    EXPECT_EQ(found.first->frame, recorded.last - 3);
    EXPECT_TRUE(found.first->text.contains(fmt::format("at byte {}", offset))) << found.first->text;
}

/// The last two pieces the wrong way round.
TEST_F(LogChecks, PiecesInAnotherOrderAreNamedBehindTheLastState) {
    LogOptions options;
    options.rotateSeconds = 1;
    const Recorded recorded = record(file(), 40, 5, options);
    writeAll(file("b.rlog"), readAll(file("a.0001.rlog")) + readAll(file()) + readAll(file("a.0002.rlog")));
    const Checked found = check(file("b.rlog"));
    ASSERT_TRUE(found.first);
    // The gap is there first; alone, the frames of before are what is wrong.
    EXPECT_TRUE(found.first->text.contains("are missing")) << found.first->text;
    writeAll(file("c.rlog"), readAll(file()) + readAll(file("a.0001.rlog")));
    const Checked behind = check(file("c.rlog"));
    ASSERT_TRUE(behind.first);
    EXPECT_EQ(behind.first->frame, recorded.last + 1);
    EXPECT_TRUE(behind.first->text.contains(fmt::format("stand after state {}", recorded.last))) << behind.first->text;
}

/// `frame` is the one that is yet to come, whether somebody writes it or nobody will.
TEST_F(LogChecks, AnEndThatIsOpenIsNamedBehindTheLastState) {
    for (const bool writing : {true, false}) {
        Scene scene;
        scene.createNode(x3d::Group::type);
        LogOptions options;
        options.existing = Existing::replace;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().format();
        {
            const Attachment attachment = scene.bus().attach(**log);
            for (int frame = 0; frame < 3; ++frame) scene.newFrame(frame);
        }
        if (!writing) (*log)->abandon();
        const Checked found = check(file(), true);
        ASSERT_TRUE(found.first);
        EXPECT_EQ(found.first->frame, 5U);
        EXPECT_EQ(found.first->text, writing ? "the log is still being written: states after 4 are yet to come"
                                             : "the log was not closed: nothing tells what came after state 4");
    }
}

/// Which of the two it is that has them makes no difference.
TEST_F(LogChecks, DiffNamesTheOneWhosePiecesAreInAnotherOrder) {
    LogOptions options;
    options.rotateSeconds = 1;
    record(file(), 25, 5, options);
    const std::string first = readAll(file("a.0001.rlog")), second = readAll(file("a.0002.rlog")),
                      third = readAll(file());
    writeAll(file("right.rlog"), first + second + third);
    writeAll(file("wrong.rlog"), first + second + third + first);
    for (const auto& [a, b] : {std::pair("right.rlog", "wrong.rlog"), std::pair("wrong.rlog", "right.rlog")}) {
        const auto found = diffLogs(file(a), file(b));
        ASSERT_TRUE(found) << found.error().format();
        ASSERT_TRUE(*found) << a;
        EXPECT_TRUE((*found)->text.contains("the pieces of " + file("wrong.rlog").string() + " are in another order"))
            << (*found)->text;
    }
}

/// A state that both hold counts as one of both, whichever of them has frames merged before it.
TEST_F(LogChecks, DiffCountsTheStatesOfBothAndOfOne) {
    record(file("all.rlog"), 40, 5);
    CompactOptions merged;
    merged.every = 3;
    ASSERT_TRUE(compactLog(file("all.rlog"), file("few.rlog"), merged));
    std::uint64_t all = 0, few = 0;
    for (const auto& [name, count] : {std::pair("all.rlog", &all), std::pair("few.rlog", &few)}) {
        auto replayer = Replayer::open(file(name));
        while (*(*replayer)->step()) ++*count;
    }
    for (const auto& [a, b] : {std::pair("all.rlog", "few.rlog"), std::pair("few.rlog", "all.rlog")}) {
        ComparedStates states;
        const auto found = diffLogs(file(a), file(b), {}, &states);
        ASSERT_TRUE(found && !*found);
        EXPECT_EQ(states.both, few);
        EXPECT_EQ(states.one, all - few);
    }
}

/// In input mode the frames behind a gap cannot be run; that is one gap, to the next keyframe.
TEST_F(LogChecks, InputsBehindAGapAreOneGap) {
    LogOptions options;
    options.mode.mode = Mode::input;
    {
        Scene scene;
        scene.setInputRecording(true);
        const NodeId box = scene.createNode(x3d::Transform::type);
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log);
        const Attachment attachment = scene.bus().attach(**log);
        for (int frame = 0; frame < 8; ++frame) {
            ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(static_cast<float>(frame))));
            scene.newFrame(frame);
        }
        ASSERT_TRUE((*log)->close());
    }
    // A head of another session, but none of its states: what follows leads on from nothing.
    {
        auto other = LogWriter::create(file("head.rlog"), builtinTypes(), options);
        ASSERT_TRUE(other && (*other)->close());
    }
    const std::string head = bytesOf(file("head.rlog"), 0, 1);
    const std::size_t fifth = indexOf(file(), RecordKind::input, 5);
    writeAll(file("b.rlog"), bytesOf(file(), 0, fifth) + head + bytesOf(file(), fifth, 1000));
    const Checked found = check(file("b.rlog"));
    EXPECT_EQ(found.gaps, 1U);
    EXPECT_EQ(found.last, 4U);
    ASSERT_TRUE(found.first);
    EXPECT_EQ(found.first->frame, 5U);
    EXPECT_TRUE(found.first->text.contains("no keyframe")) << found.first->text;
    // Without the input of one frame, those of all others behind it.
    writeAll(file("c.rlog"), bytesOf(file(), 0, fifth) + bytesOf(file(), fifth + 1, 1000));
    const Checked hole = check(file("c.rlog"));
    EXPECT_EQ(hole.gaps, 1U);
    EXPECT_EQ(hole.last, 4U);
    ASSERT_TRUE(hole.first);
    EXPECT_EQ(hole.first->frame, 5U);
}

}  // namespace
}  // namespace rtsg
