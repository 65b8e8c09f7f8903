// Durations, dates and moments as people type them.
#include <chrono>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/session/moments.h>
#include <rtsg/session/notices.h>

namespace rtsg {
namespace {

TEST(Moments, DurationsHaveUnits) {
    for (const auto& [text, seconds] :
         {std::pair("2s", 2.0), std::pair("500ms", .5), std::pair("1.5", 1.5), std::pair("10min", 600.0),
          std::pair("1h", 3600.0), std::pair("1:30", 90.0), std::pair("1:02:03.5", 3723.5), std::pair("0", 0.0)})
        EXPECT_DOUBLE_EQ(secondsIn(text).value_or(-1), seconds) << text;
}

TEST(Moments, WhatIsNoneIsTheCallersError) {
    for (const char* text : {"", "2x", "-1", "1:60", "1:2:3:4", "nan", "2 s", "1e10"}) {
        const auto seconds = secondsIn(text);
        ASSERT_FALSE(seconds) << text;
        EXPECT_EQ(seconds.error().code, kUsageCode) << text;
        EXPECT_TRUE(seconds.error().text.starts_with(fmt::format("{}: ", text))) << seconds.error().text;
    }
    for (const char* text : {"2026-13-01", "2026-02-30", "1969-12-31", "2026-01-01T24:00", "2026-01-01T10:00:00X"})
        if (const auto date = dateIn(text); date || date.error().code != kUsageCode) ADD_FAILURE() << text;
}

TEST(Moments, DatesAreReadAsTheyArePrinted) {
    const unsigned seed = 7;
    std::mt19937_64 random(seed);
    std::uniform_int_distribution<std::int64_t> micros(0, 4'000'000'000'000'000);
    for (int i = 0; i < 200; ++i) {
        const double date = static_cast<double>(micros(random)) * 1e-6;
        const std::string text = dateText(date);
        EXPECT_NEAR(dateIn(text).value_or(-1), date, 2e-6) << text << ", seed " << seed;
    }
    using namespace std::chrono;
    const auto day = sys_days(2026y / November / 20).time_since_epoch();
    EXPECT_DOUBLE_EQ(*dateIn("2026-11-20T12:00:00Z"),
                     static_cast<double>(duration_cast<seconds>(day).count()) + 43'200);
    EXPECT_EQ(dateText(0), "1970-01-01T00:00:00Z");
    EXPECT_EQ(dateText(-1), "-1 s");
}

TEST(Moments, CountFromTheStart) {
    const double start = *dateIn("2026-11-20");
    EXPECT_DOUBLE_EQ(*momentIn("1:30", start), 90);
    EXPECT_DOUBLE_EQ(*momentIn("2026-11-20T00:01:00Z", start), 60);
    const auto before = momentIn("2026-11-19", start);
    ASSERT_FALSE(before);
    EXPECT_EQ(before.error().text, "2026-11-19: that is before the start, 2026-11-20T00:00:00Z");
}

}  // namespace
}  // namespace rtsg
