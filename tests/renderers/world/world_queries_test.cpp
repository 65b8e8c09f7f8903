// Pointers' rays and what avatars touch, by the BVH: what they meet is the scene's present geometry, wherever it
// stands.
#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/world_queries.h>

#include "support/simple_space.h"

#include "support/convex_gauge.h"

namespace rtsg {
namespace {

struct PointedWorld {
    Scene scene;
    explicit PointedWorld(const std::string& text) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
    }
    SharedWorld world{scene};
    WorldQueries queries{world};
};

TEST(WorldQueries, MeetWhatDoubleCodeMeets) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> at(-4, 4), angle(-3, 3), scale(.3, 2);
    std::string text;
    for (int i = 0; i < 40; ++i) {
        std::ostringstream one;
        const double s = scale(random);
        one << "Transform { translation " << at(random) << ' ' << at(random) << ' ' << at(random)
            << " rotation 0.6 0 0.8 " << angle(random) << " scale " << s << ' ' << s << ' ' << s
            << " children Group { children DEF S" << i << " Shape { geometry Box { size 1 .5 .8 } } } }\n";
        text += one.str();
    }
    PointedWorld w(text);
    test::SimpleSpace simple(w.scene);
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3d origin = 10.0 * glm::normalize(Vec3d(at(random), at(random), at(random)));
        const Vec3d direction = Vec3d(at(random), at(random), at(random)) - origin;
        const auto found = w.queries.firstHit(origin, direction), expected = simple.firstHit(origin, direction);
        if (!found || !expected || found->path != expected->path) continue;  // edges are either's
        ++hits;
        EXPECT_LT(glm::distance(found->point, expected->point), 1e-9);
        EXPECT_GT(std::abs(glm::dot(found->normal, expected->normal)), 1 - 1e-5);
    }
    EXPECT_GT(hits, 800);
}

TEST(WorldQueries, MeetWhatHasJustBeenEdited) {
    PointedWorld w("DEF T Transform { children [ DEF S TouchSensor { } Shape { geometry Box { } } ] }");
    w.scene.setSpaceQueries(&w.queries);
    const NodeId transform = w.scene.findName("T"), sensor = w.scene.findName("S");
    const auto over = [&](double x) {
        PointerInput input;
        input.origin = {x, 0, 9};
        EXPECT_TRUE(sendPointer(w.scene, input));
        w.scene.newFrame(w.scene.now() + 1);
        return w.scene.node(sensor).get(x3d::TouchSensor::isOver);
    };
    EXPECT_TRUE(over(0)) << "before the first frame";
    ASSERT_TRUE(w.scene.set(transform, x3d::Transform::translation, Vec3f(5, 0, 0)));
    EXPECT_FALSE(over(.1)) << "an edit that is not sealed yet";
    EXPECT_TRUE(over(5.25));
    EXPECT_EQ(w.scene.node(sensor).get(x3d::TouchSensor::hitPoint_changed), Vec3f(.25f, 0, 1));
    ASSERT_TRUE(w.scene.destroyNode(transform));
    EXPECT_FALSE(over(5));
}

TEST(WorldQueries, CollisionIsFeltWhereTheAvatarStands) {
    PointedWorld w(
        "DEF V Viewpoint { } DEF C Collision { children Transform { translation 0 0 -3 children Shape { geometry "
        "Sphere { } } } }");
    w.scene.setSpaceQueries(&w.queries);
    const NodeId view = w.scene.findName("V"), collision = w.scene.findName("C");
    const auto touches = [&](float z) {
        EXPECT_TRUE(w.scene.set(view, x3d::Viewpoint::position, Vec3f(0, 0, z)));
        w.scene.newFrame(w.scene.now() + 1);
        return w.scene.node(collision).get(x3d::Collision::isActive);
    };
    EXPECT_FALSE(touches(0));
    EXPECT_FALSE(touches(-1.7f));
    EXPECT_TRUE(touches(-1.8f)) << "within avatarSize[0] = .25 m of the surface at -2";
    EXPECT_FALSE(touches(-1.7f));
}

