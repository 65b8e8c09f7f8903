// Values, times and threads that methods trip over. Each test states its outcome.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "support/shared_set.h"

namespace rtsg {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

TEST(Values, NotANumberIsAValueLikeAnyOther) {
    // Outcome: stored and sent bit for bit; the hash is stable, differs between NaNs of different bits and between 0
    // and -0, and goes back to what it was with the value.
    Scene scene;
    const NodeId t = scene.createNode(x3d::Transform::type), c = scene.createNode(x3d::Coordinate::type);
    scene.newFrame(0);
    const Hash128 before = scene.hash();
    const auto hashWith = [&](Vec3f value, double time) {
        EXPECT_TRUE(scene.set(t, x3d::Transform::translation, value));
        return scene.newFrame(time)->hash;
    };
    const Hash128 nan = hashWith(Vec3f(kNaN), 1);
    EXPECT_NE(nan, before);
    EXPECT_EQ(hashWith(Vec3f(kNaN), 2), nan);
    EXPECT_NE(hashWith(Vec3f(std::bit_cast<float>(0x7FC00001u), kNaN, kNaN), 3), nan);
    const Hash128 inf = hashWith(Vec3f(kInf, -kInf, 1e-45f), 4);
    EXPECT_NE(inf, nan);
    EXPECT_EQ(hashWith(Vec3f(0), 5), before);  // the default has no term
    EXPECT_NE(hashWith(Vec3f(-0.f, 0, 0), 6), before);
    ASSERT_TRUE(scene.set(c, x3d::Coordinate::point, Array<Vec3f>{Vec3f(kNaN), Vec3f(kInf)}));
    const auto set = scene.newFrame(7);
    ASSERT_EQ(set->changes.size(), 1u);
    EXPECT_EQ(set->changes[0].value, Value(Array<Vec3f>{Vec3f(kNaN), Vec3f(kInf)}));
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_EQ(replica.hash(), scene.hash());
    EXPECT_EQ(replica.dump(), scene.dump());
}

TEST(Values, NotANumberThroughTheCascade) {
    // Outcome: interpolators and clocks fed with NaN and infinity neither hang nor stop others; a fraction that is not
    // a number changes nothing that is one.
    Scene scene;
    const NodeId path = scene.createNode(x3d::PositionInterpolator::type), t = scene.createNode(x3d::Transform::type);
    const NodeId clock = scene.createNode(x3d::TimeSensor::type);
    using P = x3d::PositionInterpolator;
    ASSERT_TRUE(scene.set(path, P::key, Array<float>{0, kNaN, 1}));
    ASSERT_TRUE(scene.set(path, P::keyValue, Array<Vec3f>{Vec3f(0), Vec3f(kInf), Vec3f(1)}));
    ASSERT_TRUE(scene.addRoute(path, P::value_changed.index, t, x3d::Transform::translation.index));
    ASSERT_TRUE(scene.set(clock, x3d::TimeSensor::loop, true));
    ASSERT_TRUE(scene.set(clock, x3d::TimeSensor::cycleInterval, Time{std::numeric_limits<double>::quiet_NaN()}));
    for (const float fraction : {kNaN, kInf, -kInf, .5f, 2.f}) {
        ASSERT_TRUE(scene.sendEvent(path, P::set_fraction.index, fraction));
        const auto set = scene.newFrame(scene.now() + .1);
        EXPECT_EQ(set->hash, scene.hash());
    }
    Scene replica;
    replica.setBehavioursEnabled(false);
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_EQ(replica.hash(), scene.hash());
}

TEST(Times, GoingBackwardsStandsStill) {
    // Outcome: the frame happens at the time reached before, with a warning; nothing runs backwards.
    Scene scene;
    const NodeId clock = scene.createNode(x3d::TimeSensor::type);
    ASSERT_TRUE(scene.set(clock, x3d::TimeSensor::loop, true));
    ASSERT_TRUE(scene.set(clock, x3d::TimeSensor::cycleInterval, Time{10}));
    scene.newFrame(0);
    scene.newFrame(5);
    const float fraction = scene.node(clock).get(x3d::TimeSensor::fraction_changed);
    const std::uint64_t sequence = scene.sequence();
    EXPECT_EQ(scene.newFrame(3)->time, 5);
    EXPECT_EQ(scene.now(), 5);
    EXPECT_EQ(scene.sequence(), sequence + 1);
    EXPECT_EQ(scene.node(clock).get(x3d::TimeSensor::fraction_changed), fraction);
    EXPECT_EQ(scene.diagnostics().warnings(), 1u);
    scene.newFrame(6);
    EXPECT_GT(scene.node(clock).get(x3d::TimeSensor::fraction_changed), fraction);
}

TEST(Times, StandingStillAndLeaping) {
    // Outcome: a thousand frames of one timestamp and a leap of 10^12 s are frames like others.
    Scene scene;
    const NodeId clock = scene.createNode(x3d::TimeSensor::type);
    ASSERT_TRUE(scene.set(clock, x3d::TimeSensor::loop, true));
    for (int i = 0; i < 1000; ++i) scene.newFrame(1);
    EXPECT_EQ(scene.now(), 1);
    scene.newFrame(1e12);
    const float fraction = scene.node(clock).get(x3d::TimeSensor::fraction_changed);
    EXPECT_GE(fraction, 0);
    EXPECT_LE(fraction, 1);
    EXPECT_TRUE(scene.node(clock).get(x3d::TimeSensor::isActive));
}

TEST(Values, AMillionWritesOfOneFieldAreOneChange) {
    // Outcome: coalesced to the last value, marked by its last cause; memory does not grow with the writes.
    Scene scene;
    const NodeId t = scene.createNode(x3d::Transform::type);
    scene.newFrame(0);
    for (int i = 0; i < 1'000'000; ++i)
        ASSERT_TRUE(scene.set(t, x3d::Transform::translation, Vec3f(static_cast<float>(i))));
    const auto set = scene.newFrame(1);
    ASSERT_EQ(set->changes.size(), 1u);
    EXPECT_EQ(set->changes[0].value, Value(Vec3f(999'999)));
    EXPECT_TRUE(set->changes[0].external);
}

TEST(Values, EveryFieldOfATypeInOneFrame) {
    // Outcome: fields beyond the 63rd are coalesced like the others (a Script may have thousands).
    auto type = std::make_shared<NodeType>();
    type->name = "Wide";
    type->kind = NodeType::Kind::user;
    constexpr FieldIndex kFields = 300;
    for (FieldIndex i = 0; i < kFields; ++i) {
        FieldDef& def = type->fields.emplace_back();
        def.name = "f" + std::to_string(1000 + i);
        def.type = i % 2 ? FieldType::SFFloat : FieldType::MFFloat;
    }
    ASSERT_TRUE(type->finish());
    Scene scene;
    const auto index = scene.defineType(type);
    ASSERT_TRUE(index);
    const NodeId node = scene.createNode(*index);
    scene.newFrame(0);
    for (int round = 0; round < 3; ++round) {
        for (int again = 0; again < 2; ++again)
            for (FieldIndex i = 0; i < kFields; ++i) {
                const float value = static_cast<float>(round * 1000 + again * 500 + i);
                ASSERT_TRUE(i % 2 ? scene.setField(node, i, value) : scene.setField(node, i, Array<float>{value}));
            }
        const auto set = scene.newFrame(round + 1);
        EXPECT_EQ(set->changes.size(), kFields + 0u);
        Scene replica;
        ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
        ASSERT_EQ(replica.hash(), set->hash);
    }
}

TEST(Threads, EditsFromOthersAreRefused) {
    // Outcome: every call from another thread is refused with a diagnostic and leaves the scene as it was; the owner's
    // own edits go on meanwhile. Clean under the thread sanitizer.
    Scene scene;
    const NodeId t = scene.createNode(x3d::Transform::type), g = scene.createNode(x3d::Group::type);
    scene.newFrame(0);
    std::atomic<int> refused{0}, accepted{0};
    std::vector<std::thread> others;
    constexpr int kThreads = 4, kRounds = 500;
    for (int i = 0; i < kThreads; ++i)
        others.emplace_back([&] {
            for (int k = 0; k < kRounds; ++k) {
                const auto count = [&](const auto& result) { ++(result ? accepted : refused); };
                count(scene.set(t, x3d::Transform::translation, Vec3f(9)));
                count(scene.setField(g, x3d::Group::children.index, Array<NodeId>{t}));
                count(scene.insertChild(g, x3d::Group::children, t));
                count(scene.removeChild(g, x3d::Group::children.index, 0));
                count(scene.setName(t, "stolen"));
                count(scene.destroyNode(t));
                count(scene.addRoute(t, x3d::Transform::translation.index, t, x3d::Transform::scale.index));
                count(scene.sendEvent(t, x3d::Transform::translation.index, Vec3f(9)));
                count(scene.createNode(x3d::Group::type) != NodeId{});
                const NodeId ids[] = {t};
                const Vec3f values[] = {Vec3f(9)};
                count(scene.setEach<Vec3f>(ids, x3d::Transform::translation, values));
                count(!scene.newFrame(1e9)->changes.empty());
            }
        });
    for (int k = 1; k <= kRounds; ++k) {
        ASSERT_TRUE(scene.set(t, x3d::Transform::scale, Vec3f(static_cast<float>(k))));
        scene.newFrame(k);
    }
    for (std::thread& thread : others) thread.join();
    EXPECT_EQ(accepted.load(), 0);
    EXPECT_EQ(refused.load(), kThreads * kRounds * 11);
    EXPECT_EQ(scene.node(t).get(x3d::Transform::translation), Vec3f(0));
    EXPECT_EQ(scene.nodeCount(), 3u);
    EXPECT_EQ(scene.now(), kRounds);
    EXPECT_TRUE(scene.name(t).empty());
    ASSERT_EQ(scene.diagnostics().errors() > 0, true);  // newFrame has no other way to say so
}

TEST(Threads, PollingWhileTheSceneRuns) {
    // Outcome: a subscriber on a thread of its own sees every state once, in order, and ends with the scene's hash.
    Scene scene;
    std::vector<NodeId> transforms;
    for (int i = 0; i < 200; ++i) transforms.push_back(scene.createNode(x3d::Transform::type));
    struct Replica final : Subscriber {
        std::unique_ptr<Scene> scene;
        std::uint64_t last = 0;
        bool ordered = true;
        Result<> apply(const Scene&, const ChangeSet& set) override {
            if (!scene) {
                scene = std::make_unique<Scene>();  // belongs to this thread
                scene->setBehavioursEnabled(false);
            }
            ordered = ordered && (set.isSnapshot() || set.from == last);
            last = set.to;
            return scene->apply(std::make_shared<const ChangeSet>(set));
        }
    } replica;
    Attachment attachment = scene.bus().attach(replica, Delivery::polled);
    std::atomic<bool> over{false};
    Hash128 reached;
    std::thread poller([&] {
        while (!over) attachment.poll();
        attachment.poll();
        reached = replica.scene->hash();
    });
    for (int frame = 0; frame < 2000; ++frame) {
        for (std::size_t i = 0; i < 20; ++i)
            ASSERT_TRUE(scene.set(transforms[(static_cast<std::size_t>(frame) * 7 + i) % transforms.size()],
                                  x3d::Transform::translation, Vec3f(static_cast<float>(frame))));
        scene.newFrame(frame);
    }
    over = true;
    poller.join();
    EXPECT_TRUE(replica.ordered);
    EXPECT_EQ(reached, scene.hash());
    EXPECT_EQ(attachment.sequence(), scene.sequence());
    EXPECT_EQ(attachment.failure(), "");
}

TEST(Writing, SetEachIsSetOneByOne) {
    // Outcome: the same state and set as one by one, whatever the types; ends at the first node that refuses.
    Scene one, each;
    std::vector<NodeId> ids;
    std::vector<Vec3f> values;
    for (int i = 0; i < 1000; ++i) {
        ids.push_back(one.createNode(x3d::Transform::type));
        ASSERT_EQ(each.createNode(x3d::Transform::type), ids.back());
        values.push_back(Vec3f(static_cast<float>(i * 7 % 13)));
    }
    ids[500] = ids[20];  // written twice: the last value counts
    for (std::size_t i = 0; i < ids.size(); ++i) ASSERT_TRUE(one.set(ids[i], x3d::Transform::translation, values[i]));
    ASSERT_TRUE(each.setEach<Vec3f>(ids, x3d::Transform::translation, values));
    EXPECT_EQ(one.newFrame(0)->changes, each.newFrame(0)->changes);
    EXPECT_EQ(one.hash(), each.hash());
    ids[900] = NodeId{123'456'789};
    const auto ok = each.setEach<Vec3f>(ids, x3d::Transform::translation, std::vector<Vec3f>(1000, Vec3f(5)));
    ASSERT_FALSE(ok);
    EXPECT_EQ(each.node(ids[899]).get(x3d::Transform::translation), Vec3f(5));
    EXPECT_NE(each.node(ids[901]).get(x3d::Transform::translation), Vec3f(5));
}

}  // namespace
}  // namespace rtsg
