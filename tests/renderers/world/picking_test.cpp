// Picking against brute force in double precision over random scenes, and against closed forms.
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/picking.h>

#include "mesh/triangle_distance.h"
#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using exact::Triangle;

constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Picked {
    Scene scene;
    Flattener flattener;
    RayWorld world;
    Picker picker{world, flattener};

    explicit Picked(const std::string& text, RayWorld::Mapping mapping = RayWorld::Mapping::hybrid)
        : world(RayWorld::Options{.mapping = mapping, .robust = true, .buildThreads = 1}) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u);
        follow();
    }
    void follow() {
        const auto set = scene.seal();
        if (set) world.apply(flattener.apply(scene, *set));
    }
    /// All triangles in world space.
    std::vector<Triangle> triangles() const {
        std::vector<Triangle> all;
        for (const RayInstance& i : world.instances()) {
            if (!i.info.id || !i.mesh) continue;
            for (std::uint32_t t = 0; t < i.mesh->triangleCount; ++t) {
                const auto corner = [&](std::uint32_t c) {
                    return i.info.worldFromLocal * glm::dvec4(Vec3d(i.mesh->vertex(t, c)), 1);
                };
                all.push_back({corner(0), corner(1), corner(2)});
            }
        }
        return all;
    }
};

std::string randomScene(std::mt19937& random) {
    std::uniform_real_distribution<double> unit(-1, 1);
    std::string text = "DEF BALL Shape { geometry Sphere { radius .7 } }\n";
    for (int i = 0; i < 25; ++i) {
        const double flip = unit(random) < 0 ? -1 : 1;
        text += fmt::format(
            "Transform {{ translation {} {} {} rotation {} {} {} {} scale {} {} {} scaleOrientation 1 {} {} {} "
            "children {} }}\n",
            4 * unit(random), 4 * unit(random), 4 * unit(random), unit(random), unit(random), unit(random),
            3 * unit(random), flip * (0.3 + std::abs(unit(random))), 0.3 + std::abs(unit(random)),
            0.05 + std::abs(unit(random)), unit(random), unit(random), unit(random),
            i % 3 == 0 ? "USE BALL" : "Shape { geometry Box { size 1 2 .5 } }");
    }
    return text;
}

Vec3d randomPoint(std::mt19937& random, double size) {
    std::uniform_real_distribution<double> unit(-size, size);
    return {unit(random), unit(random), unit(random)};
}

double bruteDistance(const std::vector<Triangle>& all, const Vec3d& p) {
    double minimum = kInfinite;
    for (const Triangle& t : all) {
        const exact::Weights w = exact::nearest(p, t);
        minimum = std::min(minimum, glm::distance(p, t.at(w.u, w.v)));
    }
    return minimum;
}

TEST(Picking, NearestPointOfATriangleMeetsTheConditionOfConvexity) {
    // q is the nearest point of a convex set to p exactly if no point x of the set has (p - q).(x - q) > 0.
    const auto seed = std::random_device{}();
    std::mt19937 random(seed);
    SCOPED_TRACE(seed);
    for (int i = 0; i < 20000; ++i) {
        Triangle t{randomPoint(random, 1), randomPoint(random, 1), randomPoint(random, 1)};
        if (i % 7 == 0) t.c = t.a + 0.3 * (t.b - t.a);  // no area
        if (i % 11 == 0) t.b = t.c = t.a;               // a point
        if (i % 13 == 0) t.c = t.a + (t.b - t.a) * 0.5 + 1e-9 * randomPoint(random, 1);
        const Vec3d p = randomPoint(random, 2);
        const exact::Weights w = exact::nearest(p, t);
        ASSERT_GE(w.u, 0);
        ASSERT_GE(w.v, 0);
        ASSERT_LE(w.u + w.v, 1 + 1e-15);
        const Vec3d q = t.at(w.u, w.v);
        for (const Vec3d& x : {t.a, t.b, t.c}) ASSERT_LE(glm::dot(p - q, x - q), 1e-7) << i;
    }
}

class PickingMappings : public testing::TestWithParam<RayWorld::Mapping> {};