/// The hits on the line x = 0, y = 0, by z: those for avatars, and those for everybody else.
struct Met {
    std::vector<double> felt, seen;
    friend bool operator==(const Met&, const Met&) = default;
};
std::ostream& operator<<(std::ostream& out, const Met& met) {
    return out << testing::PrintToString(met.felt) << " felt, " << testing::PrintToString(met.seen) << " seen";
}
Met metAlong(PointedWorld& w) {
    Met met;
    const auto positions = [](const std::vector<Crossing>& crossings) {
        std::vector<double> all;
        for (const Crossing& crossing : crossings) all.push_back(std::round(crossing.point.z * 1e6) / 1e6);
        return all;
    };
    met.felt = positions(w.queries.obstacles({0, 0, 100}, {0, 0, -2}, INFINITY));
    met.seen = positions(w.queries.crossings({0, 0, 100}, {0, 0, -2}, INFINITY));
    const auto first = w.queries.firstHit({0, 0, 100}, {0, 0, -2});
    EXPECT_EQ(first.has_value(), !met.seen.empty());
    if (first && !met.seen.empty()) {
        EXPECT_NEAR(first->point.z, met.seen[0], 1e-6);
    }
    EXPECT_EQ(w.queries.boxes().size(), met.seen.size() / 2);
    return met;
}

TEST(WorldQueries, ProxiesAreFeltAndNotSeen) {
    PointedWorld w(
        "DEF C Collision { children DEF M Transform { children Shape { geometry Box { } } }\n"
        "proxy DEF P Transform { translation 0 0 9 children [ DEF L LOD { range 5 children [ Shape { geometry Box { } "
        "} "
        "Shape { geometry Box { size 2 2 4 } } ] } PointLight { } Viewpoint { } ] } }\n"
        "DEF E Collision { proxy Transform { translation 0 0 20 rotation 0 1 0 1.5707963 scale 3 1 1 children Shape { "
        "geometry Box { } } } }");
    const NodeId collision = w.scene.findName("C"), proxy = w.scene.findName("P"), model = w.scene.findName("M");
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 10, 8, 1, -1}, {1, -1}}));
    for (const auto& entry : w.world.flattener().placed())
        EXPECT_NE(entry.kind, PlacedKind::light) << "a light in a proxy";
    EXPECT_EQ(w.queries.within({0, 0, 10.2}, .3).size(), 1u);
    EXPECT_EQ(w.queries.within({0, 0, 10.2}, .1).size(), 0u);
    ASSERT_TRUE(w.scene.set(proxy, x3d::Transform::translation, Vec3f(0, 0, 12)));
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 13, 11, 1, -1}, {1, -1}}));
    // One of the children, too: it is seen there.
    ASSERT_TRUE(w.scene.insertChild(collision, x3d::Collision::children, proxy));
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 13, 11, 1, -1}, {13, 11, 1, -1}}));
    ASSERT_TRUE(w.scene.removeChild(collision, x3d::Collision::children.index, 1));
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 13, 11, 1, -1}, {1, -1}}));
    ASSERT_TRUE(w.scene.set(collision, x3d::Collision::proxy, model));
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 1, -1}, {1, -1}}));
    ASSERT_TRUE(w.scene.set(collision, x3d::Collision::proxy, proxy));
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 13, 11, 1, -1}, {1, -1}}));
    ASSERT_TRUE(w.scene.set(collision, x3d::Collision::proxy, NodeId{}));
    EXPECT_EQ(metAlong(w), (Met{{23, 17, 1, -1}, {1, -1}}));
}

/// A proxy in a level of detail is felt where that level is the one that is seen, and one with levels by the same rule.
TEST(WorldQueries, ProxiesHaveLevelsOfDetail) {
    PointedWorld w(
        "LOD { range 50 children [ Collision { proxy LOD { range 30 children [ Shape { geometry Box { } } Shape { "
        "geometry Box { size 2 2 4 } } ] } } Collision { proxy Shape { geometry Box { size 2 2 6 } } } ] }");
    const auto from = [&](double z) {
        EXPECT_TRUE(w.world.setViewer(EyePosition{{0, 0, z}}));
        return metAlong(w);
    };
    EXPECT_EQ(from(10), (Met{{1, -1}, {}}));
    EXPECT_EQ(from(40), (Met{{2, -2}, {}}));
    EXPECT_EQ(from(60), (Met{{3, -3}, {}}));
    EXPECT_EQ(from(10), (Met{{1, -1}, {}}));
}

