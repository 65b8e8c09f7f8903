// The world between two of its states, against one without any tree whose things were put there in closed form.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "renderers/ray_support.h"
#include "world/moved_view.h"

namespace rtsg {
namespace {

using namespace test;

/// Rodrigues' formula: about a unit axis.
glm::dmat3 rotationAbout(const Vec3d& axis, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    glm::dmat3 m;
    for (int i = 0; i < 3; ++i) {
        Vec3d e(0);
        e[i] = 1;
        m[i] = e * c + glm::cross(axis, e) * s + axis * (axis[i] * (1 - c));
    }
    return m;
}

/// A rigid motion of the world about `pivot`, which moves by `way`.
struct RigidCourse {
    Vec3d axis{0, 0, 1}, pivot{0}, displacement{0};
    double angle = 0;
    WorldFromLocal at(double t, const WorldFromLocal& from) const {
        const glm::dmat3 rotation = rotationAbout(axis, t * angle);
        return {rotation * from[0], rotation * from[1], rotation * from[2],
                pivot + t * displacement + rotation * (from[3] - pivot)};
    }
};

WorldFromLocal inverseOf(const WorldFromLocal& m) {
    const glm::dmat3 back = glm::inverse(glm::dmat3(m[0], m[1], m[2]));
    return {back[0], back[1], back[2], -(back * m[3])};
}

class MovedWorld : public testing::TestWithParam<int> {};

// Things alone, things in bodies, and things that rest, mirrored and stretched ones among them. Groups go rigidly about
// pivots of their own; at any time rays meet what they would meet in a world that was built then.
TEST_P(MovedWorld, AnswersAsOneBuiltThen) {
    std::mt19937 random(static_cast<unsigned>(GetParam()));
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(-1, 1);
    constexpr std::uint32_t kGroups = 4, kEach = 6, kSlots = 40;
    RayWorld world;
    InstanceDelta delta;
    BruteForce truth;
    for (std::uint32_t node = 1; node <= kSlots; ++node)
        delta.geometries.push_back({NodeId{node}, node % 3 ? makeSoup(random, 12) : makeSphere(2)});
    std::array<RigidCourse, kGroups> courses;
    for (RigidCourse& c : courses) {
        c.axis = glm::normalize(Vec3d(normal(random), normal(random), normal(random)));
        c.angle = 2.5 * unit(random);
        c.pivot = 6.0 * Vec3d(unit(random), unit(random), unit(random));
        c.displacement = 3.0 * Vec3d(unit(random), unit(random), unit(random));
    }
    for (std::uint32_t slot = 0; slot < kSlots; ++slot) {
        Instance i = makeInstance(slot, NodeId{slot + 1}, randomTransform(random, 8));
        if (const std::uint32_t group = slot / kEach; group < kGroups) {
            i.motion = Motion::moving;
            i.rigid = group < 2 ? group + 1 : 0;  // two bodies, and two groups of things by themselves
            i.pivot = Vec3f(inverseOf(i.worldFromLocal) * Vec4d(courses[group].pivot, 1));
        }
        delta.added.push_back(i);
        truth.items[slot] = {i, delta.geometries[slot].mesh};
    }
    world.apply(delta);
    EXPECT_EQ(world.stats().bodies, 2u);
    const auto before = world.freeze();
    InstanceDelta moved;
    for (std::uint32_t slot = 0; slot < kGroups * kEach; ++slot)
        moved.moved.push_back({{slot, 0}, courses[slot / kEach].at(1, truth.items[slot].info.worldFromLocal)});
    world.apply(moved);
    const Motions motions(*before, world);
    for (std::uint32_t slot = 0; slot < kSlots; ++slot) EXPECT_EQ(motions.moves(slot), slot < kGroups * kEach) << slot;
    const BruteForce first = truth;
    for (const double t : {0.0, .3, .5, .85, 1.0}) {
        SCOPED_TRACE(t);
        for (std::uint32_t slot = 0; slot < kGroups * kEach; ++slot)
            truth.items[slot].info.worldFromLocal =
                courses[slot / kEach].at(t, first.items.at(slot).info.worldFromLocal);
        const MovedView then(world, motions, t);
        expectSameHits(then, truth, random, 60, 12, 1e-4);
        for (std::uint32_t slot = 0; slot < kSlots; ++slot) {
            const WorldFromLocal &is = then.instance(slot).info.worldFromLocal,
                                 &expected = truth.items[slot].info.worldFromLocal;
            for (int c = 0; c < 4; ++c) EXPECT_NEAR(glm::length(is[c] - expected[c]), 0, 1e-5) << slot;
        }
    }
    // The state itself is as it was.
    expectSameHits(world, truth, random, 20, 12, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Seeds, MovedWorld, testing::Values(1, 2, 3, 4));

// Resting things need no look, and things that are new, or have become others, have no motion.
TEST(Motions, AreOfWhatWasThereAndIsElsewhere) {
    RayWorld world;
    InstanceDelta delta;
    delta.geometries = {{NodeId{1}, makeSphere(1)}, {NodeId{2}, makeBox()}};
    for (std::uint32_t slot = 0; slot < 3; ++slot)
        delta.added.push_back(makeInstance(slot, NodeId{slot % 2 + 1}, translation({4.0 * slot, 0, 0})));
    world.apply(delta);
    const auto before = world.freeze();
    EXPECT_TRUE(Motions(*before, world).empty());
    InstanceDelta next;
    next.removed = {{1, 0}};
    next.added = {makeInstance(3, NodeId{1}, translation({0, 9, 0}))};
    next.moved = {{{2, 0}, translation({8, 2, 0})}};
    world.apply(next);
    InstanceDelta again;
    again.added = {makeInstance(1, NodeId{1}, translation({4, 3, 0}), 1)};  // another tenant of the slot
    world.apply(again);
    const Motions motions(*before, world);
    EXPECT_FALSE(motions.empty());
    for (std::uint32_t slot = 0; slot < 4; ++slot) EXPECT_EQ(motions.moves(slot), slot == 2) << slot;
    const MovedView half(world, motions, .5);
    EXPECT_NEAR(half.instance(2).info.worldFromLocal[3].y, 1, 1e-12);
    EXPECT_NEAR(half.intersect({{8, 1, 5}, 0, {0, 0, -1}}).t, 4, 1e-5);
    EXPECT_FALSE(half.intersect({{8, 2.5f, 5}, 0, {0, 0, -1}}));
    EXPECT_TRUE(world.intersect({{8, 2.5f, 5}, 0, {0, 0, -1}}));
}

// Turned inside out on its way a thing is flat for an instant, and never at a place where it cannot be.
TEST(Motions, MirroredOnTheWay) {
    const Course course(translation({1, 0, 0}), compose(translation({3, 0, 0}), scaling({-1, 1, 1})), Vec3d(0));
    EXPECT_NEAR(course.at(.5)[3].x, 2, 1e-12);
    EXPECT_NEAR(course.at(.5)[0].x, 0, 1e-12);
    EXPECT_NEAR(course.at(.25)[0].x, .5, 1e-12);
    const Course grows(identityTransform(), scaling({3, 1, 2}), Vec3d(1, 0, 0));
    EXPECT_NEAR(grows.at(.5)[0].x, 2, 1e-12);
    EXPECT_NEAR(grows.at(.5)[2].z, 1.5, 1e-12);
    EXPECT_NEAR(grows.at(.5)[3].x, 0, 1e-12) << "from 1 to 3: at 2 in the middle";
}

}  // namespace
}  // namespace rtsg
