// Compacting logs: what is kept, what is merged.
#include <rtsg/sync/log_compact.h>

#include <algorithm>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using Compaction = LogFolder;

TEST_F(Compaction, MergedFramesLeadToTheSameStates) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed)
        for (const std::uint64_t every : {1, 2, 7, 1000}) {
            SCOPED_TRACE(testing::Message() << "seed " << seed << ", every " << every);
            const Recorded recorded = record(file(), 50, seed, seed % 2 ? LogOptions{} : denseKeyframes());
            CompactOptions options;
            options.every = every;
            const auto report = compactLog(file(), file("b.rlog"), options);
            ASSERT_TRUE(report) << report.error().text;
            const Replayed replayed = replay(file("b.rlog"), recorded);
            ASSERT_FALSE(replayed.states.empty());
            EXPECT_EQ(replayed.states.back(), recorded.last);
            EXPECT_EQ(replayed.damage, 0u);
            EXPECT_EQ(report->statesWritten, 2 + (report->statesRead - 2 + every - 1) / every);
            EXPECT_EQ(report->bytesWritten, std::filesystem::file_size(file("b.rlog")));
            const auto difference = diffLogs(file(), file("b.rlog"));
            ASSERT_TRUE(difference);
            EXPECT_FALSE(*difference) << (*difference)->format();
        }
}

TEST_F(Compaction, APartInTimeBeginsAndEndsWithTheStatesAskedFor) {
    const Recorded recorded = record(file(), 60, 9);
    CompactOptions options;
    options.from = 2.05;
    options.to = 4.0;
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    const Replayed replayed = replay(file("b.rlog"), recorded);
    ASSERT_FALSE(replayed.states.empty());
    EXPECT_NEAR(recorded.times.at(replayed.states.front()), 2.0, 1e-9);
    EXPECT_NEAR(recorded.times.at(replayed.states.back()), 4.0, 1e-9);
    EXPECT_EQ(replayed.states.size(), 21u);
    EXPECT_LT(std::filesystem::file_size(file("b.rlog")), std::filesystem::file_size(file()));
}

/// 1.9 s, and 2.9 s whose times begin at 0 again.
TEST_F(Compaction, APartOfALaterSessionIsFoundByTheTimeSinceTheLogsStart) {
    record(file("first.rlog"), 20, 8);
    const Recorded second = record(file("second.rlog"), 30, 9);
    writeAll(file(), readAll(file("first.rlog")) + readAll(file("second.rlog")));
    CompactOptions options;
    options.from = 1.9 + .55;
    options.to = 1.9 + 1.55;
    const auto report = compactLog(file(), file("b.rlog"), options);
    ASSERT_TRUE(report) << report.error().text;
    const Replayed replayed = replay(file("b.rlog"), second);
    ASSERT_EQ(replayed.states.size(), 11u);
    EXPECT_NEAR(second.times.at(replayed.states.front()), .5, 1e-9);
    EXPECT_NEAR(second.times.at(replayed.states.back()), 1.5, 1e-9);
    EXPECT_EQ(report->lacks, "");
}

TEST_F(Compaction, AnIntervalThinsFramesOut) {
    const Recorded recorded = record(file(), 60, 10);
    CompactOptions options;
    options.interval = .5;
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    const Replayed replayed = replay(file("b.rlog"), recorded);
    // The first and the last, and of those between each that is half a second later than the one before.
    std::vector<std::uint64_t> kept{replayed.states.front()};
    for (const auto& [state, time] : recorded.times)
        if (state == recorded.last || (state > kept.back() && time - recorded.times.at(kept.back()) >= .5))
            kept.push_back(state);
    EXPECT_EQ(replayed.states, kept);
}

TEST_F(Compaction, DamageIsLeftOutAndSaid) {
    const Recorded recorded = record(file(), 40, 11, denseKeyframes());
    std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    bytes[records[records.size() / 2].first + 70] ^= 1;
    writeAll(file(), bytes);
    const auto report = compactLog(file(), file("b.rlog"));
    ASSERT_TRUE(report) << report.error().text;
    EXPECT_EQ(report->damaged, 1u);
    const Replayed before = replay(file(), recorded), after = replay(file("b.rlog"), recorded);
    EXPECT_EQ(after.damage, 0u);
    EXPECT_EQ(after.states, before.states);
}

