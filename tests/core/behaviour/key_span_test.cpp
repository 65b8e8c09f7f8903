// Where a fraction lies among keys: as std::upper_bound finds it, in order or not, with keys that come twice.
#include "animation/key_span.h"

#include <algorithm>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace rtsg::behaviours {
namespace {

TEST(KeySpan, IsWhereUpperBoundFindsIt) {
    std::mt19937 draw(7);
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    for (int round = 0; round < 20'000; ++round) {
        auto keys = Array<float>::ofSize(1 + draw() % 20);
        float* const at = keys.mutableData();
        for (std::size_t i = 0; i < keys.size(); ++i) at[i] = static_cast<float>(draw() % 16) / 8;
        if (draw() % 4 != 0) std::sort(at, at + keys.size());
        const std::size_t count = 1 + draw() % keys.size();
        float fraction = static_cast<float>(draw() % 40) / 16 - .25f;
        if (draw() % 50 == 0) fraction = draw() % 2 ? kInfinity : -kInfinity;
        const Span span = locate(keys, count, fraction);
        const auto after =
            static_cast<std::size_t>(std::upper_bound(keys.data(), keys.data() + count, fraction) - keys.data());
        if (after == 0 || after == count) {
            ASSERT_EQ(span.from, after == 0 ? 0 : count - 1) << "round " << round;
            ASSERT_EQ(span.to, span.from);
            ASSERT_EQ(span.weight, 0);
            continue;
        }
        ASSERT_EQ(span.from, after - 1) << "round " << round;
        ASSERT_EQ(span.to, after);
        const float width = keys[after] - keys[after - 1];
        ASSERT_EQ(span.weight, width > 0 ? (fraction - keys[after - 1]) / width : 0);
    }
}

TEST(KeySpan, IsANumberWhereverKeysAre) {
    constexpr float kMax = std::numeric_limits<float>::max(), kInfinity = std::numeric_limits<float>::infinity();
    EXPECT_EQ(locate({-kMax, kMax}, 2, kMax / 2).weight, .75f);
    EXPECT_EQ(locate({-kMax, kMax}, 2, -kMax).weight, 0);
    EXPECT_EQ(locate({0, kMax}, 2, kMax / 4).weight, .25f);
    EXPECT_EQ(locate({0, kInfinity}, 2, 1).weight, 0);
    EXPECT_EQ(locate({-kInfinity, 0}, 2, -1).weight, 0);
    EXPECT_EQ(locate({-kInfinity, kInfinity}, 2, 0).weight, 0);
}

}  // namespace
}  // namespace rtsg::behaviours
