// Versions of a RayWorld: each answers as the world did at its moment, whatever has been done to the world since.
// RTSG_LONG=1 has three threads read through 20,000 edits instead of 100.
#include <algorithm>
#include <atomic>
#include <deque>
#include <mutex>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "mesh/triangle_distance.h"
#include "renderers/world/deform_support.h"
#include "renderers/world_players.h"
#include "support/long_form.h"

namespace rtsg {
namespace {

using namespace test;
using VersionMapping = RayWorld::Mapping;
using Version = std::shared_ptr<const WorldVersion>;

constexpr std::uint32_t kVersionSeed = 20260401;

/// Which slots are there, and where.
void expectSameInstances(const RayView& view, const BruteForce& truth) {
    std::size_t live = 0;
    for (const RayInstance& instance : view.instances()) {
        if (!instance.info.id) continue;
        ++live;
        const auto found = truth.items.find(instance.info.id.slot);
        ASSERT_NE(found, truth.items.end());
        EXPECT_EQ(instance.info.id, found->second.info.id);
        EXPECT_EQ(instance.info.worldFromLocal, found->second.info.worldFromLocal);
        if (instance.mesh) {
            EXPECT_EQ(instance.mesh, found->second.mesh);
        }
    }
    EXPECT_EQ(live, truth.items.size());
}

/// Everything near a point is visited, and nothing that is not there.
void expectSameNear(const RayView& view, const BruteForce& truth, Vec3f center, float radius) {
    std::set<std::pair<std::uint32_t, std::uint32_t>> visited;
    view.visitNear(center, radius, [&](std::uint32_t slot, std::uint32_t triangle) {
        visited.emplace(slot, triangle);
        return radius;
    });
    for (const auto& [slot, triangle] : visited) {
        const auto found = truth.items.find(slot);
        ASSERT_NE(found, truth.items.end()) << slot;
        EXPECT_LT(triangle, found->second.mesh->triangleCount);
    }
    for (const auto& [slot, item] : truth.items) {
        if (determinantSign(item.info.worldFromLocal) == 0) continue;
        for (std::uint32_t t = 0; t < item.mesh->triangleCount; ++t) {
            const auto corner = [&](std::uint32_t c) {
                return item.info.worldFromLocal * Vec4d(item.mesh->vertex(t, c), 1) - view.origin();
            };
            const exact::Triangle triangle{corner(0), corner(1), corner(2)};
            const exact::Weights w = exact::nearest(Vec3d(center), triangle);
            if (glm::length(triangle.at(w.u, w.v) - Vec3d(center)) < radius * .999) {
                EXPECT_TRUE(visited.contains({slot, t})) << slot << ", " << t;
            }
        }
    }
}

/// A version with what it must answer.
struct Held {
    Version version;
    BruteForce truth;
    Bounds bounds;
    std::vector<Hit> hits;  // of the rays of `seed`
    std::uint32_t seed;

