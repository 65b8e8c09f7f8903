// Lossy streams: the bound holds for ever, nothing drifts, what rests is exact, and everybody agrees on the hash.
#include <rtsg/core/change_composer.h>
#include <rtsg/sync/lossy_scene.h>

#include <cmath>

#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>

#include "bench/motion_sync.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using bench::Motion;
using bench::Movement;

glm::dquat asQuat(const Rotation& r) {
    const double length = std::sqrt(double(r.x) * r.x + double(r.y) * r.y + double(r.z) * r.z),
                 s = std::sin(r.angle / 2.);
    return {std::cos(r.angle / 2.), r.x / length * s, r.y / length * s, r.z / length * s};
}
double angleBetween(const Rotation& a, const Rotation& b) {
    const glm::dquat d = glm::conjugate(asQuat(a)) * asQuat(b);
    return 2 * std::atan2(std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z), std::abs(d.w));
}

/// Follows a scene by way of records; now and then several frames come merged into one.
class Follower : public Subscriber {
  public:
    Follower(const StreamMode& mode, bool merging) : encoder_(mode), merged_(mode), merging_(merging) {
        replica.setBehavioursEnabled(false);
    }
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        encoder_.encode(changes, record_);
        bytes += record_.size();
        const std::uint8_t flags = parseRecordHeader(record_.bytes())->flags;
        if (!merging_ || changes.isSnapshot()) return take(record_);
        // Held back from one frame with kSync to another, then sent as one; the next lot is sent one by one.
        if (flags & kSync) {
            if (!held_.empty()) {
                ByteBuffer one;
                merged_.encodeMerged(compose(held_), one);
                if (auto ok = take(one); !ok) return ok;
                held_.clear();
                ++merges;
                holding_ = false;
            } else {
                holding_ = true;
            }
        }
        if (!holding_) return take(record_);
        held_.push_back(std::make_shared<ChangeSet>(changes));
        return {};
    }
    std::uint64_t bytes = 0, merges = 0, states = 0;
    Scene replica;

  private:
    Result<> take(const ByteBuffer& record) {
        const auto set = std::make_shared<ChangeSet>();
        if (auto ok = decoder_.decode(record.bytes(), *set); !ok) return ok;
        if (auto ok = replica.apply(set); !ok) return ok;
        ++states;
        return replica.hash() == set->hash ? Result<>{} : fail("other hash");
    }
    ChangeEncoder encoder_, merged_;
    ChangeDecoder decoder_{builtinTypes()};
    ByteBuffer record_;
    std::vector<std::shared_ptr<const ChangeSet>> held_;
    bool merging_, holding_ = false;
};

class Lossy : public testing::TestWithParam<Movement> {};
INSTANTIATE_TEST_SUITE_P(Movements, Lossy, testing::Values(Movement::smooth, Movement::chaotic, Movement::mixed),
                         [](const auto& p) { return std::string(bench::kMovementNames[std::size_t(p.param)]); });