/// Boxes as triangles are what they are as closed forms; what lies on both sides of an edge counts once.
TEST(WorldQueries, CrossingsAreThoseOfDoubleCode) {
    std::mt19937 random(9);
    std::uniform_real_distribution<double> at(-4, 4), angle(-3, 3), scale(.3, 2);
    std::string text;
    for (int i = 0; i < 40; ++i) {
        std::ostringstream one;
        one << "Transform { translation " << at(random) << ' ' << at(random) << ' ' << at(random)
            << " rotation 0.6 0 0.8 " << angle(random) << " scale " << scale(random) << ' ' << scale(random) << ' '
            << scale(random) << " children Shape { geometry Box { } } }\n";
        text += one.str();
    }
    PointedWorld w(text);
    test::SimpleSpace simple(w.scene);
    std::size_t met = 0, rays = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3d origin = i % 2 ? Vec3d(at(random), at(random), at(random)) : Vec3d(12, at(random), at(random));
        const Vec3d direction = Vec3d(at(random), at(random), at(random)) - origin;
        const double length = i % 3 ? INFINITY : glm::length(direction) * .5;
        const auto found = w.queries.crossings(origin, direction, length);
        const auto expected = simple.crossings(origin, direction, length);
        // A ray through an edge, or one that ends on a face, is either's.
        if (found.size() != expected.size()) continue;
        ++rays;
        met += found.size();
        for (std::size_t k = 0; k < found.size(); ++k) {
            if (k + 1 < found.size() && glm::distance(expected[k].point, expected[k + 1].point) < 1e-5) break;
            EXPECT_EQ(found[k].path, expected[k].path) << i;
            EXPECT_LT(glm::distance(found[k].point, expected[k].point), 1e-5) << i;
            EXPECT_LT(glm::distance(found[k].normal, expected[k].normal), 1e-4) << i;
        }
    }
    EXPECT_GT(rays, 1990u);
    EXPECT_GT(met, 5000u);
}

/// Each shape is crossed as often as it is alone: what is inside of which is told by that.
TEST(WorldQueries, CrossingsOfFacesThatCoincideAreOfEachShape) {
    PointedWorld w("Shape { geometry Box { } } Transform { translation 2 0 0 children Shape { geometry Box { } } }");
    const auto found = w.queries.crossings({-9, .3, .2}, {1, 0, 0}, INFINITY);
    ASSERT_EQ(found.size(), 4u);
    const double expected[] = {-1, 1, 1, 3};
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(found[i].point.x, expected[i], 1e-6);
    EXPECT_NE(found[0].path, found[3].path);
    EXPECT_NE(found[1].path, found[2].path);
    EXPECT_EQ(std::ranges::count(found, found[0].path, &Crossing::path), 2);
    EXPECT_TRUE(w.queries.crossings({0, 0, 0}, {1, 0, 0}, .9).empty()) << "it ends before";
}

TEST(WorldQueries, BoxesAreAlongTheAxesOfTheirShapes) {
    PointedWorld w(
        "DEF T Transform { translation 2 0 0 scale 1 3 1 children DEF B Shape { geometry Box { size 2 4 6 } } }");
    const auto boxes = w.queries.boxes();
    ASSERT_EQ(boxes.size(), 1u);
    EXPECT_EQ(boxes[0].low, Vec3d(-1, -2, -3));
    EXPECT_EQ(boxes[0].high, Vec3d(1, 2, 3));
    EXPECT_EQ(Vec3d(boxes[0].worldFromShape * glm::dvec4(1, 1, 1, 1)), Vec3d(3, 3, 1));
    EXPECT_EQ(boxes[0].path, (std::vector<NodeId>{w.scene.findName("T"), w.scene.findName("B")}));
}

