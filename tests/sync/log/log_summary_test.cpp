// What a log says about itself, whole and damaged.
#include <rtsg/sync/log_summary.h>

#include <gtest/gtest.h>

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

/// As a replay of it counts them.
TEST_F(Summary, FramesThatAreMissingAreCounted) {
    record(file(), 60, 8, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    EXPECT_EQ(summariseLog(file())->gaps, 0u);
    std::size_t gaps = 0;
    const auto expectAsReplayed = [&](const std::string& log, std::size_t which) {
        writeAll(file("b.rlog"), log);
        const auto summary = summariseLog(file("b.rlog"));
        auto replayer = Replayer::open(file("b.rlog"));
        ASSERT_EQ(summary.has_value(), replayer.has_value());
        if (!summary) return;  // no head is left
        while ((*replayer)->step().value_or(true)) continue;
        EXPECT_EQ(summary->gaps, (*replayer)->gaps()) << "record " << which;
        EXPECT_EQ(summary->missingFrames > 0, summary->gaps > 0) << "record " << which;
        EXPECT_EQ(summary->framesBehind, (*replayer)->framesBehind()) << "record " << which;
        gaps += summary->gaps;
    };
    for (std::size_t i = 0; i + 1 < records.size(); ++i) {
        const auto [at, header] = records[i];
        const std::string rest = bytes.substr(at + header.size());
        expectAsReplayed(bytes.substr(0, at) + rest, i);                                                // without it
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
