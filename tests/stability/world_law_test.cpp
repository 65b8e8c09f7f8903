// The law of derived structures for RayWorld's speed-up graph: whatever was moved, grouped, split and merged in the
// background before, the hits are those of the instances as they are now, found without any tree.
#include <gtest/gtest.h>

#include "renderers/world_players.h"

namespace rtsg {
namespace {

using namespace test;

constexpr std::uint32_t kLawSeed = 20260301;

TEST(WorldLaw, HitsDoNotDependOnWhatWasMergedAndSplitBefore) {
    RayWorld::Stats maximum;
    for (std::uint32_t run = 0; run < 6; ++run) {
        SCOPED_TRACE(testing::Message() << "seed " << kLawSeed + run);
        Players players(kLawSeed + run, {.restFrames = 1 + run, .background = run % 2 == 0});
        for (int step = 0; step < 150; ++step) {
            SCOPED_TRACE(testing::Message() << "step " << step);
            players.step();
            // Some lie tens of metres out, seen along grazing rays.
            players.compare(3);
            if (testing::Test::HasFailure()) return;
        }
        const RayWorld::Stats stats = players.world().stats();
        maximum.merges += stats.merges, maximum.splits += stats.splits, maximum.bodiesBuilt += stats.bodiesBuilt;
    }
    // Or nothing was tested.
    EXPECT_GT(maximum.merges, 20u);
    EXPECT_GT(maximum.splits, 50u);
    EXPECT_GT(maximum.bodiesBuilt, 50u);
}

}  // namespace
}  // namespace rtsg
