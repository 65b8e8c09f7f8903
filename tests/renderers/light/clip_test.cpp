// ClipPlanes in pictures: what is cut away and what is not, against trigonometry.
#include <algorithm>
#include <array>

#include <rtsg/core/x3d.h>

#include <rtsg/renderers/picking.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

const char* const kEye = "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } ";

/// The lit share of the picture.
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

TEST(ClipPlane, KeepsWhatLiesOnIt) {
    // Half of its rays end a rounding behind the plane: it is all there, or it is speckled.
    for (const char* round : {"0 1 0 0", "1 0 0 .4", "0 1 0 .6435", ".6 .8 0 .7"}) {
        const auto cut = [&](const char* plane) {
            return fmt::format(
                "Viewpoint {{ position 0 0 40 fieldOfView .1 }} Transform {{ translation .3 .1 -7 rotation {} children "
                "[ {} {} ] }}",
                round, plane, square(20, unlit("1 1 1")));
        };
        EXPECT_EQ(lit(LightScene(cut("ClipPlane { plane 0 0 -1 0 }"), 100, 100).picture(), 0), 1) << round;
        EXPECT_EQ(lit(LightScene(cut("ClipPlane { plane 0 0 1 0 }"), 100, 100).picture(), 0), 1) << round;
        EXPECT_EQ(lit(LightScene(cut("ClipPlane { plane 0 0 1 -.001 }"), 100, 100).picture(), 0), 0) << round;
    }
}

// ---- Viewports among children -------------------------------------------------------------------------------------

/// Left, right, top and bottom of the pixels that are red, the last ones not included; all of which must be.
std::array<int, 4> redRectangle(const Picture& p) {
    std::array<int, 4> edges{p.width, 0, p.height, 0};
    int count = 0;
    for (int y = 0; y < p.height; ++y)
        for (int x = 0; x < p.width; ++x) {
            if (!(p.at(x, y).r > .5f)) continue;
            ++count;
            edges = {std::min(edges[0], x), std::max(edges[1], x + 1), std::min(edges[2], y),
                     std::max(edges[3], y + 1)};
        }
    EXPECT_EQ(count, std::max(0, edges[1] - edges[0]) * std::max(0, edges[3] - edges[2]));
    return edges;
}

TEST(ViewportGroup, CutsWhatItGroupsAtSharesOfThePicture) {
    using Edges = std::array<int, 4>;
    const std::string wall = "Transform { rotation 0 1 0 .4 children [ " + square(100, unlit("1 0 0")) + " ] }";
    const char* const eyes[] = {
        "Viewpoint { position 1 2 10 orientation .28 .96 0 .2 } ",
        "OrthoViewpoint { position 1 2 10 orientation .28 .96 0 .2 fieldOfView [ -3 -2 3 2 ] } "};
    for (const char* const eye : eyes)
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            SCOPED_TRACE(eye);
            LightScene s(std::string(eye) +
                             "DEF OUTER Group { children DEF V Viewport { clipBoundary [ .25 .75 .5 1 ] "
                             "children [ DEF WALL " +
                             wall + " ] } }",
                         80, 40);
            s.options.settings.integrator = integrator;
            EXPECT_EQ(redRectangle(s.picture()), (Edges{20, 60, 0, 20}));
            ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewport::clipBoundary, Array<float>{.5f, 1, 0, .25f}));
            s.scene.newFrame(1);
            EXPECT_EQ(redRectangle(s.picture()), (Edges{40, 80, 30, 40}));
            // Within another one.
            const NodeId other = s.scene.createNode(x3d::Viewport::type);
            ASSERT_TRUE(s.scene.set(other, x3d::Viewport::clipBoundary, Array<float>{0, .75f, 0, 1}));
            ASSERT_TRUE(s.scene.insertChild(s.node("OUTER"), x3d::Group::children, other));
            ASSERT_TRUE(s.scene.removeChild(s.node("OUTER"), x3d::Group::children.index, 0));
            ASSERT_TRUE(s.scene.insertChild(other, x3d::Viewport::children, s.node("V")));
            s.scene.newFrame(2);
            EXPECT_EQ(redRectangle(s.picture()), (Edges{40, 60, 30, 40}));
            // Things that enter it and leave it.
            ASSERT_TRUE(s.scene.removeChild(s.node("V"), x3d::Viewport::children.index, 0));
            s.scene.newFrame(3);
            EXPECT_EQ(lit(s.picture(), 0), 0);
            ASSERT_TRUE(s.scene.insertChild(other, x3d::Viewport::children, s.node("WALL")));
            s.scene.newFrame(4);
            EXPECT_EQ(redRectangle(s.picture()), (Edges{0, 60, 0, 40}));
            ASSERT_TRUE(s.scene.insertChild(s.node("OUTER"), x3d::Group::children, s.node("WALL")));
            s.scene.newFrame(5);
            EXPECT_EQ(redRectangle(s.picture()), (Edges{0, 80, 0, 40})) << "once more beside it";
            EXPECT_TRUE(s.world->diagnostics().all().empty());
        }
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