TEST_P(PickingMappings, ClosestPointIsThatOfBruteForce) {
    const auto seed = std::random_device{}();
    std::mt19937 random(seed);
    SCOPED_TRACE(seed);
    Picked p(randomScene(random), GetParam());
    for (int round = 0; round < 3; ++round) {
        const auto all = p.triangles();
        for (int i = 0; i < 100; ++i) {
            const Vec3d point = randomPoint(random, i % 2 ? 6 : 30);
            const double expected = bruteDistance(all, point);
            const auto found = p.picker.closest(point);
            ASSERT_TRUE(found && *found);
            EXPECT_NEAR(found->distance, expected, 1e-12 + 1e-12 * expected);
            EXPECT_NEAR(glm::distance(found->point, point), expected, 1e-12 + 1e-12 * expected);
            EXPECT_NEAR(glm::length(found->normal), 1, 1e-12);
            // Just out of reach, nothing is found; just within, it is.
            EXPECT_FALSE(*p.picker.closest(point, expected * 0.999999));
            EXPECT_TRUE(*p.picker.closest(point, expected * 1.000001));
        }
        // Things that have moved, or are hidden at their old place, answer from where they are now.
        const auto& roots = p.scene.node(p.scene.root()).get(x3d::RtsgScene::children);
        for (std::size_t i = 1; i < roots.size(); i += 3)
            if (p.scene.node(roots[i]).is(x3d::Transform::type)) {
                ASSERT_TRUE(p.scene.set(roots[i], x3d::Transform::translation, Vec3f(randomPoint(random, 4))));
            }
        p.follow();
    }
}

TEST_P(PickingMappings, SweptBallStopsWhereConservativeAdvancementDoes) {
    const auto seed = std::random_device{}();
    std::mt19937 random(seed);
    SCOPED_TRACE(seed);
    Picked p(randomScene(random), GetParam());
    const auto all = p.triangles();
    std::uniform_real_distribution<double> unit(0, 1);
    int contacts = 0;
    for (int i = 0; i < 60; ++i) {
        const Vec3d start = randomPoint(random, 8), end = randomPoint(random, i % 5 ? 8 : 1);
        const double radius = 0.02 + unit(random) * (i % 3 ? 0.3 : 1.5), length = glm::distance(start, end);
        const Vec3d direction = (end - start) / length;
        // As far as the distance allows, again and again: never too far, and slow only where it grazes a surface.
        double travelled = 0;
        bool touches = false;
        for (int step = 0; step < 20000 && travelled <= length; ++step) {
            const double room = bruteDistance(all, start + travelled * direction) - radius;
            if (room < 1e-7) {
                touches = true;
                break;
            }
            travelled += room;
        }
        const auto found = p.picker.sweep(start, radius, end - start);
        ASSERT_TRUE(found);
        // A graze by less than the tolerance may go either way.
        if (touches != static_cast<bool>(*found)) {
            double minimum = kInfinite;
            for (int k = 0; k <= 2000; ++k)
                minimum =
                    std::min(minimum, std::abs(bruteDistance(all, start + (length * k / 2000) * direction) - radius));
            EXPECT_LT(minimum, 1e-3) << i;
            continue;
        }
        if (!touches) continue;
        ++contacts;
        EXPECT_GE(found->distance, travelled - 1e-6) << i;
        // At the stop the ball touches, to rounding.
        EXPECT_NEAR(bruteDistance(all, start + found->distance * direction),
                    std::min(radius, bruteDistance(all, start)), 1e-9)
            << i;
        EXPECT_NEAR(glm::distance(found->point, start + found->distance * direction),
                    std::min(radius, bruteDistance(all, start)), 1e-9);
    }
    EXPECT_GT(contacts, 8);
}

