// Pick sensors against closed forms wherever they stand, and picks that peers make up.
#include <algorithm>
#include <cmath>
#include <random>
#include <sstream>

#include <gtest/gtest.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "input/pick_report.h"
#include "support/convex_gauge.h"
#include "support/simple_space.h"

namespace rtsg {
namespace {

struct PickScene {
    Scene scene;
    test::SimpleSpace space{scene};

    explicit PickScene(const std::string& text) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        scene.setSpaceQueries(&space);
    }
    const Node& node(const char* name) const { return scene.node(scene.findName(name)); }
};

std::string textOf(const Vec3d& v) {
    std::ostringstream out;
    out.precision(9);
    out << float(v.x) << ' ' << float(v.y) << ' ' << float(v.z);
    return out.str();
}

/// A line past the middle of a ball at a known distance is in it for 2 sqrt(r^2 - d^2), wherever sensor and ball stand.
TEST(PickSensors, ALineCrossesABallWhereTheClosedFormSays) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> any(-3, 3), positive(.4, 2.5), part(0, .95);
    for (int i = 0; i < 300; ++i) {
        const double radius = double(float(positive(random))), scale = double(float(positive(random)));
        const Vec3d axis = glm::normalize(Vec3d(any(random), any(random), any(random))), move(any(random), 2, 1);
        const double angle = any(random);
        // In the sensor's own coordinates; the ball is scaled down so that it has its radius there.
        const Vec3d center(any(random), any(random), any(random)), along = glm::normalize(center + Vec3d(5, 0, 1));
        const Vec3d side = glm::normalize(glm::cross(along, Vec3d(.3, .8, .1)));
        const double off = radius * part(random), inside = std::sqrt(radius * radius - off * off);
        const Vec3d nearest = center + side * off, from = nearest - along * 9.0, to = nearest + along * 9.0;
        std::ostringstream text;
        text.precision(9);
        text << "Transform { translation " << textOf(move) << " rotation " << textOf(axis) << ' ' << angle << " scale "
             << textOf(Vec3d(scale)) << " children [ DEF T Transform { translation " << textOf(center)
             << " children DEF B Shape { geometry Sphere { radius " << radius << " } } } "
             << "DEF P LinePickSensor { intersectionType \"GEOMETRY\" pickTarget USE T pickingGeometry LineSet { "
             << "vertexCount 2 coord Coordinate { point [ " << textOf(from) << ", " << textOf(to) << " ] } } } ] }";
        PickScene s(text.str());
        s.scene.newFrame(0);
        const Node& p = s.node("P");
        using P = x3d::LinePickSensor;
        ASSERT_TRUE(p.get(P::isActive)) << i;
        ASSERT_EQ(p.get(P::pickedPoint).size(), 2u) << i;
        const Vec3d expected[] = {nearest - along * inside, nearest + along * inside};
        for (std::size_t k = 0; k < 2; ++k) {
            EXPECT_LT(glm::distance(Vec3d(p.get(P::pickedPoint)[k]), expected[k]), 3e-5) << i;
            const Vec3d normal = (expected[k] - center) / radius;
            EXPECT_LT(glm::distance(Vec3d(p.get(P::pickedNormal)[k]), normal), 1e-4) << i;
        }
    }
}

TEST(PickSensors, PointsAreInsideOfAScaledBoxWhereTheClosedFormSays) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> any(-2, 2), positive(.3, 2.5);
    for (int i = 0; i < 60; ++i) {
        const Vec3d scale(positive(random), positive(random), positive(random));
        const Vec3d axis = glm::normalize(Vec3d(any(random), any(random), any(random)));
        const double angle = any(random);
        const glm::dmat4 world = glm::rotate(glm::dmat4(1), angle, axis) * glm::scale(glm::dmat4(1), scale);
        std::vector<Vec3f> inside;
        std::string points;
        for (int k = 0; k < 50; ++k) {
            const Vec3f point(float(any(random)), float(any(random)), float(any(random)));
            const Vec3d local = glm::inverse(world) * glm::dvec4(Vec3d(point), 1);
            const double maximum = std::max({std::abs(local.x), std::abs(local.y), std::abs(local.z)});
            if (std::abs(maximum - 1) < 1e-4) continue;  // on the surface
            points += textOf(point) + ", ";
            if (maximum < 1) inside.push_back(point);
        }
        PickScene s("DEF T Transform { rotation " + textOf(axis) + " " + std::to_string(angle) + " scale " +
                    textOf(scale) + " children Shape { geometry Box { } } } DEF P PointPickSensor { intersectionType " +
                    "\"GEOMETRY\" pickTarget USE T pickingGeometry PointSet { coord Coordinate { point [ " + points +
                    " ] } } }");
        s.scene.newFrame(0);
        const auto& picked = s.node("P").get(x3d::PointPickSensor::pickedPoint);
        ASSERT_TRUE(std::ranges::equal(picked, inside)) << i << ": " << picked.size() << " of " << inside.size();
    }
}