TEST_F(Compaction, ProgressGrowsAndEndsItWithoutAFile) {
    record(file(), 400, 13);
    CompactOptions options;
    std::uint64_t last = 0, calls = 0;
    options.progress = [&](std::uint64_t done, std::uint64_t total) {
        EXPECT_GE(done, last);
        EXPECT_LE(done, total);
        EXPECT_EQ(total, std::filesystem::file_size(file()));
        last = done;
        return ++calls < 1'000'000;
    };
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    EXPECT_GT(calls, 0U);
    options.progress = [](std::uint64_t, std::uint64_t) { return false; };
    EXPECT_FALSE(compactLog(file(), file("c.rlog"), options));
    std::size_t files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++files;
    EXPECT_EQ(files, 2U) << "the two logs, and nothing half";
}

TEST_F(Compaction, FilesThatCannotBeAreErrorsAndNothingIsLost) {
    const Recorded recorded = record(file(), 5, 12);
    EXPECT_FALSE(compactLog(file(), file()));
    EXPECT_FALSE(compactLog(file("none.rlog"), file("b.rlog")));
    EXPECT_FALSE(compactLog(file(), folder / "gone" / "b.rlog"));
    EXPECT_FALSE(std::filesystem::exists(file("b.rlog")));
    EXPECT_FALSE(std::filesystem::exists(file("b.rlog.new")));
    EXPECT_EQ(replay(file(), recorded).states.size(), recorded.dumps.size());
}

TEST_F(Compaction, WhatTheOldLogLacksIsNamed) {
    record(file(), 60, 11, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    const auto frame = std::ranges::find_if(records.begin() + 20, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    writeAll(file("gap.rlog"), bytes.substr(0, frame->first) + bytes.substr(frame->first + frame->second.size()));
    const auto whole = compactLog(file(), file("b.rlog"));
    ASSERT_TRUE(whole);
    EXPECT_EQ(whole->lacks, "");
    EXPECT_EQ(whole->gaps, 0u);
    const auto partial = compactLog(file("gap.rlog"), file("c.rlog"));
    ASSERT_TRUE(partial) << partial.error().text;
    EXPECT_EQ(partial->gaps, 1u);
    EXPECT_TRUE(partial->lacks.contains("are missing")) << partial->lacks;
    // Before the part that is kept it does not matter.
    CompactOptions later;
    later.from = 5;
    const auto part = compactLog(file("gap.rlog"), file("d.rlog"), later);
    ASSERT_TRUE(part) << part.error().text;
    EXPECT_EQ(part->lacks, "");
}

/// A log whose beginning is gone, and one whose first bytes are: said, whatever is still to be had.
TEST_F(Compaction, ABeginningThatIsMissingIsNamed) {
    record(file(), 60, 11, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    const auto frame = std::ranges::find_if(records.begin() + 4, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    writeAll(file("late.rlog"), bytes.substr(frame->first));
    const auto late = compactLog(file("late.rlog"), file("b.rlog"));
    ASSERT_TRUE(late) << late.error().text;
    EXPECT_EQ(late->gaps, 1u);
    EXPECT_TRUE(late->lacks.contains("are missing")) << late->lacks;
    writeAll(file("head.rlog"), "X" + bytes.substr(1));
    const auto head = compactLog(file("head.rlog"), file("c.rlog"));
    ASSERT_TRUE(head) << head.error().text;
    EXPECT_EQ(head->damaged, 1u);
    EXPECT_TRUE(head->lacks.contains("damaged")) << head->lacks;
    // Of a part behind that nothing is missing.
    CompactOptions part;
    part.from = 5;
    EXPECT_EQ(compactLog(file("late.rlog"), file("d.rlog"), part)->lacks, "");
}

/// What comes after the part that is kept does not matter; nobody knows what came after a log that was not closed.
TEST_F(Compaction, AnEndThatIsOpenIsNamed) {
    record(file(), 60, 11);
    const auto records = recordsOf(file());
    writeAll(file("open.rlog"), readAll(file()).substr(0, records.back().first));
    const auto whole = compactLog(file("open.rlog"), file("b.rlog"));
    ASSERT_TRUE(whole) << whole.error().text;
    EXPECT_TRUE(whole->lacks.contains("was not closed")) << whole->lacks;
    CompactOptions before;
    before.to = 3;
    const auto part = compactLog(file("open.rlog"), file("c.rlog"), before);
    ASSERT_TRUE(part) << part.error().text;
    EXPECT_EQ(part->lacks, "");
}

}  // namespace
}  // namespace rtsg