TEST(WorldQueries, PickSensorsMeetTheWorldsGeometry) {
    PointedWorld w(
        "DEF T Transform { children DEF B Shape { geometry Box { } } } "
        "DEF L LinePickSensor { intersectionType \"GEOMETRY\" pickTarget USE T pickingGeometry LineSet { vertexCount 2 "
        "coord Coordinate { point [ -9 .5 -.5, 9 .5 -.5 ] } } } "
        "DEF P PointPickSensor { intersectionType \"GEOMETRY\" pickTarget USE T pickingGeometry PointSet { coord "
        "Coordinate { point [ 0 0 0, .99 .99 .99, 1.01 0 0, 2 2 2 ] } } }");
    w.scene.setSpaceQueries(&w.queries);
    w.scene.newFrame(0);
    const Node &line = w.scene.node(w.scene.findName("L")), &points = w.scene.node(w.scene.findName("P"));
    using L = x3d::LinePickSensor;
    EXPECT_EQ(line.get(L::pickedPoint), (Array<Vec3f>{{-1, .5f, -.5f}, {1, .5f, -.5f}}));
    EXPECT_EQ(line.get(L::pickedNormal), (Array<Vec3f>{{-1, 0, 0}, {1, 0, 0}}));
    ASSERT_EQ(line.get(L::pickedTextureCoordinate).size(), 2u);
    // 13.3.1: each face has the whole picture, its lower left corner left of who looks at it: z = -.5 is a quarter of
    // the way from z = -1 on the face at -x, and from z = 1 three quarters on the face at +x.
    EXPECT_LT(glm::distance(line.get(L::pickedTextureCoordinate)[0], Vec3f(.25f, .75f, 0)), 1e-5f);
    EXPECT_LT(glm::distance(line.get(L::pickedTextureCoordinate)[1], Vec3f(.75f, .75f, 0)), 1e-5f);
    EXPECT_EQ(points.get(x3d::PointPickSensor::pickedPoint), (Array<Vec3f>{{0, 0, 0}, {.99f, .99f, .99f}}));
    ASSERT_TRUE(w.scene.set(w.scene.findName("T"), x3d::Transform::translation, Vec3f(2, 2, 2)));
    w.scene.newFrame(1);
    EXPECT_FALSE(line.get(L::isActive));
    EXPECT_EQ(points.get(x3d::PointPickSensor::pickedPoint), (Array<Vec3f>{{2, 2, 2}}));
}

