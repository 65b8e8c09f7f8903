// The lists of routes at a node's ends, against plain vectors.
#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "state/state.h"

namespace rtsg {
namespace {

TEST(FewRoutes, HoldWhatAListHolds) {
    constexpr unsigned kSeed = 5;
    SCOPED_TRACE(kSeed);
    std::mt19937 random(kSeed);
    std::size_t maximum = 0;
    for (int round = 0; round < 200; ++round) {
        FewRoutes<OutgoingRoute> routes;
        std::vector<OutgoingRoute> expected;
        const std::uint32_t kinds = round % 2 ? 3 : 60;
        for (int step = 0; step < 200; ++step) {
            const OutgoingRoute one{{NodeId{1 + std::uint32_t(random()) % kinds}, FieldIndex(random() % 2), false}};
            const auto known = std::ranges::find(expected, one);
            ASSERT_EQ(routes.contains(one), known != expected.end());
            if (random() % 5 < (round % 3 == 0 ? 2u : 3u)) {
                if (known != expected.end()) continue;
                routes.add(one);
                expected.push_back(one);
            } else {
                ASSERT_EQ(routes.remove(one), known != expected.end());
                if (known != expected.end()) expected.erase(known);
            }
            ASSERT_EQ(routes.empty(), expected.empty());
            std::vector<OutgoingRoute> held;
            for (const OutgoingRoute& r : routes.items())
                if (r.to.node) held.push_back(r);
            ASSERT_EQ(held, expected) << round << ' ' << step;
            maximum = std::max(maximum, expected.size());
        }
    }
    EXPECT_GT(maximum, 32u) << "beyond a few, places are hashed";
}

TEST(RouteGroups, StayInTheOrderInWhichTheyCame) {
    constexpr unsigned kSeed = 6;
    SCOPED_TRACE(kSeed);
    std::mt19937 random(kSeed);
    for (int round = 0; round < 200; ++round) {
        RouteGroups groups;
        std::vector<std::pair<FieldIndex, std::uint64_t>> expected;
        FieldIndex field = 0;
        for (int step = 0; step < 40; ++step) {
            if (expected.empty() || random() % 5 < 3) {
                RouteGroup& group = groups.add(++field);
                ASSERT_TRUE(group.targets.empty());
                ASSERT_EQ(group.stamp + group.gone + group.listeners, 0u);
                group.stamp = random();
                group.targets.add({{NodeId{std::uint32_t(field)}, field, false}});
                expected.emplace_back(field, group.stamp);
            } else {
                const std::size_t at = random() % expected.size();
                groups.erase(groups.begin() + at);
                expected.erase(expected.begin() + std::ptrdiff_t(at));
            }
            ASSERT_EQ(groups.empty(), expected.empty());
            ASSERT_EQ(std::size_t(groups.end() - groups.begin()), expected.size());
            std::size_t i = 0;
            for (const RouteGroup& group : groups) {
                ASSERT_EQ(group.field, expected[i].first);
                ASSERT_EQ(group.stamp, expected[i].second);
                ASSERT_TRUE(group.targets.contains({{NodeId{std::uint32_t(group.field)}, group.field, false}}));
                ++i;
            }
        }
    }
}

}  // namespace
}  // namespace rtsg