TEST(PickSensors, AReportIsWhatItsNumbersSay) {
    const PickReport report{NodeId{7}, {NodeId{9}, NodeId{8}}, {{{1, 2, 3}, {0, 0, 1}, {.5f, .25f, 0}}}};
    const auto back = PickReport::fromValue(report.toValue());
    ASSERT_TRUE(back);
    EXPECT_EQ(back->sensor, report.sensor);
    EXPECT_EQ(back->geometry, report.geometry);
    ASSERT_EQ(back->surfaces.size(), 1u);
    EXPECT_EQ(back->surfaces[0].texCoord, report.surfaces[0].texCoord);
    EXPECT_FALSE(PickReport::fromValue({}));
    EXPECT_FALSE(PickReport::fromValue({7, 1}));
    EXPECT_FALSE(PickReport::fromValue({7, 0, 1}));
    EXPECT_FALSE(PickReport::fromValue({7, .5, 1}));
    EXPECT_FALSE(PickReport::fromValue({NAN, 0}));
}

TEST(PickSensors, WhatAPeerClaimsDoesNoHarmAndIsCorrectedWhereSomebodyCanLook) {
    PickScene s(
        "DEF G Group { children DEF B Shape { geometry Box { } } } DEF P LinePickSensor { intersectionType "
        "\"GEOMETRY\" pickTarget USE G pickingGeometry LineSet { vertexCount 2 coord Coordinate { point [ 0 0 "
        "9, 0 0 0 ] } } }");
    s.scene.newFrame(0);
    const Node& p = s.node("P");
    using P = x3d::LinePickSensor;
    ASSERT_TRUE(p.get(P::isActive));
    std::mt19937 random(11);
    const double odd[] = {NAN, INFINITY, 0, -0.0, 1, -1, 2, 3, 4, 5, 6, .5, 1e308, -1e308, 4294967295.0, 4294967296.0};
    const std::vector<NodeId> ids{s.scene.root(), p.id(), s.scene.findName("B"), s.scene.findName("G")};
    for (int i = 0; i < 20'000; ++i) {
        Array<double> numbers;
        const std::size_t count = random() % 3 ? 2 + 9 * (random() % 2) + random() % 3 : random() % 40;
        for (std::size_t k = 0; k < count; ++k)
            numbers.push_back(k == 0 || random() % 2 ? double(ids[random() % ids.size()].value)
                                                     : odd[random() % std::size(odd)]);
        ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), x3d::RtsgScene::picked.index, numbers));
        if (i % 3 == 0) s.scene.newFrame(i);
    }
    // Reports come after the picking of that frame: the next look corrects them.
    s.scene.newFrame(30'000);
    s.scene.newFrame(30'001);
    EXPECT_TRUE(p.get(P::isActive));
    ASSERT_EQ(p.get(P::pickedGeometry).size(), 1u);
    EXPECT_EQ(p.get(P::pickedGeometry)[0], s.scene.findName("B"));
    ASSERT_EQ(p.get(P::pickedPoint).size(), 1u);
    EXPECT_EQ(p.get(P::pickedPoint)[0], Vec3f(0, 0, 1));
}

TEST(PickSensors, SayWhatTheyCannotPickBy) {
    PickScene s(
        "DEF B Shape { geometry Box { } } DEF P LinePickSensor { pickTarget USE B pickingGeometry PointSet { } } "
        "DEF Q PrimitivePickSensor { pickTarget USE B pickingGeometry PointSet { } "
        "} DEF V VolumePickSensor { intersectionType \"GEOMETRY\" pickTarget USE B pickingGeometry IndexedFaceSet { } "
        "}");
    s.scene.newFrame(0);
    s.scene.newFrame(1);
    std::string all;
    for (const Diagnostic& d : s.scene.diagnostics().all()) all += d.text + '\n';
    EXPECT_EQ(all,
              "LinePickSensor P: picks nothing by a PointSet\n"
              "PrimitivePickSensor Q: picks nothing by a PointSet\n"
              "VolumePickSensor V: picks nothing by its IndexedFaceSet, which has no corners\n");
    EXPECT_FALSE(s.node("P").get(x3d::LinePickSensor::isActive));
    EXPECT_FALSE(s.node("Q").get(x3d::PrimitivePickSensor::isActive));
    EXPECT_FALSE(s.node("V").get(x3d::VolumePickSensor::isActive));
}

TEST(PickSensors, WhereNothingChangesNothingIsAsked) {
    struct Counting final : SpaceQueries {
        std::size_t asked = 0, hulls = 0;
        std::optional<PointerHit> firstHit(const Vec3d&, const Vec3d&) override { return std::nullopt; }
        std::vector<std::vector<NodeId>> within(const Vec3d&, double) override { return {}; }
        std::vector<Crossing> crossings(const Vec3d&, const Vec3d&, double) override {
            ++asked;
            return {};
        }
        std::vector<ShapeBox> boxes() override { return {}; }
        std::vector<Meeting> meetings(const Vec3d&, double, TriangleTest&) override {
            ++asked;
            return {};
        }
        std::vector<Vec3d> corners(const Node&) override {
            ++hulls;
            return {Vec3d(0), Vec3d(1)};
        }
    } counting;
    PickScene s(
        "DEF B Shape { geometry Box { } } LinePickSensor { intersectionType \"GEOMETRY\" pickTarget USE B "
        "pickingGeometry LineSet { vertexCount 2 coord Coordinate { point [ 0 0 0, 0 0 9 ] } } } "
        "PrimitivePickSensor { intersectionType \"GEOMETRY\" pickTarget USE B pickingGeometry Box { } } "
        "DEF T Transform { children VolumePickSensor { intersectionType \"GEOMETRY\" pickTarget USE B "
        "pickingGeometry IndexedFaceSet { } } }");
    s.scene.setSpaceQueries(&counting);
    for (int t = 0; t < 3; ++t) s.scene.newFrame(t);
    const std::size_t before = counting.asked, hulls = counting.hulls;
    EXPECT_GT(before, 0u);
    for (int t = 3; t < 100; ++t) s.scene.newFrame(t);
    EXPECT_EQ(counting.asked, before);
    EXPECT_GT(hulls, 0u);
    // A sensor that moves looks again; its geometry has not changed.
    ASSERT_TRUE(s.scene.set(s.scene.findName("T"), x3d::Transform::translation, Vec3f(1, 0, 0)));
    for (int t = 100; t < 103; ++t) s.scene.newFrame(t);
    EXPECT_GT(counting.asked, before);
    EXPECT_EQ(counting.hulls, hulls);
}

/// A body below any transform, and what of some triangles it meets in which order, by searches in the body's
/// coordinates.
TEST(PickSensors, BodiesMeetTrianglesWhereANestedSearchSays) {
    constexpr unsigned kSeed = 7;
    SCOPED_TRACE(kSeed);
    std::mt19937 random(kSeed);
    std::uniform_real_distribution<double> any(-2, 2), positive(.4, 2);
    const auto position = [&] { return Vec3d(Vec3f(Vec3d(any(random), any(random), any(random)))); };
    const auto length = [&] { return double(float(positive(random))); };
    std::size_t met = 0, missed = 0;
    for (int i = 0; i < 100; ++i) {
        const Vec3d scale(length(), length(), length()), axis = glm::normalize(position()), move = position();
        const double angle = any(random), a = length(), b = length(), c = length();
        const glm::dmat4 world = glm::translate(glm::dmat4(1), move) * glm::rotate(glm::dmat4(1), angle, axis) *
                                 glm::scale(glm::dmat4(1), scale);
        const glm::dmat4 local = glm::inverse(world);
        std::string geometry, sensor = "PrimitivePickSensor";
        test::Gauge gauge;
        Vec3d from(0);
        std::vector<Vec3d> hull;
        std::string hullText;
        for (int k = 0; k < 7; ++k) hull.push_back(position()), hullText += textOf(hull.back()) + ", ";
        if (i % 5 == 0)
            geometry = "Box { size " + textOf({a, b, c}) + " }", gauge = test::boxGauge(Vec3d(a, b, c) * .5);
        if (i % 5 == 1) geometry = "Sphere { radius " + std::to_string(a) + " }", gauge = test::sphereGauge(a);
        const std::string height = " height " + std::to_string(b) + " }";
        if (i % 5 == 2)
            geometry = "Cylinder { radius " + std::to_string(a) + height, gauge = test::cylinderGauge(a, b / 2);
        if (i % 5 == 3)
            geometry = "Cone { bottomRadius " + std::to_string(a) + height, gauge = test::coneGauge(a, b / 2),
            from.y = b / 2;
        if (i % 5 == 4)
            geometry = "IndexedFaceSet { coord Coordinate { point [ " + hullText + " ] } }",
            gauge = test::hullGauge(hull), sensor = "VolumePickSensor";
        std::string shapes;
        std::vector<std::pair<double, std::string>> expected;
        for (int k = 0; k < 12; ++k) {
            const std::array<Vec3d, 3> t{position() * 2.0, position() * 2.0, position() * 2.0};
            std::array<Vec3d, 3> inBody;
            for (std::size_t v = 0; v < 3; ++v) inBody[v] = local * glm::dvec4(t[v], 1);
            const double depth = test::minOnTriangle(gauge, inBody);
            if (std::abs(depth) < 1e-4) continue;  // texts have six digits
            (depth < 0 ? met : missed) += 1;
            const std::string name = "S" + std::to_string(k);
            shapes += "DEF " + name + " Shape { geometry TriangleSet { coord Coordinate { point [ " + textOf(t[0]) +
                      ", " + textOf(t[1]) + ", " + textOf(t[2]) + " ] } } } ";
            if (depth > 0) continue;
            const Vec3d low = glm::min(glm::min(t[0], t[1]), t[2]), high = glm::max(glm::max(t[0], t[1]), t[2]);
            Vec3d minimum(INFINITY), maximum(-INFINITY);
            for (const Vec3d& p : hull) minimum = glm::min(minimum, p), maximum = glm::max(maximum, p);
            const Vec3d origin = world * glm::dvec4(i % 5 == 4 ? (minimum + maximum) * .5 : from, 1);
            const double distance =
                i % 5 == 4 ? glm::distance(origin, (low + high) * .5) : test::SimpleSpace::distanceTo(t, origin);
            expected.emplace_back(distance, name);
        }
        std::ranges::sort(expected);
        std::ostringstream transform;
        transform.precision(17);
        transform << "Transform { translation " << textOf(move) << " rotation " << textOf(axis) << ' ' << angle
                  << " scale " << textOf(scale) << " children ";
        PickScene s("DEF G Group { children [ " + shapes + "] } " + transform.str() + "DEF P " + sensor +
                    " { intersectionType \"GEOMETRY\" sortOrder \"ALL_SORTED\" pickTarget USE G pickingGeometry " +
                    geometry + " } }");
        s.scene.newFrame(0);
        std::string reported, wanted;
        for (const NodeId id : i % 5 == 4 ? s.node("P").get(x3d::VolumePickSensor::pickedGeometry)
                                          : s.node("P").get(x3d::PrimitivePickSensor::pickedGeometry))
            reported += std::string(s.scene.name(id)) + " ";
        for (const auto& [distance, name] : expected) wanted += name + " ";
        EXPECT_EQ(reported, wanted) << i << ' ' << geometry;
    }
    EXPECT_GT(met, 200u);
    EXPECT_GT(missed, 200u);
}

}  // namespace
}  // namespace rtsg
