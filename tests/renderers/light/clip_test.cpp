// ClipPlanes in pictures: what is cut away and what is not, against trigonometry.
#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

const char* const kEye = "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } ";

/// As a share of the picture.
double lit(const Picture& p, int channel) {
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel[channel];
    return sum / (double(p.width) * p.height);
}

TEST(ClipPlane, CutsAwayWhatLiesBehindIt) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        LightScene s(std::string(kEye) + "ClipPlane { plane .6 .8 0 .5 } " + square(10, unlit("1 1 1")), 200, 200);
        s.options.settings.integrator = integrator;
        // The line .6 x + .8 y = -.5 cuts a corner off the square of 4 m: its ends are at x = -2 and y = -2.
        const double left = (-.5 + .6 * 2) / .8 + 2, below = (-.5 + .8 * 2) / .6 + 2;
        EXPECT_NEAR(lit(s.picture(), 0), 1 - left * below / 2 / 16, .005);
    }
}

TEST(ClipPlane, ConcernsItsSiblingsAndWhatIsBelowThem) {
    const auto strip = [](double y, const char* color) {
        return fmt::format(
            "Transform {{ translation 0 {} 0 children [ Transform {{ scale 1 .25 1 children [ {} ] }} ] }}", y,
            square(2, unlit(color)));
    };
    LightScene s(std::string(kEye) + "Group { children [ DEF CUT ClipPlane { plane 1 0 0 0 } " + strip(1, "1 0 0") +
                     " ] } " + strip(-1, "0 1 0"),
                 200, 200);
    EXPECT_NEAR(lit(s.picture(), 0), .125, .002) << "half of it";
    EXPECT_NEAR(lit(s.picture(), 1), .25, .002) << "all of it";
    ASSERT_TRUE(s.scene.set(s.node("CUT"), x3d::ClipPlane::plane, Vec4f(-1, 0, 0, 1)));
    s.scene.newFrame(1);
    EXPECT_NEAR(lit(s.picture(), 0), .1875, .002) << "three quarters";
    ASSERT_TRUE(s.scene.set(s.node("CUT"), x3d::ClipPlane::enabled, false));
    s.scene.newFrame(2);
    EXPECT_NEAR(lit(s.picture(), 0), .25, .002);
}

TEST(ClipPlane, MovesWithTheTransformAroundIt) {
    LightScene s(std::string(kEye) +
                     "Transform { translation .5 0 0 rotation 0 0 1 3.1415927 scale 2 1 1 children [ ClipPlane { plane "
                     "1 0 0 .25 } " +
                     square(10, unlit("1 1 1")) + " ] }",
                 200, 200);
    // In its own frame x >= -.25: in the world .5 - 2 x, so up to 1.
    EXPECT_NEAR(lit(s.picture(), 0), .75, .003);
}

TEST(ClipPlane, SeveralCutTogether) {
    LightScene s(std::string(kEye) + "ClipPlane { plane 1 0 0 0 } Group { children [ ClipPlane { plane 0 1 0 0 } " +
                     square(10, unlit("1 1 1")) + " ] }",
                 200, 200);
    EXPECT_NEAR(lit(s.picture(), 0), .25, .003);
}

// A ball with its near half cut off is a bowl: its far wall shows, 1 m further away, and in the middle only.
TEST(ClipPlane, ShowsWhatIsWithin) {
    LightScene s(
        std::string(kEye) +
            "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } backMaterial "
            "UnlitMaterial { emissiveColor 0 1 0 } } geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 3 -1 4 "
            "7 6 5 -1 ] coord Coordinate { point [ -1 -1 1, 1 -1 1, 1 1 1, -1 1 1, -1 -1 -1, 1 -1 -1, 1 1 -1, -1 1 -1 "
            "] } } } " +
            "ClipPlane { plane 0 0 -1 0 }",
        100, 100);
    EXPECT_NEAR(lit(s.picture(), 0), 0, 1e-6);
    EXPECT_NEAR(lit(s.picture(), 1), .25, .002);
}

TEST(ClipPlane, LetsLightThroughWhatIsCutAway) {
    for (const bool cut : {false, true})
        for (const char* light :
             {"DirectionalLight { direction 0 0 -1 }", "PointLight { location 0 0 100 radius 1000 }"}) {
            LightScene s(std::string("OrthoViewpoint { position 0 0 1 } ") + light + square(2, matte("1 1 1")) +
                         "Group { children [ Transform { translation 0 0 2 children [ " + square(2, unlit("1 1 1")) +
                         " ] } " + (cut ? "ClipPlane { plane 1 0 0 -.5 }" : "") + " ] }");
            EXPECT_EQ(s.center().r > .9f, cut) << light;
        }
}

TEST(ClipPlane, CutsLinesAndIsSeenInMirrors) {
    LightScene s(
        "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] position 0 0 1 } " + square(10, mirror("1")) +
            "Group { children [ ClipPlane { plane 1 0 0 0 } Transform { translation 0 0 2 children [ Shape { "
            "appearance Appearance { " +
            unlit("1 1 1") +
            " lineProperties LineProperties { linewidthScaleFactor 10 } } geometry IndexedLineSet { coordIndex [ 0 1 ] "
            "coord Coordinate { point [ -1 0 0, 1 0 0 ] } } } ] } ] }",
        200, 200);
    EXPECT_NEAR(lit(s.picture(), 0) * 200 * 200, 500 + kPi * 12.5, 12);
}

}  // namespace
}  // namespace rtsg