// ---- caps ---------------------------------------------------------------------------------------------------------

/// A box of this many metres about the origin.
std::string boxOf(double side, const std::string& material) {
    return fmt::format("Shape {{ appearance Appearance {{ {0} }} geometry Box {{ size {1} {1} {1} }} }} ", material,
                       side);
}

struct ClipCaps : testing::TestWithParam<Integrator> {
    /// The eye looks along -z at a square of 4 m.
    Picture capped(const std::string& content, bool caps = true) {
        LightScene s(std::string(kEye) + content, 200, 200);
        s.options.settings.integrator = GetParam();
        s.options.settings.caps = caps;
        return s.picture();
    }
};
INSTANTIATE_TEST_SUITE_P(Integrators, ClipCaps, testing::Values(Integrator::whitted, Integrator::path));

TEST_P(ClipCaps, FillClosedBodiesAndNothingElse) {
    const std::string cut = "ClipPlane { plane 0 0 -1 0 } ";
    EXPECT_NEAR(lit(capped(cut + boxOf(2, unlit("1 0 0")), false), 0), 0, 1e-6) << "one looks through backs";
    EXPECT_NEAR(lit(capped(cut + boxOf(2, unlit("1 0 0"))), 0), .25, .002);
    const std::string open =
        "Shape { appearance Appearance { " + unlit("1 0 0") + " } geometry Cylinder { top FALSE } }";
    EXPECT_NEAR(lit(capped(cut + open), 0), 0, 1e-6) << "it has no inside";
    EXPECT_NEAR(lit(capped(cut + square(1, unlit("1 0 0"))), 0), .25, .002) << "which lies on the plane";
    EXPECT_NEAR(lit(capped("ClipPlane { plane 0 0 -.5 -.75 } " + boxOf(2, unlit("1 0 0"))), 0), 0, 1e-6)
        << "nothing is left";
    EXPECT_NEAR(lit(capped("Group { children [ " + cut + "] } " + boxOf(2, unlit("1 0 0"))), 0), .25, .002)
        << "out of its scope, and whole";
}

TEST_P(ClipCaps, AreLitAsThePlaneLies) {
    // The light comes along -z and meets the cap at 36.87 degrees: .8 of what it gives head-on.
    const std::string scene =
        "DirectionalLight { direction 0 0 -1 } NavigationInfo { headlight FALSE } Transform { "
        "translation .2 -.1 0 rotation 0 1 0 .6435011 children [ ClipPlane { plane 0 0 -1 0 } " +
        boxOf(2, matte(".5 .5 .5")) + " ] }";
    LightScene s("OrthoViewpoint { fieldOfView [ -.1 -.1 .1 .1 ] } " + scene, 16, 16);
    s.options.settings.integrator = GetParam();
    s.options.settings.colorSpace = ColorSpace::linear;
    s.options.settings.caps = true;
    EXPECT_NEAR(s.center().r, .8 * linearFromSrgb(Vec3f(.5f)).r, .002);
}

TEST_P(ClipCaps, OfTheInnermostOfSeveralBodiesIsSeen) {
    const std::string both = boxOf(2, unlit("1 0 0")) + boxOf(1, unlit("0 1 0"));
    const Picture inBoth = capped("ClipPlane { plane 0 0 -1 0 } " + both);
    EXPECT_NEAR(lit(inBoth, 1), .0625, .002);
    EXPECT_NEAR(lit(inBoth, 0), .1875, .002);
    // A body that is whole stands out of the cap of one around it.
    const Picture whole = capped("Group { children [ ClipPlane { plane 0 0 -1 0 } " + boxOf(2, unlit("1 0 0")) +
                                 "] } " + boxOf(1, unlit("0 1 0")));
    EXPECT_NEAR(lit(whole, 1), .0625, .002);
    EXPECT_NEAR(lit(whole, 0), .1875, .002);
    // One in front of the plane is no part of the body behind it, and hides the cap.
    const Picture before =
        capped("ClipPlane { plane 0 0 -1 0 } " + boxOf(2, unlit("1 0 0")) +
               "Group { children [ Transform { translation 0 0 5 children [ " + boxOf(1, unlit("0 1 0")) + " ] } ] } ");
    EXPECT_NEAR(lit(before, 1), 0, 1e-6) << "it is cut away itself";
    EXPECT_NEAR(lit(before, 0), .25, .002);
}

