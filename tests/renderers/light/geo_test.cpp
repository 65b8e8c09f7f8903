// Geospatial nodes as they are drawn and picked: against their coordinates in double precision, metre by metre.
#include <algorithm>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/tessellate.h>

#include "light_scene.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;

GeoSystem wgs84() {
    return {};
}

/// Where an instance's vertices are.
std::vector<Vec3d> corners(const RayInstance& instance) {
    std::vector<Vec3d> all;
    for (std::size_t i = 0; i < instance.mesh->positions.size(); ++i)
        all.push_back(instance.info.worldFromLocal * glm::dvec4(Vec3d(instance.mesh->positions[i]), 1));
    return all;
}
std::vector<Vec3d> onlyCorners(const RayWorld& world) {
    for (const RayInstance& i : world.instances())
        if (i.info.id && i.mesh) return corners(i);
    return {};
}
void expectCorners(const std::vector<Vec3d>& seen, const std::vector<Vec3d>& expected, double tolerance) {
    ASSERT_EQ(seen.size(), expected.size());
    for (std::size_t i = 0; i < seen.size(); ++i)
        EXPECT_LE(glm::length(seen[i] - expected[i]), tolerance) << "corner " << i;
}

constexpr const char* kAbove = "GeoViewpoint { position 46.0005 7.0005 900 orientation 1 0 0 -1.5707963 }";

std::string triangle(const char* coordinates) {
    return std::string(kAbove) + "Shape { geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 -1 ] coord DEF C " +
           coordinates + " } }";
}

TEST(Geo, CoordinatesKeepTheirMillimetres) {
    // A triangle of centimetres, six thousand kilometres from the origin.
    LightScene s(triangle("GeoCoordinate { point [ 46 7 400, 46 7.0000001 400, 46.0000001 7 400.01 ] }"));
    std::vector<Vec3d> expected = {wgs84().toGeocentric({46, 7, 400}), wgs84().toGeocentric({46, 7.0000001, 400}),
                                   wgs84().toGeocentric({46.0000001, 7, 400.01})};
    expectCorners(onlyCorners(s.world->rays()), expected, 1e-8);
    // The first point is what the others lie around: all go with it.
    ASSERT_TRUE(s.scene.set(s.node("C"), x3d::GeoCoordinate::point,
                            Array<Vec3d>{{-10, 100, 5}, {-10, 100.0000001, 5}, {-10.0000001, 100, 5}}));
    s.scene.newFrame(1);
    expected = {wgs84().toGeocentric({-10, 100, 5}), wgs84().toGeocentric({-10, 100.0000001, 5}),
                wgs84().toGeocentric({-10.0000001, 100, 5})};
    expectCorners(onlyCorners(s.world->rays()), expected, 1e-8);
}

TEST(Geo, UtmAndUsedGeometryStandWhereTheyShould) {
    LightScene s(
        std::string(kAbove) +
        "Shape { geometry DEF G IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 -1 ] coord GeoCoordinate { "
        "geoSystem [ \"UTM\" \"Z32\" ] point [ 5095000 345000 400, 5095000 345001 400, 5095001 345000 400 ] } } }"
        "Transform { translation 1 2 3 children Shape { geometry USE G } }");
    GeoSystem utm;
    utm.kind = GeoSystem::Kind::utm, utm.zone = 32;
    const std::vector<Vec3d> expected = {utm.toGeocentric({5095000, 345000, 400}),
                                         utm.toGeocentric({5095000, 345001, 400}),
                                         utm.toGeocentric({5095001, 345000, 400})};
    // One where its coordinates are, one moved by the Transform.
    std::vector<Vec3d> moved = expected;
    for (Vec3d& p : moved) p += Vec3d(1, 2, 3);
    std::size_t here = 0, there = 0;
    for (const RayInstance& i : s.world->rays().instances()) {
        if (!i.info.id || !i.mesh) continue;
        const bool isMoved = glm::length(corners(i)[0] - expected[0]) > 1;
        expectCorners(corners(i), isMoved ? moved : expected, 2e-7);
        ++(isMoved ? there : here);
    }
    EXPECT_EQ(here, 1u);
    EXPECT_EQ(there, 1u);
}

constexpr const char* kGrid =
    "Shape { geometry DEF E GeoElevationGrid { geoGridOrigin 46 7 400 xDimension 3 zDimension 4 xSpacing .0001 "
    "zSpacing .0002 yScale 2 height [ 0 1 2, 3 4 5, 6 7 8, 9 10 11 ] } }";