    Held(RayWorld& world, const BruteForce& t, std::uint32_t s) : version(world.freeze()), truth(t), seed(s) {
        if (version) bounds = world.bounds(), hits = trace(world);
    }
    std::vector<Hit> trace(const RayView& view) const {
        std::mt19937 random(seed);
        std::vector<Hit> found;
        for (int i = 0; i < 100; ++i) found.push_back(view.intersect(randomRay(random, 14)));
        return found;
    }
    void check(std::mt19937& random, int packets) const {
        Players::compare(*version, truth, random, packets);
        checkBits(random);
    }
    /// The parts that need no tolerance.
    void checkBits(std::mt19937& random) const {
        expectSameInstances(*version, truth);
        expectSameNear(*version, truth, randomRay(random, 10).origin, 3);
        EXPECT_EQ(version->bounds().min, bounds.min);
        EXPECT_EQ(version->bounds().max, bounds.max);
        const std::vector<Hit> now = trace(*version);
        for (std::size_t i = 0; i < hits.size(); ++i) {
            ASSERT_EQ(now[i].instance, hits[i].instance) << i;
            ASSERT_EQ(now[i].triangle, hits[i].triangle) << i;
            ASSERT_EQ(now[i].t, hits[i].t) << i;
            ASSERT_EQ(now[i].normal, hits[i].normal) << i;
        }
    }
};

class WorldVersions : public testing::TestWithParam<VersionMapping> {};
INSTANTIATE_TEST_SUITE_P(All, WorldVersions,
                         testing::Values(VersionMapping::merged, VersionMapping::perShape, VersionMapping::hybrid),
                         [](const auto& at) {
                             return at.param == VersionMapping::merged     ? "merged"
                                    : at.param == VersionMapping::perShape ? "perShape"
                                                                           : "hybrid";
                         });

TEST_P(WorldVersions, AnswerAsTheWorldDidWhateverIsDoneToItSince) {
    RayWorld::Stats maximum;
    for (std::uint32_t run = 0; run < 3; ++run) {
        SCOPED_TRACE(testing::Message() << "seed " << kVersionSeed + run);
        Players players(kVersionSeed + run, {.mapping = GetParam(), .restFrames = 1 + run, .background = run % 2 == 0});
        std::deque<Held> held;
        for (std::uint32_t step = 0; step < 60; ++step) {
            SCOPED_TRACE(testing::Message() << "step " << step);
            // Now and then nobody holds anything, and now and then as many do as can.
            const std::size_t maximum_held = step % 20 < 3 ? 0 : step % 20 < 10 ? 2 : RayWorld::kMaxVersions;
            while (held.size() >= std::max<std::size_t>(1, maximum_held)) held.pop_front();
            if (step % 3 == 0 && held.size() > 2) held.erase(held.begin() + 1);
            if (maximum_held > 0) {
                held.emplace_back(players.world(), players.truth(), kVersionSeed + step);
                ASSERT_TRUE(held.back().version);
            }
            players.step();
            players.compare(1);
            expectSameNear(players.world(), players.truth(), {0, 0, 0}, 3);
            for (const Held& one : held) one.check(players.random(), 1);
            if (HasFailure()) return;
        }
        // A world made of a version's state answers alike.
        held.clear();
        Held last(players.world(), players.truth(), kVersionSeed);
        ASSERT_TRUE(last.version);
        for (int i = 0; i < 3; ++i) players.step();
        RayWorld fresh({.mapping = GetParam()});
        InstanceDelta all;
        for (const auto& [slot, item] : last.truth.items) {
            all.geometries.push_back({item.info.geometry, item.mesh});
            all.added.push_back(item.info);
        }
        fresh.apply(all);
        std::mt19937 random(kVersionSeed);
        EXPECT_TRUE(sameHits(*last.version, fresh, random, 300));
        const RayWorld::Stats stats = players.world().stats();
        maximum.merges += stats.merges, maximum.splits += stats.splits, maximum.bodiesBuilt += stats.bodiesBuilt;
    }
    if (GetParam() != VersionMapping::hybrid) return;
    EXPECT_GT(maximum.merges, 3u);
    EXPECT_GT(maximum.splits, 10u);
    EXPECT_GT(maximum.bodiesBuilt, 5u);
}

/// Boxes in a row, which rest, at x = 0, 4, 8...
struct Row {
    RayWorld world;
    explicit Row(const RayWorld::Options& options, std::uint32_t boxes = 40, double far = 0) : world(options) {
        world.apply(delta(boxes, far));
    }
    static InstanceDelta delta(std::uint32_t boxes, double far, std::uint32_t generation = 0) {
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, makeBox()});
        for (std::uint32_t i = 0; i < boxes; ++i)
            delta.added.push_back(makeInstance(i, NodeId{1}, translation({far + 4.0 * i, 0, 0}), generation));
        return delta;
    }
    static Ray down(std::uint32_t i) { return {{4.0f * static_cast<float>(i), 0, 9}, 0, {0, 0, -1}}; }
};

