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

struct Waiter : Subscriber {
    const Scene& scene;
    Attachment* other = nullptr;
    Seen* seen = nullptr;
    std::vector<std::uint64_t> states;
    bool throws = false;
    explicit Waiter(const Scene& s) : scene(s) {}
    Result<> apply(const Scene&, const ChangeSet&) override { return {}; }
    void beforeRestart() override {
        states.push_back(scene.sequence());
        if (other) other->drain();
        if (throws) throw std::runtime_error("has had enough");
    }
    std::string subscriberName() const override { return "waiter"; }
};

TEST(SceneReset, TellsBeforeSoThatWhatPolledOnesLackCanBeTaken) {
    Scene scene;
    test::RandomEdits edits(scene, 6);
    Seen polled, late;
    Attachment b = scene.bus().attach(polled, Delivery::polled), c = scene.bus().attach(late, Delivery::polled);
    Waiter waiter(scene);
    waiter.other = &b;
    const Attachment a = scene.bus().attach(waiter);
    for (int frame = 0; frame < 3; ++frame) {
        edits.step();
        scene.newFrame(frame);
    }
    ASSERT_TRUE(scene.reset());
    EXPECT_EQ(waiter.states, std::vector<std::uint64_t>{3}) << "once, and the scene as it was";
    using Sets = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
    EXPECT_EQ(polled.sets, (Sets{{0, 0}, {0, 1}, {1, 2}, {2, 3}}));
    EXPECT_EQ(c.drain(), 0u) << "dropped";
    EXPECT_EQ(late.sets, Sets{});
}

TEST(SceneReset, TellsNobodyWhoIsGoneAndDetachesWhoThrows) {
    Scene scene;
    std::string reported;
    scene.bus().setReporter([&](const Diagnostic& d) { reported += d.text; });
    Waiter gone(scene), thrower(scene), next(scene);
    thrower.throws = true;
    Attachment g = scene.bus().attach(gone), t = scene.bus().attach(thrower), n = scene.bus().attach(next);
    g.detach();
    scene.newFrame(1);
    ASSERT_TRUE(scene.reset());
    EXPECT_TRUE(gone.states.empty());
    EXPECT_FALSE(t.attached());
    EXPECT_EQ(t.failure(), "has had enough");
    EXPECT_NE(reported.find("has had enough"), std::string::npos) << reported;
    EXPECT_TRUE(n.attached());
    EXPECT_EQ(next.states.size(), 1u);
    ASSERT_TRUE(scene.reset());
    EXPECT_EQ(thrower.states.size(), 1u) << "not again";
}

}  // namespace
}  // namespace rtsg
