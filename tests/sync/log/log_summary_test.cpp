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

}  // namespace
}  // namespace rtsg