TEST(Geo, AGridGoesEastAndNorthAndUp) {
    LightScene s(std::string(kAbove) + kGrid);
    std::vector<Vec3d> expected;
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 3; ++i)
            expected.push_back(wgs84().toGeocentric({46 + j * .0002, 7 + i * .0001, 400. + 2 * (3 * j + i)}));
    expectCorners(onlyCorners(s.world->rays()), expected, 4e-6);  // single precision within 70 m
    const auto mesh = tessellate(s.scene, s.node("E"));
    ASSERT_TRUE(mesh);
    ASSERT_EQ((*mesh)->triangleCount, 12u);
    const Vec3d up = wgs84().frameAt(expected[0])[1];
    for (std::uint32_t t = 0; t < 12; ++t) {
        EXPECT_GT(glm::dot(Vec3d((*mesh)->geometricNormal(t)), up), 0) << t;
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint32_t v = (*mesh)->vertexIndex(t, c);
            const Vec4f st = (*mesh)->texCoord(t, c == 1, c == 2, 0);
            EXPECT_NEAR(st.x, (v % 3) / 2., 1e-6);
            EXPECT_NEAR(st.y, (v / 3) / 3., 1e-6);
        }
    }
    ASSERT_TRUE(s.scene.sendEvent(s.node("E"), x3d::GeoElevationGrid::set_height.index,
                                  Value(Array<double>{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0})));
    s.scene.newFrame(1);
    for (std::size_t i = 0; i < expected.size(); ++i)
        expected[i] = wgs84().toGeocentric({46 + double(i / 3) * .0002, 7 + double(i % 3) * .0001, 400});
    expectCorners(onlyCorners(s.world->rays()), expected, 4e-6);
}

TEST(Geo, GridsSayWhatTheyLack) {
    const auto complaint = [](const std::string& fields) {
        LightScene s(std::string(kAbove) + "Shape { geometry DEF E GeoElevationGrid { xDimension 2 " +
                     (fields.find("zDimension") == fields.npos ? "zDimension 3 " : "") + fields + " } }");
        const auto mesh = tessellate(s.scene, s.node("E"));
        std::string text;
        for (const Diagnostic& d : (*mesh)->diagnostics.all()) text += d.text;
        return text + " " + std::to_string((*mesh)->triangleCount);
    };
    EXPECT_NE(complaint("height [ 1 2 3 4 5 ]").find("the others are 0"), std::string::npos);
    EXPECT_TRUE(complaint("height [ 1 2 3 4 5 ]").ends_with(" 4"));
    EXPECT_TRUE(complaint("height [ ]").ends_with(" 4"));
    const std::string large = complaint("height [ 1 2 3 4 5 ] zDimension 2000000000");
    EXPECT_NE(large.find("only complete rows"), std::string::npos) << large;
    EXPECT_TRUE(large.ends_with(" 2")) << large;
    EXPECT_NE(complaint("height [ 1 2 3 4 5 6 ] geoSystem \"GC\"").find("GC"), std::string::npos);
    EXPECT_NE(complaint("height [ 1 2 3 4 5 6 ] geoSystem \"UTM\"").find("zone"), std::string::npos);
    EXPECT_EQ(complaint("height [ 1 2 3 4 5 6 ]"), " 4");
}

TEST(Geo, PlacesSayWhatTheyLack) {
    LightScene s(std::string(kAbove) + "DEF L GeoLocation { geoSystem [ \"UTM\" ] } GeoLocation { geoCoords 1 2 3 }");
    std::string text;
    const Diagnostics reported = s.world->diagnostics();
    for (const Diagnostic& d : reported.all()) text += d.text + "\n";
    EXPECT_EQ(text, "GeoLocation L: geoSystem: UTM needs a zone, \"Z1\" to \"Z60\": it stays where it is\n");
}

