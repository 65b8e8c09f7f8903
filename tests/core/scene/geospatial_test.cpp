// Where geospatial nodes stand, with and without a GeoOrigin; the expected places are worked out here by themselves.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/geospatial.h>
#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

struct GeoScene {
    Scene scene;
    Diagnostics diagnostics;
    explicit GeoScene(const std::string& text) {
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        scene.newFrame(0);
    }
    NodeId id(const char* name) { return scene.findName(name); }
    glm::dmat4 worldFromNode(const char* name) {
        const auto found = geoTransform(scene, scene.node(id(name)));
        EXPECT_TRUE(found) << (found ? "" : found.error().text);
        return found.value_or(glm::dmat4(0));
    }
};

constexpr double kRadians = M_PI / 180;

/// WGS 84, by the book.
Vec3d pointOf(double latitude, double longitude, double height) {
    const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f);
    const double p = latitude * kRadians, l = longitude * kRadians;
    const double n = a / std::sqrt(1 - e2 * std::sin(p) * std::sin(p));
    return {(n + height) * std::cos(p) * std::cos(l), (n + height) * std::cos(p) * std::sin(l),
            (n * (1 - e2) + height) * std::sin(p)};
}
Vec3d upAt(double latitude, double longitude) {
    const double p = latitude * kRadians, l = longitude * kRadians;
    return {std::cos(p) * std::cos(l), std::cos(p) * std::sin(l), std::sin(p)};
}
Vec3d northAt(double latitude, double longitude) {
    const double p = latitude * kRadians, l = longitude * kRadians;
    return {-std::sin(p) * std::cos(l), -std::sin(p) * std::sin(l), std::cos(p)};
}
void expectClose(const Vec3d& a, const Vec3d& b, double tolerance) {
    EXPECT_LE(glm::length(a - b), tolerance)
        << a.x << ' ' << a.y << ' ' << a.z << " for " << b.x << ' ' << b.y << ' ' << b.z;
}

}  // namespace

TEST(Geospatial, ALocationStandsUprightOnTheEllipsoid) {
    GeoScene s("DEF L GeoLocation { geoCoords 46.5 -122.25 300 } DEF M GeoLocation { geoCoords 46.5 -122.25 300.001 }");
    const glm::dmat4 l = s.worldFromNode("L"), m = s.worldFromNode("M");
    expectClose(Vec3d(l[3]), pointOf(46.5, -122.25, 300), 2e-9);
    expectClose(Vec3d(l[1]), upAt(46.5, -122.25), 1e-14);
    expectClose(-Vec3d(l[2]), northAt(46.5, -122.25), 1e-14);
    expectClose(Vec3d(l[0]), glm::cross(Vec3d(l[1]), Vec3d(l[2])), 1e-14);
    expectClose(Vec3d(m[3] - l[3]), upAt(46.5, -122.25) * .001, 3e-9);  // a millimetre stays one
}

TEST(Geospatial, AnOriginIsTakenOffAndTurnedUpright) {
    const char* text =
        "DEF L GeoLocation { geoCoords 10.001 20 50 geoOrigin DEF O GeoOrigin { geoCoords 10 20 40 rotateYUp %s } }"
        "DEF H GeoLocation { geoCoords 10 20 40 geoOrigin USE O }";
    const auto with = [&](const char* turned) {
        return std::string(text).replace(std::string(text).find("%s"), 2, turned);
    };
    GeoScene flat(with("FALSE")), turned(with("TRUE"));
    const Vec3d by = pointOf(10.001, 20, 50) - pointOf(10, 20, 40);
    expectClose(Vec3d(flat.worldFromNode("L")[3]), by, 2e-9);
    expectClose(Vec3d(flat.worldFromNode("H")[1]), upAt(10, 20), 1e-14);
    const glm::dmat4 home = turned.worldFromNode("H"), there = turned.worldFromNode("L");
    for (int i = 0; i < 4; ++i) expectClose(Vec3d(home[i]), Vec3d(i == 0, i == 1, i == 2), 1e-14);
    EXPECT_NEAR(there[3].y, glm::dot(by, upAt(10, 20)), 2e-9);
    EXPECT_NEAR(there[3].z, -glm::dot(by, northAt(10, 20)), 2e-9);
    EXPECT_NEAR(there[3].x, 0, 2e-9);
}

