// Work in the background when everything that it concerns is removed.
#include <gtest/gtest.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

TEST(WorldRest, WhatIsMergedWhileItGoesLeavesNothingBehind) {
    for (const bool background : {true, false}) {
        RayWorld world({.restFrames = 4, .background = background});
        for (std::uint32_t round = 0; round < 30; ++round) {
            InstanceDelta delta;
            for (std::uint32_t i = 0; i < 20; ++i) {
                delta.geometries.push_back({NodeId{i + 1}, makeSphere(2)});
                delta.added.push_back(makeInstance(i, NodeId{i + 1}, translation({3.0 * i, 0, 0}), round));
            }
            // One by one, or they would be merged at once.
            for (std::uint32_t i = 0; i < 20; ++i) {
                InstanceDelta one;
                one.geometries = {delta.geometries[i]};
                one.added = {delta.added[i]};
                world.apply(one);
            }
            for (std::uint32_t i = 0; i < 4 + round % 16; ++i) world.apply({});
            InstanceDelta gone;
            for (std::uint32_t i = 0; i < 20; ++i) {
                gone.removed.push_back({i, round});
                gone.geometriesRemoved.push_back(NodeId{i + 1});
            }
            world.apply(gone);
            EXPECT_FALSE(world.intersect({{0, 0, 9}, 0, {0, 0, -1}}));
            world.finishBackgroundWork();
            EXPECT_EQ(world.stats().groups, 0u) << round;
            EXPECT_FALSE(world.intersect({{0, 0, 9}, 0, {0, 0, -1}}));
            EXPECT_TRUE(world.bounds().empty());
        }
        EXPECT_GT(world.stats().merges, 0u);
    }
}

}  // namespace
}  // namespace rtsg