// Picture, pick and full traversal: a red square of a metre lies in the middle of what is seen from above.
TEST(Geo, IsSeenAndPickedFromAbove) {
    LightScene s(
        "GeoViewpoint { position 46 7 500 orientation 1 0 0 -1.5707963 fieldOfView .02 }"
        "GeoLocation { geoCoords 46 7 490 children Transform { rotation 1 0 0 -1.5707963 children " +
            square(.05, unlit("1 0 0")) + " } }" + kGrid,
        64, 64);
    const Picture p = s.picture();
    // .1 m wide at 10 m, where the picture is 2 * 10 * tan(.01) wide.
    int red = 0;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) red += p.at(x, y).r > .9f && p.at(x, y).g < .1f;
    const double side = .1 / (20 * std::tan(.01)) * 64;
    EXPECT_NEAR(red, side * side, 2 * side);
    EXPECT_GT(p.at(32, 32).r, .9f);
    const Vec3d eye = wgs84().toGeocentric({46, 7, 500}), up = wgs84().frameAt(eye)[1];
    const auto pick = Picker(s.world->rays(), s.world->flattener()).ray(eye, -up);
    ASSERT_TRUE(pick && *pick);
    EXPECT_NEAR(pick->distance, 10, 1e-4);
    FullTraversalRenderer full;
    ASSERT_TRUE(full.attachToScene(s.scene));
    ASSERT_TRUE(full.renderFrame());
    std::vector<Vec3d> ours, theirs;
    for (const RayInstance& i : s.world->rays().instances())
        if (i.info.id && i.mesh) std::ranges::copy(corners(i), std::back_inserter(ours));
    for (const RayInstance& i : full.world().instances())
        if (i.info.id && i.mesh) std::ranges::copy(corners(i), std::back_inserter(theirs));
    const auto less = [](const Vec3d& a, const Vec3d& b) { return std::pair(a.x, a.y) < std::pair(b.x, b.y); };
    std::ranges::sort(ours, less);
    std::ranges::sort(theirs, less);
    EXPECT_EQ(ours.size(), 16u);
    expectCorners(ours, theirs, 0);
}

// An edited scene looks the same as a new world of it.
TEST(Geo, EditsLeadToWhatANewWorldShows) {
    LightScene s(std::string(kAbove) +
                 "DEF L GeoLocation { geoCoords 46 7 400 geoOrigin DEF O GeoOrigin { geoCoords 46 7 300 } children "
                 "DEF T GeoTransform { geoCenter 46 7 0 geoOrigin USE O children Shape { geometry IndexedFaceSet { "
                 "coordIndex [ 0 1 2 -1 ] coord DEF C GeoCoordinate { geoOrigin USE O point [ 46 7 1, 46 7.1 1, 46.1 7 "
                 "1 ] } } } } }");
    const auto check = [&](const char* what) {
        s.scene.seal();
        SharedWorld fresh(s.scene);
        const auto ours = onlyCorners(s.world->rays()), theirs = onlyCorners(fresh.rays());
        ASSERT_EQ(ours.size(), 3u) << what;
        expectCorners(ours, theirs, 0);
        return;
    };
    check("at first");
    ASSERT_TRUE(s.scene.set(s.node("L"), x3d::GeoLocation::geoCoords, Vec3d(45, 8, 10)));
    check("geoCoords");
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::GeoTransform::translation, Vec3f(0, 100, 0)));
    check("translation");
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::GeoTransform::geoCenter, Vec3d(46.1, 7, 0)));
    check("geoCenter");
    ASSERT_TRUE(s.scene.set(s.node("C"), x3d::GeoCoordinate::point, Array<Vec3d>{{1, 2, 3}, {1, 2.1, 3}, {1.1, 2, 3}}));
    check("points");
    ASSERT_TRUE(s.scene.set(s.node("O"), x3d::GeoOrigin::geoCoords, Vec3d(46, 7.5, 200)));
    check("the origin");
}

// A GeoOrigin at the top of a file has no parent that it could move.
TEST(Geo, OriginThatNothingHoldsMovesNothing) {
    LightScene s("Shape { geometry Box { } }", 9, 9);
    const NodeId origin = s.scene.createNode(x3d::GeoOrigin::type);
    ASSERT_TRUE(s.scene.insertChild(s.scene.root(), x3d::RtsgScene::children, origin));
    s.scene.newFrame(1);
    const Vec3f before = s.center();
    ASSERT_TRUE(s.scene.set(origin, x3d::GeoOrigin::geoCoords, Vec3d(46, 7.5, 200)));
    s.scene.newFrame(2);
    EXPECT_EQ(s.world->failure(), "");
    EXPECT_EQ(s.center(), before);
}

}  // namespace
}  // namespace rtsg
