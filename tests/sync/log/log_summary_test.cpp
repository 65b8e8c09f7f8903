// The summary of a log, whole and damaged.
#include <rtsg/sync/log_summary.h>

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using Summary = LogFolder;

TEST_F(Summary, CountsWhatIsThere) {
    const Recorded recorded = record(file(), 40, 5, denseKeyframes());
    const auto summary = summariseLog(file());
    ASSERT_TRUE(summary) << summary.error().format();
    EXPECT_EQ(summary->bytes, std::filesystem::file_size(file()));
    EXPECT_EQ(summary->lastState, recorded.dumps.rbegin()->first);
    EXPECT_DOUBLE_EQ(summary->end, recorded.times.rbegin()->second);
    EXPECT_EQ(summary->sessions, 1u);
    EXPECT_GT(summary->keyframes, 3u);
    EXPECT_EQ(summary->damaged, 0u);
    EXPECT_TRUE(summary->closed);
    EXPECT_EQ(summary->mode, "state");
    std::size_t nodes = 0;
    for (const auto& [type, count] : summary->types) nodes += count;
    EXPECT_EQ(nodes, summary->nodes);
    EXPECT_GT(nodes, 0u);
    EXPECT_TRUE(isLog(file()));
    // Appended to, it holds two sessions.
    LogOptions append;
    append.append = true;
    record(file(), 10, 6, append);
    EXPECT_EQ(summariseLog(file())->sessions, 2u);
}

/// The counts equal those from a look at every record.
TEST_F(Summary, RecordsAreCountedByTheirKinds) {
    for (const bool inputs : {false, true}) {
        SCOPED_TRACE(testing::Message() << "inputs " << inputs);
        Scene scene;
        scene.setInputRecording(inputs);
        const NodeId toggle = scene.createNode(x3d::BooleanToggle::type);
        scene.newFrame(3);
        LogOptions options = denseKeyframes();
        options.inputs = inputs;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log);
        {
            const Attachment attachment = scene.bus().attach(**log);
            for (int frame = 0; frame < 12; ++frame) {
                if (frame % 3 == 0) {
                    ASSERT_TRUE(scene.sendEvent(toggle, x3d::BooleanToggle::set_boolean.index, Value(frame % 2 == 0)));
                }
                scene.newFrame(4 + frame);
            }
        }
        ASSERT_TRUE((*log)->close());
        std::uint64_t came = 0;
        std::set<std::uint64_t> keyframes;
        for (const auto& [at, header] : recordsOf(file())) {
            came += header.kind == RecordKind::input;
            if (header.kind == RecordKind::keyframe) keyframes.insert(header.to);
        }
        EXPECT_EQ(came > 0, inputs);
        EXPECT_GT(keyframes.size(), 1u);
        const auto summary = summariseLog(file());
        ASSERT_TRUE(summary);
        EXPECT_EQ(summary->inputs, came);
        EXPECT_EQ(summary->keyframes, keyframes.size());
        EXPECT_EQ(summary->frames, 12u);
        EXPECT_EQ(summary->states, 13u);
        EXPECT_EQ(summary->lastState, scene.sequence());
        EXPECT_EQ(summary->firstState, scene.sequence() - 12);
        EXPECT_EQ(summary->start, 3);
        EXPECT_EQ(summary->end, 15);
        EXPECT_EQ(summary->nodes, 1u);
        EXPECT_EQ(summary->gaps, 0u) << "it begins with a later state of its scene";
        EXPECT_EQ(summary->missingFrames, 0u);
        EXPECT_FALSE(summary->goesOn);
        EXPECT_FALSE(summary->beingWritten);
    }
}

/// A session that begins with an earlier time goes on from where the one before it ended.
TEST_F(Summary, TimesOfSessionsFollowEachOther) {
    record(file(), 21, 5);  // 2 s
    const double first = summariseLog(file())->end;
    EXPECT_DOUBLE_EQ(first, 2);
    LogOptions append;
    append.append = true;
    record(file(), 11, 6, append);
    const auto summary = summariseLog(file());
    EXPECT_EQ(summary->sessions, 2u);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    while ((*replayer)->step().value_or(true)) continue;
    EXPECT_DOUBLE_EQ(summary->end, (*replayer)->time());
    EXPECT_DOUBLE_EQ(summary->end, 3);
    EXPECT_EQ(summary->states, (*replayer)->frames());
}

/// The numbers of a later session's states say nothing of the session before it.
TEST_F(Summary, ASessionThatBeginsWithALaterStateLacksNothing) {
    for (const bool cut : {false, true}) {
        SCOPED_TRACE(testing::Message() << "cut " << cut);
        const Recorded first = record(file(), 20, 5);
        std::uint64_t missing = 0;
        if (cut) {  // without the frame before the last one: two states are missing, and no keyframe follows
            const auto records = recordsOf(file());
            const auto frame = std::ranges::find_if(records, [&](const auto& r) {
                return r.second.kind == RecordKind::frame && r.second.to == first.last - 1;
            });
            ASSERT_NE(frame, records.end());
            writeAll(file(), readAll(file()).erase(frame->first, frame->second.size()));
            missing = 2;
        }
        Scene scene;
        for (int frame = 0; frame < 100; ++frame) scene.newFrame(frame);
        LogOptions append;
        append.append = true;
        auto log = LogWriter::create(file(), builtinTypes(), append);
        ASSERT_TRUE(log);
        {
            const Attachment attachment = scene.bus().attach(**log);
            for (int frame = 100; frame < 110; ++frame) scene.newFrame(frame);
        }
        ASSERT_TRUE((*log)->close());
        const auto summary = summariseLog(file());
        ASSERT_TRUE(summary);
        EXPECT_EQ(summary->sessions, 2u);
        EXPECT_EQ(summary->gaps, cut ? 1u : 0u);
        EXPECT_EQ(summary->missingFrames, missing);
    }
}