TEST_P(WorldVersions, KeepTheShadowsOfTheirTime) {
    Row row({.mapping = GetParam()});
    std::vector<Version> versions;
    // In version k the first k boxes cast none; each has its own bits until they run out.
    for (std::uint32_t k = 0; k < RayWorld::kMaxVersions; ++k) {
        versions.push_back(row.world.freeze());
        ASSERT_TRUE(versions.back());
        InstanceDelta delta;
        delta.rebound.push_back(row.world.instance(k).info);
        delta.rebound.back().castShadow = false;
        row.world.apply(delta);
    }
    EXPECT_EQ(row.world.freeze(), nullptr) << "so many, and no more";
    for (std::uint32_t i = 0; i < 12; ++i) {
        EXPECT_EQ(row.world.occluded(Row::down(i)), i >= RayWorld::kMaxVersions) << i;
        EXPECT_TRUE(row.world.occluded(Row::down(i), RayKind::view));
        for (std::uint32_t k = 0; k < versions.size(); ++k) {
            EXPECT_EQ(versions[k]->occluded(Row::down(i)), i >= k) << k << ", " << i;
            EXPECT_TRUE(versions[k]->occluded(Row::down(i), RayKind::sound));
            EXPECT_TRUE(versions[k]->intersect(Row::down(i)));
        }
    }
    // Bits that come free are put right before they are used again.
    constexpr std::uint32_t kFreed = RayWorld::kMaxVersions - 2;
    versions.erase(versions.begin() + 1, versions.begin() + 1 + kFreed);
    for (std::uint32_t k = 0; k < kFreed; ++k) {
        InstanceDelta delta;
        delta.rebound.push_back(row.world.instance(20 + k).info);
        delta.rebound.back().castShadow = false;
        row.world.apply(delta);
        for (std::uint32_t i = 0; i < 30; ++i)
            EXPECT_EQ(row.world.occluded(Row::down(i)), i >= RayWorld::kMaxVersions && (i < 20 || i > 20 + k))
                << k << ", " << i;
        versions.push_back(row.world.freeze());
    }
    for (std::uint32_t i = 0; i < 30; ++i) EXPECT_TRUE(versions[0]->occluded(Row::down(i)));
}

TEST_P(WorldVersions, StayWhereTheyAreWhenTheWorldGoesFarAway) {
    Row row({.mapping = GetParam()});
    const Version near = row.world.freeze();
    InstanceDelta gone;
    for (std::uint32_t i = 0; i < 40; ++i) gone.removed.push_back({i, 0});
    row.world.apply(gone);
    const Version nothing = row.world.freeze();
    row.world.finishBackgroundWork();
    row.world.apply(Row::delta(10, 1e6, 1));
    EXPECT_NE(row.world.origin(), Vec3d(0));
    EXPECT_EQ(near->origin(), Vec3d(0));
    for (std::uint32_t i = 0; i < 40; ++i) {
        const Hit hit = near->intersect(Row::down(i));
        ASSERT_TRUE(hit);
        EXPECT_EQ(hit.instance, i);
        EXPECT_NEAR(near->point(hit).position.z, 1, 1e-5);
        EXPECT_FALSE(nothing->intersect(Row::down(i)));
    }
    EXPECT_TRUE(nothing->bounds().empty());
    EXPECT_TRUE(row.world.intersect({row.world.fromWorld({1e6 + 8, 0, 9}), 0, {0, 0, -1}}));
}

TEST(WorldVersion, OutlivesTheWorld) {
    Version version;
    {
        Row row({.restFrames = 1});
        version = row.world.freeze();
        InstanceDelta delta;
        delta.moved.push_back({{3, 0}, translation({0, 50, 0})});
        row.world.apply(delta);
        for (int i = 0; i < 20; ++i) row.world.apply({});  // and something may be under way
        RayWorld moved(std::move(row.world));
        row.world = RayWorld();
    }
    for (std::uint32_t i = 0; i < 40; ++i) EXPECT_EQ(version->intersect(Row::down(i)).instance, i);
}

TEST(WorldVersion, IsTheSameWhileNothingChanges) {
    Row row({});
    const Version first = row.world.freeze();
    EXPECT_EQ(row.world.freeze(), first);
    row.world.apply({});
    EXPECT_EQ(row.world.freeze(), first);
    InstanceDelta delta;
    delta.moved.push_back({{3, 0}, translation({0, 50, 0})});
    row.world.apply(delta);
    const Version second = row.world.freeze();
    EXPECT_NE(second, first);
    EXPECT_EQ(first->version() + 1, second->version());
}

/// How many of these arrays somebody else has as well.
std::size_t countInUse(const std::vector<Array<Vec3f>>& arrays) {
    return static_cast<std::size_t>(std::ranges::count_if(arrays, [](const Array<Vec3f>& array) {
        return (reinterpret_cast<const detail::ArrayHeader*>(array.data()) - 1)->owners.load() > 1;
    }));
}