TEST_P(Lossy, TheBoundHoldsForTenThousandFramesAndRestIsExact) {
    constexpr double kError = 1e-3;
    constexpr std::size_t kBodies = 12;
    constexpr int kFrames = 10000;
    const std::uint64_t seed = 20090616;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Scene origin;
    std::vector<NodeId> nodes;
    for (std::size_t i = 0; i < kBodies; ++i) {
        nodes.push_back(origin.createNode(x3d::Transform::type));
        ASSERT_TRUE(origin.setName(nodes.back(), "B" + std::to_string(i)));
    }
    origin.newFrame(0);
    auto lossy = LossyScene::follow(origin, kError);
    ASSERT_TRUE(lossy);
    const StreamMode mode{Mode::lossy, Coding::smallest, kError};
    Follower every(mode, false), merging(mode, true);
    Attachment a = (*lossy)->scene().bus().attach(every), b = (*lossy)->scene().bus().attach(merging);
    Motion motion(GetParam(), kBodies, seed);
    std::vector<int> moved(kBodies * 2, -10);
    double worst = 0, worstRotation = 0;
    std::size_t resting = 0;
    const auto compare = [&](int frame) {
        for (std::size_t i = 0; i < kBodies; ++i) {
            const Node &there = origin.node(nodes[i]), &here = every.replica.node(nodes[i]);
            const Vec3f p = there.get(x3d::Transform::translation), q = here.get(x3d::Transform::translation);
            const Rotation r = there.get(x3d::Transform::rotation), s = here.get(x3d::Transform::rotation);
            worst = std::max(worst, glm::length(glm::dvec3(p) - glm::dvec3(q)));
            worstRotation = std::max(worstRotation, angleBetween(r, s));
            if (frame - moved[2 * i] >= 2) {
                EXPECT_EQ(p, q) << "body " << i << " frame " << frame;
                ++resting;
            }
            if (frame - moved[2 * i + 1] >= 2) {
                EXPECT_EQ(r, s) << "body " << i << " frame " << frame;
            }
        }
    };
    int frame = 1;
    for (; frame <= kFrames; ++frame) {
        for (const Change& change : motion.next().changes) {
            const std::size_t body = (change.node.value - Motion::kFirstNode) / 3;
            ASSERT_TRUE(origin.setField(nodes[body], change.field, change.value));
            moved[2 * body + (change.value.holds<Rotation>() ? 1 : 0)] = frame;
        }
        origin.newFrame(frame / 60.);
        ASSERT_EQ(a.failure(), "");
        ASSERT_EQ(b.failure(), "");
        ASSERT_EQ(every.replica.sequence(), origin.sequence());
        compare(frame);
        if (HasFailure()) return;
    }
    EXPECT_LE(worst, kError);
    EXPECT_LE(worstRotation, kError);
    EXPECT_GT(worst, kError / 2) << "the bound is used";
    EXPECT_GT(merging.merges, 10u);
    EXPECT_NE(every.replica.hash(), origin.hash()) << "in motion";
    EXPECT_EQ(every.replica.hash(), (*lossy)->scene().hash());
    for (int i = 0; i < 2; ++i) origin.newFrame(++frame / 60.);
    EXPECT_EQ(every.replica.hash(), origin.hash()) << "at rest";
    EXPECT_EQ((*lossy)->scene().dump(), origin.dump());
    if (GetParam() == Movement::mixed) {
        EXPECT_GT(resting, 1000u);
    }
    EXPECT_GT((*lossy)->statistics().onGrid, std::uint64_t(kFrames));
    EXPECT_GT((*lossy)->statistics().settled, 0u);
}

TEST(LossyScene, FollowsEditsOfEveryKindAndIsExactInTheEnd) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene origin;
        auto lossy = LossyScene::follow(origin, .01);
        ASSERT_TRUE(lossy);
        Follower follower({Mode::lossy, Coding::compact, .01}, false);
        Attachment attachment = (*lossy)->scene().bus().attach(follower);
        test::RandomEdits edits(origin, seed);
        double t = 0;
        for (int frame = 0; frame < 150; ++frame) {
            for (int i = 0; i < 8; ++i) edits.step();
            origin.newFrame(t += .1);
            ASSERT_EQ(attachment.failure(), "") << frame;
        }
        origin.setBehavioursEnabled(false);  // clocks stop
        for (int i = 0; i < 3; ++i) origin.newFrame(t += .1);
        EXPECT_EQ(follower.replica.hash(), origin.hash());
        EXPECT_TRUE(follower.replica.dump() == origin.dump());
    }
}

TEST(LossyScene, RefusesABoundThatIsNone) {
    Scene origin;
    for (const double error : {0., -1., std::nan(""), double(INFINITY)})
        EXPECT_FALSE(LossyScene::follow(origin, error));
}

TEST(LossyScene, LeavesAloneWhatHasNoPlaceOnTheGrid) {
    Scene origin;
    const NodeId node = origin.createNode(x3d::Transform::type);
    ASSERT_TRUE(origin.setName(node, "N"));
    auto lossy = LossyScene::follow(origin, 1e-4);
    const float inf = INFINITY;
    const Vec3f far[] = {{1e9f, 0, 0}, {NAN, 1, 1}, {inf, -inf, 3}, {-0.f, 2e6f, 0}};
    const Rotation odd[] = {{0, 0, 0, 1.25f}, {2, 0, 0, 1.25f}, {NAN, 0, 0, 1}, {0, 1, 0, 1e30f}};
    for (int frame = 0; frame < 20; ++frame) {
        ASSERT_TRUE(origin.set(node, x3d::Transform::translation, far[frame % 4]));
        ASSERT_TRUE(origin.set(node, x3d::Transform::rotation, odd[frame % 4]));
        origin.newFrame(frame);
        const Node &there = origin.node(node), &here = (*lossy)->scene().node(node);
        EXPECT_TRUE(there.value(x3d::Transform::translation.index) == here.value(x3d::Transform::translation.index))
            << frame;
        const Rotation r = there.get(x3d::Transform::rotation), s = here.get(x3d::Transform::rotation);
        if (frame % 4 != 1) {
            EXPECT_EQ(std::memcmp(&r, &s, sizeof(r)), 0) << frame;
        } else {
            EXPECT_LE(angleBetween(r, s), 1e-4);
        }
    }
}

}  // namespace
}  // namespace rtsg
