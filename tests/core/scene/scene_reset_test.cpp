// A scene that starts over, and what its subscribers then see.
#include <gtest/gtest.h>

#include <rtsg/core/scene.h>

#include "support/random_edits.h"

namespace rtsg {
namespace {

struct Seen : Subscriber {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> sets;
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        sets.emplace_back(changes.from, changes.to);
        return {};
    }
};

TEST(SceneReset, StartsOverAndTellsSubscribersWithASnapshot) {
    Scene origin, replica;
    replica.setBehavioursEnabled(false);
    test::RandomEdits edits(origin, 5);
    for (int i = 0; i < 40; ++i) edits.step();
    origin.newFrame(1);
    Seen immediate, polled;
    Attachment a = replica.bus().attach(immediate), b = replica.bus().attach(polled, Delivery::polled);
    b.poll();
    const auto snapshot = std::make_shared<const ChangeSet>(origin.snapshot());
    ASSERT_TRUE(replica.apply(snapshot));
    b.poll();
    EXPECT_FALSE(replica.apply(snapshot)) << "not onto a scene that has a state";
    ASSERT_TRUE(replica.reset());
    EXPECT_EQ(replica.sequence(), 0u);
    EXPECT_EQ(replica.nodeCount(), Scene().nodeCount());
    EXPECT_EQ(replica.hash(), Scene().hash());
    // The same numbers again: they must not pass for something already seen.
    ASSERT_TRUE(replica.apply(snapshot));
    b.poll();
    EXPECT_EQ(replica.hash(), origin.hash());
    EXPECT_EQ(replica.dump(), origin.dump());
    using Sets = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
    EXPECT_EQ(immediate.sets, (Sets{{0, 0}, {0, 1}, {0, 1}}));
    EXPECT_EQ(polled.sets, (Sets{{0, 0}, {0, 1}, {0, 1}}));
}

}  // namespace
}  // namespace rtsg