/// Trees are counted by the positions that each keeps. (Bytes tell less: Embree takes as many blocks of memory for a
/// tree as threads took part in its build. And a thread of their own would let go of them in its time.)
TEST(WorldVersion, DeformingMeshesTakeTurns) {
    const auto rest = makeSphere(3);
    OneShape shape{.world = RayWorld({.buildThreads = 1, .background = false})};
    std::vector<Array<Vec3f>> shown;
    const auto show = [&](float amount) {
        const auto mesh = moved(*rest, [&](Vec3f p) { return twist(p, amount); });
        shown.push_back(mesh->positions);
        shape.show(mesh);
        return mesh;
    };
    show(0);
    show(.1f);
    constexpr std::size_t kHeld = 3;
    std::deque<std::pair<Version, std::shared_ptr<Mesh>>> held;
    std::mt19937 random(kVersionSeed);
    for (int frame = 0; frame < 60; ++frame) {
        const auto mesh = show(.01f * static_cast<float>(frame));
        held.emplace_back(shape.world.freeze(), mesh);
        if (held.size() > kHeld) held.pop_front();
        for (const auto& [version, there] : held) {
            OneShape fresh;
            fresh.show(there);
            EXPECT_TRUE(sameHits(*version, fresh.world, random, 30)) << frame;
        }
        // One is kept for the version let go, until the next frame takes it.
        EXPECT_LE(countInUse(shown), kHeld + 1) << frame;
    }
    EXPECT_GT(shape.world.stats().meshRebuilds, 0u) << "which make other trees";
    held.clear();
    for (int frame = 0; frame < 4; ++frame) show(.02f * static_cast<float>(frame));
    EXPECT_EQ(countInUse(shown), 1u) << "when nobody holds any, one is enough";
}

/// Of the rays that are not too close to call: how many were compared with the brute force, and how many differed.
struct Tally {
    std::atomic<int> compared{0}, differed{0};
    void add(const RayView& view, const BruteForce& truth, std::mt19937& random) {
        for (int i = 0; i < 16; ++i) {
            const Ray ray = randomRay(random, 14);
            const BruteForce::Answer expected = truth.intersect(ray, view.origin());
            if (expected.margin < 1e-4) continue;
            const Hit hit = view.intersect(ray);
            ++compared;
            differed += hit.instance != expected.instance || hit.triangle != expected.triangle ||
                        (hit && std::abs(hit.t - expected.t) > 1e-4 * expected.t + 1e-3);
        }
    }
};

/// Edits on this thread, while three others take versions, hold them for a while, and find that they stay as they were.
void readWhileEdited(std::uint32_t seed, int steps, Tally& tally) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Players players(seed, {.restFrames = 2});
    std::mutex mutex;
    auto latest = std::make_shared<const Held>(players.world(), players.truth(), seed);
    std::atomic<bool> stop{false};
    std::atomic<int> checked{0};
    std::vector<std::thread> readers;
    for (std::uint32_t r = 0; r < 3; ++r) {
        readers.emplace_back([&, r] {
            std::mt19937 random(seed + 1 + r);
            std::deque<std::shared_ptr<const Held>> held;
            while (!stop) {
                {
                    const std::lock_guard lock(mutex);
                    held.push_back(latest);
                }
                while (held.size() > 1 + random() % 2) held.pop_front();
                for (std::size_t looks = 1 + random() % 3; looks > 0; --looks) {
                    held.front()->checkBits(random);
                    tally.add(*held.front()->version, held.front()->truth, random);
                }
                ++checked;
            }
        });
    }
    for (int step = 0; step < steps || checked < steps / 4; ++step) {
        if (step < steps) players.step();
        auto next =
            std::make_shared<const Held>(players.world(), players.truth(), seed + static_cast<std::uint32_t>(step));
        if (next->version) {
            const std::lock_guard lock(mutex);
            std::swap(latest, next);
        }
        if (step >= steps) std::this_thread::yield();
        if (testing::Test::HasFailure()) break;
    }
    stop = true;
    for (std::thread& reader : readers) reader.join();
}

TEST(WorldVersion, ReadersOnThreeThreadsSeeWholeStates) {
    const std::uint32_t rounds = test::fewOrMany(1, 200);
    Tally tally;
    for (std::uint32_t round = 0; round < rounds && !HasFailure(); ++round)
        readWhileEdited(kVersionSeed + 100 * round, 100, tally);
    EXPECT_GT(tally.compared, 100);
    // Transforms that the players multiply over and over become so ill-conditioned that float differs from the truth:
    // 3 of 68,556 hits of a world without any versions did. A state that is not whole differs everywhere.
    EXPECT_LE(tally.differed, 2 + tally.compared / 2000) << "of " << tally.compared;
}

}  // namespace
}  // namespace rtsg