TEST_P(PickingMappings, OverlapsAreAllInstancesWithinReach) {
    const auto seed = std::random_device{}();
    std::mt19937 random(seed);
    SCOPED_TRACE(seed);
    Picked p(randomScene(random), GetParam());
    for (int i = 0; i < 50; ++i) {
        const Vec3d center = randomPoint(random, 5);
        const double radius = 0.1 + i * 0.05;
        std::map<std::uint32_t, double> expected;
        for (const RayInstance& instance : p.world.instances()) {
            if (!instance.info.id || !instance.mesh) continue;
            double minimum = kInfinite;
            for (std::uint32_t t = 0; t < instance.mesh->triangleCount; ++t) {
                const auto corner = [&](std::uint32_t c) {
                    return instance.info.worldFromLocal * glm::dvec4(Vec3d(instance.mesh->vertex(t, c)), 1);
                };
                minimum = std::min(minimum, bruteDistance({{corner(0), corner(1), corner(2)}}, center));
            }
            if (minimum <= radius) expected[instance.info.id.slot] = minimum;
        }
        const auto found = p.picker.overlaps(center, radius);
        ASSERT_TRUE(found);
        ASSERT_EQ(found->size(), expected.size());
        for (const Pick& pick : *found) {
            ASSERT_TRUE(expected.contains(pick.instance.slot));
            EXPECT_NEAR(pick.distance, expected[pick.instance.slot], 1e-12);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(All, PickingMappings,
                         testing::Values(RayWorld::Mapping::merged, RayWorld::Mapping::perShape,
                                         RayWorld::Mapping::hybrid),
                         [](const auto& one) {
                             return one.param == RayWorld::Mapping::merged     ? "merged"
                                    : one.param == RayWorld::Mapping::perShape ? "perShape"
                                                                               : "hybrid";
                         });

TEST(Picking, ARayTellsPathPointNormalAndTextureCoordinate) {
    Picked p(R"(
        DEF LEFT Transform { translation -3 0 0 children DEF GROUP Group { children DEF WALL Shape { geometry IndexedFaceSet {
            coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] } coordIndex [ 0 1 2 3 -1 ]
            texCoord TextureCoordinate { point [ 0 0, 1 0, 1 1, 0 1 ] } } } } }
        DEF RIGHT Transform { translation 3 0 0 scale -2 1 1 children USE GROUP })");
    const auto left = p.picker.ray({-2.5, 0.25, 5}, {0, 0, -2});
    ASSERT_TRUE(left && *left);
    EXPECT_NEAR(left->distance, 5, 1e-6);
    EXPECT_NEAR(glm::distance(left->point, Vec3d(-2.5, 0.25, 0)), 0, 1e-6);
    EXPECT_EQ(left->normal, Vec3d(0, 0, 1));
    EXPECT_NEAR(left->texCoord.x, 0.75, 1e-6);
    EXPECT_NEAR(left->texCoord.y, 0.625, 1e-6);
    EXPECT_EQ(left->shape, p.scene.findName("WALL"));
    EXPECT_EQ(left->path,
              (std::vector<NodeId>{p.scene.findName("LEFT"), p.scene.findName("GROUP"), p.scene.findName("WALL")}));
    // The same Shape by another path, mirrored: its outside stays outside.
    const auto right = p.picker.ray({4, 0, 5}, {0, 0, -1}, 10);
    ASSERT_TRUE(right && *right);
    EXPECT_EQ(right->path.front(), p.scene.findName("RIGHT"));
    EXPECT_EQ(right->normal, Vec3d(0, 0, 1));
    EXPECT_NEAR(right->texCoord.x, 0.25, 1e-6);
    EXPECT_FALSE(*p.picker.ray({4, 0, 5}, {0, 0, -1}, 4.9)) << "beyond the largest distance";
    EXPECT_FALSE(*p.picker.ray({0, 0, 5}, {0, 0, -1}));
}

TEST(Picking, ABallRollsIntoWallEdgeAndCorner) {
    Picked p(
        "Shape { geometry IndexedFaceSet { solid FALSE coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } coordIndex [ "
        "0 1 2 -1 ] } }");
    const double r = 0.25;
    EXPECT_NEAR(p.picker.sweep({0.2, 0.2, 2}, r, {0, 0, -4})->distance, 2 - r, 1e-12);
    EXPECT_NEAR(p.picker.sweep({0.2, 0.2, -2}, r, {0, 0, 4})->distance, 2 - r, 1e-12) << "from behind";
    // Past the edge x axis by .15: sqrt(.25^2 - .15^2) = .2 above the plane.
    EXPECT_NEAR(p.picker.sweep({0.5, -0.15, 2}, r, {0, 0, -4})->distance, 1.8, 1e-12);
    // Past the corner at the origin by (.09, .12), .15 in all.
    EXPECT_NEAR(p.picker.sweep({-0.09, -0.12, 2}, r, {0, 0, -4})->distance, 1.8, 1e-12);
    EXPECT_FALSE(*p.picker.sweep({-0.2, -0.2, 2}, r, {0, 0, -4}));
    EXPECT_FALSE(*p.picker.sweep({0.2, 0.2, 2}, r, {0, 0, -1.7})) << "stops short";
    // In the plane, against the long edge x + y = 1 from outside.
    EXPECT_NEAR(p.picker.sweep({2, 2, 0}, r, {-3, -3, 0})->distance, std::sqrt(2.0) * 1.5 - r, 1e-12);
    const auto inside = p.picker.sweep({0.2, 0.2, 0.1}, r, {0, 0, 5});
    EXPECT_EQ(inside->distance, 0) << "overlaps at once, though it moves away";
    EXPECT_EQ(inside->normal, Vec3d(0, 0, 1));
    // Far off in x there is much empty space on the way.
    EXPECT_NEAR(p.picker.sweep({0.2, 0.2, 20000}, r, {0, 0, -40000})->distance, 20000 - r, 1e-8);
}

TEST(Picking, BadQueriesAreRefusedWithAReason) {
    Picked p("Shape { geometry Box { } }");
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(p.picker.ray({nan, 0, 0}, {0, 0, 1}));
    EXPECT_FALSE(p.picker.ray({0, 0, 5}, {0, 0, 0}));
    EXPECT_FALSE(p.picker.ray({0, 0, 5}, {0, kInfinite, 0}));
    EXPECT_FALSE(p.picker.ray({0, 0, 1e12}, {0, 0, -1}));
    EXPECT_FALSE(p.picker.closest({0, nan, 0}));
    EXPECT_FALSE(p.picker.closest({0, 0, 0}, -1));
    EXPECT_FALSE(p.picker.sweep({0, 0, 0}, -1, {0, 0, 1}));
    EXPECT_FALSE(p.picker.sweep({0, 0, 0}, 1, {0, nan, 1}));
    EXPECT_FALSE(p.picker.overlaps({0, 0, 0}, kInfinite));
    EXPECT_NE(p.picker.ray({0, 0, 5}, {0, 0, 0}).error().text.find("direction"), std::string::npos);
    // Extreme but legal.
    EXPECT_TRUE(*p.picker.ray({0, 0, 5}, {0, 0, -1e-200}));
    EXPECT_TRUE(*p.picker.ray({0, 0, 5}, {0, 0, -1e200}));
    EXPECT_FALSE(*p.picker.sweep({0, 0, 5}, 1, {0, 0, 1e30}));
    EXPECT_TRUE(*p.picker.sweep({0, 0, 1.5}, 1, {0, 0, 0}));
}

TEST(Picking, AnEmptyWorldHasNothingToFind) {
    Picked p("Group { }");
    EXPECT_FALSE(*p.picker.ray({0, 0, 5}, {0, 0, -1}));
    EXPECT_FALSE(*p.picker.closest({0, 0, 0}));
    EXPECT_FALSE(*p.picker.sweep({0, 0, 5}, 1, {0, 0, -10}));
    EXPECT_TRUE(p.picker.overlaps({0, 0, 0}, 1)->empty());
}

TEST(Picking, ManyThreadsPickWhileOthersTrace) {
    std::mt19937 random(7);
    Picked p(randomScene(random));
    std::vector<Pick> expected;
    for (int i = 0; i < 64; ++i) expected.push_back(*p.picker.closest(Vec3d(i * 0.1 - 3, i * 0.05, 1)));
    std::vector<std::jthread> threads;
    std::atomic<int> wrong = 0, hits = 0;
    for (int n = 0; n < 3; ++n)
        threads.emplace_back([&] {
            for (int i = 0; i < 64; ++i) {
                const Pick pick = *p.picker.closest(Vec3d(i * 0.1 - 3, i * 0.05, 1));
                if (pick.distance != expected[static_cast<std::size_t>(i)].distance || pick.path.empty()) ++wrong;
            }
        });
    threads.emplace_back([&] {
        for (int i = 0; i < 2000; ++i)
            hits += static_cast<bool>(p.world.intersect({{0.003f * static_cast<float>(i) - 3, 0, 20}, 0, {0, 0, -1}}));
    });
    threads.clear();
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(hits, 0);
}

}  // namespace
}  // namespace rtsg