TEST(Geospatial, ATransformTurnsAboutTheGroundAtItsCenter) {
    GeoScene s(
        "DEF N GeoTransform { geoCenter 30 40 0 }"
        "DEF T GeoTransform { geoCenter 30 40 0 rotation 0 1 0 1.57079632679 translation 0 5 0 }");
    EXPECT_EQ(s.worldFromNode("N"), glm::dmat4(1));
    const glm::dmat4 t = s.worldFromNode("T");
    const Vec3d center = pointOf(30, 40, 0), up = upAt(30, 40), north = northAt(30, 40), east = glm::cross(north, up);
    expectClose(Vec3d(t * glm::dvec4(center, 1)), center + up * 5.0, 4e-9);
    // A quarter turn about up takes the east to the north; float angles are good to 5e-8.
    expectClose(Vec3d(t * glm::dvec4(center + east * 100.0, 1)), center + up * 5.0 + north * 100.0, 1e-5);
}

TEST(Geospatial, AViewpointLooksNorthAndItsUserWalksOnTheGround) {
    GeoScene s("NavigationInfo { type \"WALK\" } DEF V GeoViewpoint { position 60 25 2 }");
    const ViewerPose at = viewerPose(s.scene);
    expectClose(at.position, pointOf(60, 25, 2), 2e-9);
    expectClose(at.orientation * Vec3d(0, 0, -1), northAt(60, 25), 1e-9);
    expectClose(at.orientation * Vec3d(0, 1, 0), upAt(60, 25), 1e-9);
    const Vec3d there = at.position + northAt(60, 25) * 10.0;
    ASSERT_TRUE(moveViewer(s.scene, {there, at.orientation}, false));
    s.scene.newFrame(1);
    expectClose(viewerPose(s.scene).position, there, 4e-9);
    ASSERT_TRUE(s.scene.set(s.id("V"), x3d::GeoViewpoint::position, Vec3d(-33, 151, 500)));
    s.scene.newFrame(2);
    expectClose(viewerPose(s.scene).position, pointOf(-33, 151, 500) + northAt(-33, 151) * 10.0, 4e-9);
    EXPECT_EQ(viewpoints(s.scene), std::vector{s.id("V")});
}

TEST(Geospatial, WhoIsHighUpGoesFaster) {
    struct Case {
        const char* position;
        double height;
    };
    for (const Case& one : {Case{"position 60 25 0", 0},
                            {"position 60 25 1000", 1000},
                            {"position 60 25 -30", 0},
                            {"geoSystem [ \"GC\" ] position 6378637 0 0 orientation 1 0 0 0", 500},
                            {"geoSystem [ \"UTM\" \"Z35\" ] position 6651411 388000 20000", 20000}}) {
        GeoScene s(std::string("NavigationInfo { type \"FLY\" speed 2 } DEF V GeoViewpoint { speedFactor .5 ") +
                   one.position + " }");
        s.scene.setNavigation(true);
        ASSERT_TRUE(sendKey(s.scene, *KeyInput::named("UP", true)));
        s.scene.newFrame(1);
        const Vec3d from = viewerPose(s.scene).position;
        s.scene.newFrame(1.1);
        const double expected = 2 * .5 * (1 + one.height / 10) * .1;
        EXPECT_NEAR(glm::length(viewerPose(s.scene).position - from), expected, 1e-6 * expected + 1e-8) << one.position;
    }
}

TEST(Geospatial, WhoeverStandsByAnOriginHearsThatItMoves) {
    GeoScene s(
        "DEF V Viewpoint { position 0 0 0 } GeoLocation { geoCoords 5 6 7 "
        "geoOrigin DEF O GeoOrigin { geoCoords 5 6 7 } children DEF P ProximitySensor { size 10 10 10 } }");
    EXPECT_TRUE(s.scene.node(s.id("P")).get(x3d::ProximitySensor::isActive));
    ASSERT_TRUE(s.scene.set(s.id("O"), x3d::GeoOrigin::geoCoords, Vec3d(5, 6.01, 7)));
    s.scene.newFrame(1);
    EXPECT_FALSE(s.scene.node(s.id("P")).get(x3d::ProximitySensor::isActive));
}

TEST(Geospatial, WhatIsNoSystemIsAnError) {
    GeoScene s("DEF L GeoLocation { geoSystem [ \"UTM\" ] } DEF C GeoCoordinate { geoSystem \"XY\" point 1 2 3 }");
    EXPECT_FALSE(geoTransform(s.scene, s.scene.node(s.id("L"))));
    const auto points = geoPoints(s.scene, s.scene.node(s.id("C")));
    ASSERT_FALSE(points);
    EXPECT_NE(points.error().text.find("'XY'"), std::string::npos);
}

}  // namespace rtsg
