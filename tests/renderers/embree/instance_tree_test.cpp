// The tree over instances against a loop over all of them.
#include "trees/instance_tree.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "renderers/ray_support.h"

namespace rtsg::bvh {
namespace {

constexpr std::uint32_t kTreeSeed = 20090616;
using Box = InstanceTree::Box;

/// In double precision; `slack` shrinks (negative) or grows the box.
bool meets(const Box& box, const Ray& ray, double slack) {
    double near = ray.tMin, far = ray.tMax;
    for (int k = 0; k < 3; ++k) {
        const double size = std::max({std::abs(box.lower[k]), std::abs(box.upper[k]), std::abs(ray.origin[k])}) * slack;
        const double a = (double{box.lower[k]} - size - double{ray.origin[k]}) / double{ray.direction[k]};
        const double b = (double{box.upper[k]} + size - double{ray.origin[k]}) / double{ray.direction[k]};
        near = std::max(near, std::min(a, b));
        far = std::min(far, std::max(a, b));
    }
    return near <= far;
}

void expectComplete(const InstanceTree& tree, const std::map<std::uint32_t, Box>& truth, std::mt19937& random, int rays,
                    float spread) {
    ASSERT_EQ(tree.size(), truth.size());
    for (int r = 0; r < rays; ++r) {
        Ray all[16];
        RayPacket16 packet;
        const Ray base = test::randomRay(random, spread);
        for (int i = 0; i < 16; ++i) {
            all[i] = r % 2 ? test::randomRay(random, spread) : base;  // every other packet's rays run together
            if (r % 2 == 0) all[i].direction += .01f * test::randomRay(random, 1).origin;
            if (i % 4 == 3) all[i].tMax = .7f;
            if (r % 7 == 0) all[i].direction[i % 3] = 0;
            packet.set(i, all[i]);
        }
        packet.skip(r % 16);
        std::set<std::uint32_t> visited;
        tree.traverse(all[0], [&](std::uint32_t object) {
            EXPECT_TRUE(visited.insert(object).second) << "twice";
            return all[0].tMax;
        });
        std::set<std::pair<std::uint32_t, int>> inPacket;
        tree.traverse(packet, packet.active, [&](std::uint32_t object, const std::int32_t* lanes) {
            for (int i = 0; i < 16; ++i) {
                EXPECT_TRUE(lanes[i] == 0 || inPacket.emplace(object, i).second) << "twice";
            }
        });
        for (const std::uint32_t object : visited) {
            ASSERT_TRUE(truth.contains(object));
            EXPECT_TRUE(r % 7 == 0 || meets(truth.at(object), all[0], 1e-5)) << "far from the box";
        }
        if (r % 7 == 0) continue;  // the brute force divides by zero there; the pass above is for crashes
        for (const auto& [object, box] : truth)
            for (int i = 0; i < 16; ++i) {
                if (!meets(box, all[i], 0)) continue;
                EXPECT_TRUE(i > 0 || visited.contains(object));
                EXPECT_EQ(inPacket.contains({object, i}), i != r % 16);
            }
    }
}

TEST(InstanceTree, FindsEveryBoxThroughRandomChanges) {
    for (const std::size_t maximum : {3u, 9u, 60u, 700u}) {
        SCOPED_TRACE(testing::Message() << "seed " << kTreeSeed << ", up to " << maximum);
        std::mt19937 random(kTreeSeed);
        std::uniform_real_distribution<float> unit(-1, 1);
        const auto randomBox = [&] {
            const Vec3f c = 20.0f * Vec3f(unit(random), unit(random), unit(random));
            const Vec3f h = glm::abs(Vec3f(unit(random), unit(random), unit(random))) * (random() % 50 ? 1.0f : 15.0f);
            return Box{c - h, c + h};
        };
        InstanceTree tree;
        std::map<std::uint32_t, Box> truth;
        for (int step = 0; step < 60; ++step) {
            SCOPED_TRACE(step);
            const std::size_t edits = step == 0 || step % 20 == 19 ? maximum : 1 + random() % (1 + maximum / 10);
            for (std::size_t n = 0; n < edits; ++n) {
                const auto object = static_cast<std::uint32_t>(random() % maximum);
                if (random() % 3 == 0) {
                    if (truth.erase(object)) tree.remove(object);
                } else {
                    Box box = randomBox();
                    if (truth.contains(object) && random() % 3) {  // a small move
                        const Vec3f d = .2f * Vec3f(unit(random), unit(random), unit(random));
                        box = {truth[object].lower + d, truth[object].upper + d};
                    }
                    truth[object] = box;
                    tree.set(object, box);
                }
            }
            tree.commit();
            expectComplete(tree, truth, random, 12, 25);
            if (testing::Test::HasFailure()) return;
        }
        for (const auto& [object, box] : truth) tree.remove(object);
        tree.commit();
        EXPECT_TRUE(tree.empty());
        expectComplete(tree, {}, random, 3, 25);
    }
}

TEST(InstanceTree, StandsManyAtOnePlaceAndOneThatTravels) {
    std::mt19937 random(kTreeSeed);
    InstanceTree tree;
    std::map<std::uint32_t, Box> truth;
    const Box here{Vec3f(-1), Vec3f(1)};
    for (std::uint32_t i = 0; i < 3000; ++i) tree.set(i, truth[i] = here);
    tree.commit();
    expectComplete(tree, truth, random, 2, 5);
    // One after the other, each found at once: the slow way to the same tree.
    InstanceTree grown;
    for (std::uint32_t i = 0; i < 3000; ++i) {
        grown.set(i, here);
        grown.commit();
    }
    expectComplete(grown, truth, random, 2, 5);
    for (int step = 1; step < 2000; ++step) {
        const Vec3f at(.5f * static_cast<float>(step), 0, 0);
        tree.set(7, truth[7] = {at - Vec3f(1), at + Vec3f(1)});
        tree.commit();
    }
    expectComplete(tree, truth, random, 4, 500);
    EXPECT_EQ(tree.bounds().upper.x, truth[7].upper.x);
}

/// Centres that are closer than numbers can be divided by cannot be sorted into bins; sanitizers would notice an
/// attempt.
TEST(InstanceTree, StandsThoseThatAreHardlyApart) {
    std::mt19937 random(kTreeSeed);
    for (const float step : {1e-45f, 1e-40f, 1e-38f, 1e-37f, 1e-30f}) {
        InstanceTree tree;
        std::map<std::uint32_t, Box> truth;
        for (std::uint32_t i = 0; i < 100; ++i) {
            const Vec3f at(static_cast<float>(i % 7) * step, static_cast<float>(i % 3) * step, 0);
            tree.set(i, truth[i] = {at, at});
        }
        tree.commit();
        expectComplete(tree, truth, random, 2, 5);
    }
}

// Work follows the changes: a few moved do not have the tree built anew.
TEST(InstanceTree, FewChangesDoNotRebuild) {
    std::mt19937 random(kTreeSeed);
    std::uniform_real_distribution<float> unit(-1, 1);
    InstanceTree tree;
    std::vector<Vec3f> centers;
    for (std::uint32_t i = 0; i < 10000; ++i) {
        centers.push_back(100.0f * Vec3f(unit(random), unit(random), unit(random)));
        tree.set(i, {centers[i] - Vec3f(1), centers[i] + Vec3f(1)});
    }
    tree.commit();
    EXPECT_EQ(tree.builds(), 1u);
    for (int step = 0; step < 1000; ++step) {
        const auto i = static_cast<std::uint32_t>(random() % 10000);
        centers[i] += Vec3f(unit(random), unit(random), unit(random));
        tree.set(i, {centers[i] - Vec3f(1), centers[i] + Vec3f(1)});
        tree.commit();
    }
    EXPECT_EQ(tree.builds(), 1u);
}

}  // namespace
}  // namespace rtsg::bvh