/// Bodies that move among shapes of all kinds, some mirrored, merged or used twice, pick what a look at every triangle
/// picks.
TEST(WorldQueries, BodiesPickWhatALookAtEveryTriangleDoes) {
    constexpr unsigned kSeed = 12;
    SCOPED_TRACE(kSeed);
    std::mt19937 random(kSeed);
    std::uniform_real_distribution<double> any(-4, 4), positive(.4, 1.6);
    const char* const kinds[] = {"Box { }",
                                 "Sphere { }",
                                 "Cone { }",
                                 "Cylinder { height 1 }",
                                 "Extrusion { spine [ 0 0 0, 0 1 0, 1 2 0 ] }",
                                 "DEF E ElevationGrid { xDimension 3 zDimension 3 height [ 0 1 0, 1 2 1, 0 1 0 ] }"};
    std::ostringstream text;
    for (int i = 0; i < 30; ++i)
        text << "Transform { translation " << any(random) << ' ' << any(random) << ' ' << any(random)
             << " rotation .6 0 .8 " << any(random) << " scale " << (i % 4 ? 1 : -1) * positive(random) << ' '
             << positive(random) << " 1 children DEF S" << i << " Shape { geometry "
             << (i == 29 ? "USE E" : kinds[i % 6]) << " } } ";
    PointedWorld w(
        "DEF G Group { children [ " + text.str() +
        " ] } DEF M Transform { scale 1 1.5 .8 rotation 1 0 0 .7 children [ "
        "DEF P PrimitivePickSensor { intersectionType \"GEOMETRY\" sortOrder \"ALL\" pickTarget USE G "
        "pickingGeometry Cone { bottomRadius 1.2 height 2.4 } } "
        "DEF V VolumePickSensor { intersectionType \"GEOMETRY\" sortOrder \"ALL\" pickTarget USE G "
        "pickingGeometry Extrusion { crossSection [ 1 1, 1 -1, -1 -1, -1 1, 1 1 ] spine [ 0 -1 0, 0 1 0 ] } } ] }");
    w.scene.setSpaceQueries(&w.queries);
    std::vector<Vec3d> cuboid;
    for (int k = 0; k < 8; ++k) cuboid.emplace_back(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
    const test::Gauge gauges[] = {test::coneGauge(double(1.2f), double(2.4f) / 2), test::hullGauge(cuboid)};
    const glm::dmat4 rotation =
        glm::scale(glm::rotate(glm::dmat4(1), double(.7f), Vec3d(1, 0, 0)), Vec3d(1, double(1.5f), double(.8f)));
    std::size_t met = 0;
    for (int f = 0; f < 12; ++f) {
        const Vec3f to(float(any(random)), float(any(random)), float(any(random)));
        ASSERT_TRUE(w.scene.set(w.scene.findName("M"), x3d::Transform::translation, to));
        w.scene.newFrame(2 * f);
        w.scene.newFrame(2 * f + 1);
        const glm::dmat4 local = glm::inverse(glm::translate(glm::dmat4(1), Vec3d(to)) * rotation);
        for (const bool volume : {false, true}) {
            const Node& sensor = w.scene.node(w.scene.findName(volume ? "V" : "P"));
            const auto& reported = volume ? sensor.get(x3d::VolumePickSensor::pickedGeometry)
                                          : sensor.get(x3d::PrimitivePickSensor::pickedGeometry);
            for (const Instance& instance : w.world.flattener().instances()) {
                if (!instance.id) continue;
                const Mesh& mesh = *w.world.rays().instance(instance.id.slot).mesh;
                double depth = INFINITY;
                for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
                    std::array<glm::dvec3, 3> triangle;
                    for (std::uint32_t c = 0; c < 3; ++c)
                        triangle[c] = local * glm::dmat4(instance.worldFromLocal) * glm::dvec4(mesh.vertex(t, c), 1);
                    const Vec3d low = glm::min(glm::min(triangle[0], triangle[1]), triangle[2]);
                    const Vec3d high = glm::max(glm::max(triangle[0], triangle[1]), triangle[2]);
                    if (glm::any(glm::greaterThan(low, Vec3d(1.3))) || glm::any(glm::lessThan(high, Vec3d(-1.3))))
                        continue;
                    depth = std::min(depth, test::minOnTriangle(gauges[volume], triangle));
                    if (depth < -1e-5) break;
                }
                if (std::abs(depth) < 1e-5) continue;
                const bool picked = std::ranges::find(reported, instance.shape) != reported.end();
                EXPECT_EQ(picked, depth < 0) << f << ' ' << w.scene.name(instance.shape) << ' ' << depth;
                met += picked ? 1 : 0;
            }
        }
    }
    EXPECT_GT(met, 20u);
}

TEST(WorldQueries, APlaceInThePictureIsTheBearingThatPicturesHave) {
    std::mt19937 random(8);
    std::uniform_real_distribution<double> unit(0, 1), aspects(.4, 2.5), fields(.3, 2.5);
    for (int i = 0; i < 200; ++i) {
        std::ostringstream text;
        text.precision(9);
        const float field = static_cast<float>(fields(random)), angle = static_cast<float>(unit(random) * 6);
        text << "Transform { translation 1 2 3 rotation .6 .8 0 " << angle
             << " scale 2 2 2 children DEF V Viewpoint { position 1 0 4 "
             << "orientation 0 1 0 .5 fieldOfView " << field << " } }";
        PointedWorld w(text.str());
        w.scene.newFrame(0);
        const glm::dmat4 world = glm::translate(glm::dmat4(1), Vec3d(1, 2, 3)) *
                                 glm::rotate(glm::dmat4(1), double(angle), Vec3d(double(.6f), double(.8f), 0)) *
                                 glm::scale(glm::dmat4(1), Vec3d(2));
        const double aspect = aspects(random), x = unit(random), y = unit(random);
        const Camera camera = Camera::perspective(WorldFromLocal(world), {1, 0, 4}, {0, 1, 0, .5f}, field, aspect);
        const Camera::WorldRay expected = camera.ray(x, y);
        const Bearing bearing = bearingThrough(w.scene, x, y, aspect);
        EXPECT_LT(glm::distance(bearing.origin, expected.origin), 1e-5);
        EXPECT_LT(glm::distance(bearing.direction, expected.direction), 1e-5) << i;
    }
}

}  // namespace
}  // namespace rtsg