/// States before its first one are not missing: only frames that a later record refers to are.
TEST_F(Summary, ALogThatHasLostItsBeginning) {
    record(file(), 60, 8, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file()), head = bytes.substr(0, records[1].first);
    ASSERT_EQ(records[0].second.kind, RecordKind::head);
    int keyframes = 0, frames = 0;
    for (std::size_t i = 1; i + 1 < records.size(); ++i) {
        const RecordHeader& first = records[i].second;
        const bool keyframe = first.kind == RecordKind::keyframe;
        const auto next = std::find_if(records.begin() + static_cast<std::ptrdiff_t>(i), records.end(),
                                       [](const auto& r) { return r.second.kind == RecordKind::keyframe; });
        if ((!keyframe && first.kind != RecordKind::frame) || next == records.end()) continue;
        writeAll(file("b.rlog"), head + bytes.substr(records[i].first));
        const auto summary = summariseLog(file("b.rlog"));
        ASSERT_TRUE(summary);
        EXPECT_EQ(summary->gaps, keyframe ? 0u : 1u) << "record " << i;
        EXPECT_EQ(summary->missingFrames, keyframe ? 0 : next->second.to - first.from) << "record " << i;
        ++(keyframe ? keyframes : frames);
    }
    EXPECT_GT(keyframes, 3);
    EXPECT_GT(frames, 20);
}

TEST_F(Summary, DamageIsCountedAndNoError) {
    record(file(), 20, 7);
    std::string bytes = readAll(file());
    bytes[bytes.size() / 2] ^= 1;
    writeAll(file(), bytes);
    const auto summary = summariseLog(file());
    ASSERT_TRUE(summary);
    EXPECT_EQ(summary->damaged, 1u);
    EXPECT_GT(summary->damagedBytes, 0u);
    writeAll(file(), "no log at all");
    EXPECT_FALSE(summariseLog(file()));
    EXPECT_FALSE(isLog(file()));
    EXPECT_FALSE(isLog("/dev/null"));
}

TEST_F(Summary, DamagedBytesAreThoseOfTheRecords) {
    record(file(), 20, 7);
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    std::size_t tried = 0;
    for (std::size_t i = 4; i + 4 < records.size(); i += 3, ++tried) {
        std::string harmed = bytes;
        std::size_t size = 0;
        for (const std::size_t k : {i, i + 2}) {
            harmed[records[k].first + records[k].second.size() - 1] ^= 1;
            size += records[k].second.size();
        }
        writeAll(file("b.rlog"), harmed);
        const auto summary = summariseLog(file("b.rlog"));
        ASSERT_TRUE(summary);
        EXPECT_EQ(summary->damaged, 2u);
        EXPECT_EQ(summary->damagedBytes, size);
    }
    EXPECT_GT(tried, 3u);
}

/// The counts equal those of a replay.
TEST_F(Summary, FramesThatAreMissingAreCounted) {
    const Recorded recorded = record(file(), 60, 8, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    EXPECT_EQ(summariseLog(file())->gaps, 0u);
    std::size_t gaps = 0;
    const auto expectAsReplayed = [&](const std::string& log, std::size_t which, std::uint64_t last = 0) {
        writeAll(file("b.rlog"), log);
        const auto summary = summariseLog(file("b.rlog"));
        auto replayer = Replayer::open(file("b.rlog"));
        ASSERT_EQ(summary.has_value(), replayer.has_value());
        if (!summary) return;  // no head is left
        std::set<std::uint64_t> reached;
        while ((*replayer)->step().value_or(true)) reached.insert((*replayer)->scene().sequence());
        EXPECT_EQ(summary->gaps, (*replayer)->gaps()) << "record " << which;
        EXPECT_EQ(summary->states, (*replayer)->frames()) << "record " << which;
        EXPECT_EQ(summary->missingFrames > 0, summary->gaps > 0) << "record " << which;
        EXPECT_EQ(summary->framesBehind, (*replayer)->framesBehind()) << "record " << which;
        // In a log that begins as it was recorded: all frames that a later record refers to and that were not reached.
        if (!reached.empty() && *reached.begin() == recorded.dumps.begin()->first && last > 0) {
            EXPECT_EQ(summary->missingFrames, last - *reached.begin() + 1 - reached.size()) << "record " << which;
        }
        gaps += summary->gaps;
    };
    for (std::size_t i = 0; i + 1 < records.size(); ++i) {
        const auto [at, header] = records[i];
        const std::string rest = bytes.substr(at + header.size());
        std::uint64_t last = 0;
        for (std::size_t k = 0; k < records.size(); ++k)
            if (k != i && records[k].second.kind != RecordKind::index) last = std::max(last, records[k].second.to);
        expectAsReplayed(bytes.substr(0, at) + rest, i, last);                                          // without it
        expectAsReplayed(bytes.substr(at), i);                                                          // from it on
        expectAsReplayed(bytes.substr(0, at) + bytes.substr(at, header.size()) + bytes.substr(at), i);  // twice
        const auto next = records[i + 1].second.size();
        expectAsReplayed(
            bytes.substr(0, at) + rest.substr(0, next) + bytes.substr(at, header.size()) + rest.substr(next),
            i);  // behind the next
    }
    EXPECT_GT(gaps, 50u);
    // Its halves in another order.
    const std::uint64_t middle = records[records.size() / 2].first;
    expectAsReplayed(bytes.substr(middle) + bytes.substr(0, middle), records.size());
}

}  // namespace
}  // namespace rtsg