TEST_P(ClipCaps, LeaveHolesOpen) {
    // A box with a hollow in one mesh, the hollow's walls facing inwards: one looks at the hollow's far wall.
    const char* const hollow =
        "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 1 1 } } geometry IndexedFaceSet { "
        "colorPerVertex FALSE color Color { color [ 1 0 0, 0 1 0 ] } colorIndex [ 0 0 0 0 0 0 1 1 1 1 1 1 ] "
        "coordIndex [ 0 1 2 3 -1 7 6 5 4 -1 0 4 5 1 -1 1 5 6 2 -1 2 6 7 3 -1 3 7 4 0 -1 "
        "11 10 9 8 -1 12 13 14 15 -1 9 13 12 8 -1 10 14 13 9 -1 11 15 14 10 -1 8 12 15 11 -1 ] "
        "coord Coordinate { point [ -1 -1 1, 1 -1 1, 1 1 1, -1 1 1, -1 -1 -1, 1 -1 -1, 1 1 -1, -1 1 -1, "
        "-.5 -.5 .5, .5 -.5 .5, .5 .5 .5, -.5 .5 .5, -.5 -.5 -.5, .5 -.5 -.5, .5 .5 -.5, -.5 .5 -.5 ] } } } ";
    const Picture p = capped(std::string("ClipPlane { plane 0 0 -1 0 } ") + hollow);
    // The cap has the material's colour, white, and not those of faces.
    EXPECT_NEAR(lit(p, 2), .1875, .002);
    EXPECT_NEAR(lit(p, 1) - lit(p, 2), .0625, .002) << "the hollow's green wall";
    EXPECT_NEAR(lit(p, 0), lit(p, 2), 1e-6) << "nothing of the red outside is left in sight";
}

TEST_P(ClipCaps, AreCutByOtherPlanes) {
    EXPECT_NEAR(lit(capped("ClipPlane { plane 0 0 -1 0 } ClipPlane { plane 1 0 0 .5 } " + boxOf(2, unlit("1 0 0"))), 0),
                .75 * .25, .003);
    // Two planes leave a sheet of which no face of the box is left in sight.
    EXPECT_NEAR(
        lit(capped("ClipPlane { plane 0 0 -1 .1 } ClipPlane { plane 0 0 1 .1 } " + boxOf(2, unlit("1 0 0"))), 0), .25,
        .002);
    // The same plane twice is one.
    EXPECT_NEAR(
        lit(capped("ClipPlane { plane 0 0 -1 .1 } ClipPlane { plane 0 0 -1 .1 } " + boxOf(2, unlit("1 0 0"))), 0), .25,
        .002);
}

TEST_P(ClipCaps, ThrowShadowsAndLetLightThrough) {
    const auto below = [&](bool caps, const std::string& material) {
        LightScene s(
            "OrthoViewpoint { position 0 0 -1 fieldOfView [ -1 -1 1 1 ] } NavigationInfo { headlight FALSE } "
            "DirectionalLight { direction 0 0 -1 } Transform { translation 0 0 -2 children [ " +
                square(8, matte("1 1 1")) +
                " ] } Group { children [ ClipPlane { plane 0 0 -1 .1 } ClipPlane { plane 0 0 1 .1 } " +
                boxOf(2, material) + " ] }",
            16, 16);
        s.options.settings.integrator = GetParam();
        s.options.settings.caps = caps;
        return linearFromSrgb(Vec3f(s.center())).r;
    };
    EXPECT_GT(below(false, matte("1 1 1")), .9f);
    EXPECT_EQ(below(true, matte("1 1 1")), 0);
}

TEST_P(ClipCaps, AreThoseOfTheirBodiesWhateverTouchesThemBehind) {
    // Behind the two that are cut lies a third, back to back, so that a ray from a cap leaves one body where it comes
    // into another.
    const auto at = [](const char* position, const char* color) {
        return fmt::format("Transform {{ translation {} children {} }} ", position, boxOf(2, unlit(color)));
    };
    for (const char* round : {"0", ".4", "1.1", "2.3"}) {
        LightScene s(fmt::format("OrthoViewpoint {{ fieldOfView [ -2 -2 2 2 ] }} ClipPlane {{ plane 0 0 -1 0 }} "
                                 "Transform {{ rotation 0 0 1 {} children [ {} {} {} ] }}",
                                 round, at("-1 0 0", "1 0 0"), at("1 0 0", "0 1 0"), at("0 0 -2", "0 0 1")),
                     64, 64);
        s.options.settings.integrator = GetParam();
        s.options.settings.caps = true;
        const Picture p = s.picture();
        int others = 0;
        for (int y = 22; y < 42; ++y)
            for (int x = 22; x < 42; ++x) {
                const Vec3f color(p.at(x, y));
                others += color != Vec3f(1, 0, 0) && color != Vec3f(0, 1, 0);
            }
        EXPECT_EQ(others, 0) << round;
    }
}

TEST_P(ClipCaps, StayInPlaceFarFromTheOrigin) {
    const auto there = [&](double far, const std::string& what) {
        return fmt::format(
            "OrthoViewpoint {{ fieldOfView [ -2 -2 2 2 ] position {0} {0} {1} }} Transform {{ "
            "translation {0} {0} {0} children [ ClipPlane {{ plane 0 0 -1 0 }} {2} ] }}",
            far, far + 10, what);
    };
    for (const double far : {0., 1e4, 1e6}) {
        LightScene s(there(far, boxOf(2, unlit("1 0 0"))), 100, 100);
        s.options.settings.integrator = GetParam();
        s.options.settings.caps = true;
        EXPECT_NEAR(lit(s.picture(), 0), .25, .01) << far;
    }
}

TEST(ClipPlane, WhatIsCutAwayIsNotPickedInAPicture) {
    LightScene s(
        "ClipPlane { plane 0 0 -1 1.5 } Transform { translation 0 0 3 children DEF NEAR Shape { geometry Box { } } "
        "} DEF FAR Shape { geometry Box { } }");
    s.picture();
    const Picker picker(s.world->rays(), s.world->flattener());
    const LightTracer& tracer = s.light->tracer();
    const auto camera = tracer.camera(s.world->rays(), 1);
    ASSERT_TRUE(camera);
    const auto views = tracer.layers(s.world->rays(), *camera, 100, 100);
    const auto seen = tracer.pick(picker, s.world->rays(), views, 50.5, 50.5);
    ASSERT_TRUE(seen && *seen);
    EXPECT_EQ(seen->shape, s.node("FAR"));
    const auto there = LightTracer::pick(picker, views, 50.5, 50.5);
    ASSERT_TRUE(there && *there);
    EXPECT_EQ(there->shape, s.node("NEAR"));
}

TEST(LeftOut, IsToldOnceWithItsPlace) {
    const auto reported = [](const std::string& body) {
        LightScene s(body);
        s.picture();
        s.picture();
        std::vector<std::string> all;
        for (const Diagnostic& d : s.light->diagnostics().all()) {
            EXPECT_GT(d.where.line, 0u) << d.text;
            all.push_back(d.text);
        }
        return all;
    };
    const auto expect = [&](const std::string& body, const char* words) {
        const auto all = reported(body);
        ASSERT_EQ(all.size(), 1u) << body;
        EXPECT_NE(all[0].find(words), std::string::npos) << all[0];
    };
    const auto line = [](int type) {
        return fmt::format(
            "Shape {{ appearance Appearance {{ lineProperties LineProperties {{ linetype {} }} }} geometry "
            "LineSet {{ vertexCount 2 coord Coordinate {{ point [ 0 0 0, 1 0 0 ] }} }} }}",
            type);
    };
    expect(line(6), "linetype 6");
    EXPECT_TRUE(reported(line(5)).empty());
    expect("Background { skyColor [ 1 0 0, 0 1 0 ] skyAngle [ .5 1 ] }", "skyColor has 2 colours");
    expect("Background { groundAngle .5 groundColor 1 0 0 }", "groundColor has 1 colours");
    EXPECT_TRUE(
        reported("Background { skyColor [ 1 0 0, 0 1 0 ] skyAngle 1 groundAngle 1 groundColor [ 1 0 0, 0 1 0 ] }")
            .empty());
    expect(
        "Shape { appearance Appearance { texture ComposedCubeMapTexture { frontTexture PixelTexture { image 1 1 1 255 "
        "} "
        "} } geometry Box { } }",
        "no backTexture, leftTexture");
}

}  // namespace
}  // namespace rtsg
