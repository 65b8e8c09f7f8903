// Shadows and sides: what blocks light, what lets it through, and which side of a surface is lit.
#include <rtsg/renderers/light_tracer.h>

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

TEST(LightTracer, ShadowEdgeLiesWhereGeometrySaysItDoes) {
    // Light at 45 degrees; the blocker's edge at x = 0, one metre up, throws its shadow's edge to x = 1.
    const std::string blocker =
        "Shape { appearance Appearance { material Material { } } geometry IndexedFaceSet { solid FALSE coordIndex [0 1 "
        "2 3 -1] "
        "coord Coordinate { point [-9 -9 1, 0 -9 1, 0 9 1, -9 9 1] } } }";
    LightScene s("OrthoViewpoint { position 0 0 0.5 fieldOfView [-2 -2 2 2] } DirectionalLight { direction 1 0 -1 }" +
                     blocker + square(100, matte("1 1 1")),
                 400, 4);
    s.options.settings.height = 400;
    const Picture p = s.picture();
    for (int x = 0; x < 400; ++x) {
        const double at = -2 + 4 * (x + 0.5) / 400;
        ASSERT_NEAR(p.at(x, 200).r, at < 1 ? 0 : std::sqrt(0.5), 1e-6) << at;
    }
}

TEST(LightTracer, AllThreeLightsCastShadows) {
    const std::string lights[] = {"DirectionalLight { global TRUE direction 0 0 -1 }", "PointLight { location 0 0 9 }",
                                  "SpotLight { location 0 0 9 direction 0 0 -1 }"};
    const std::string ball =
        "Transform { translation 0 0 2 children Shape { DEF_ appearance Appearance { material Material { } } geometry "
        "Sphere { radius 0.5 } } }";
    for (const std::string& light : lights) {
        std::string body = "Viewpoint { position 0 0 1 }" + light + square(100, matte("1 1 1")) + ball;
        body.replace(body.find("DEF_ "), 5, "");
        LightScene s(body);
        EXPECT_EQ(s.center(), Vec3f(0)) << light;
        s.options.settings.shadows = Shadows::none;
        EXPECT_GT(s.center().r, 0.9f) << light;
        s.options.settings.shadows = Shadows::authored;
        EXPECT_GT(s.center().r, 0.9f) << "shadows FALSE by default: " << light;
    }
}

TEST(LightTracer, ShadowFieldsAreObeyed) {
    const auto lit = [](const std::string& light, const std::string& shape, Shadows shadows) {
        LightScene s("Viewpoint { position 0 0 1 }" + light + square(100, matte("1 1 1")) +
                     "Transform { translation 0 0 2 children Shape { " + shape + " geometry Sphere { radius 0.5 } } }");
        s.options.settings.shadows = shadows;
        return s.center().r;
    };
    const std::string opaque = "appearance Appearance { material Material { } }";
    EXPECT_EQ(lit("PointLight { location 0 0 9 shadows TRUE }", opaque, Shadows::authored), 0);
    EXPECT_NEAR(lit("PointLight { location 0 0 9 shadows TRUE shadowIntensity 0.75 }", opaque, Shadows::authored), 0.25,
                1e-6);
    EXPECT_NEAR(lit("PointLight { location 0 0 9 }", opaque + " castShadow FALSE", Shadows::all), 1, 1e-6);
    EXPECT_NEAR(lit("PointLight { location 0 0 9 }", "appearance Appearance { material Material { transparency 0.5 } }",
                    Shadows::all),
                0.25, 1e-5)
        << "through front and back of the ball";
    EXPECT_NEAR(lit("PointLight { location 0 0 1.9 }", opaque, Shadows::all), 0, 0) << "a lamp within the ball";
    EXPECT_NEAR(lit("PointLight { location 0 0 1.4 }", opaque, Shadows::all), 1, 1e-6)
        << "what lies beyond the light casts none";
}

TEST(LightTracer, ShadowsFalseCountsWhereAnyLightSaysTrue) {
    // Red from the left with the field TRUE or absent, green from the right with it FALSE: each has its own shadow of
    // the ball, of which the middle of the picture lies in both.
    const auto lit = [](const char* red, Shadows shadows) {
        LightScene s(fmt::format("Viewpoint {{ position 0 0 1 }} PointLight {{ location 0 0 9 color 1 0 0 {} }} "
                                 "PointLight {{ location 0 0 9 color 0 1 0 shadows FALSE }}",
                                 red) +
                     square(100, matte("1 1 1")) +
                     "Transform { translation 0 0 2 children Shape { appearance Appearance { material Material { } } "
                     "geometry Sphere { radius 0.5 } } }");
        s.options.settings.shadows = shadows;
        return s.center();
    };
    EXPECT_EQ(lit("shadows TRUE", Shadows::automatic), Vec3f(0, 1, 0));
    EXPECT_EQ(lit("", Shadows::automatic), Vec3f(0));
    EXPECT_EQ(lit("shadows TRUE", Shadows::all), Vec3f(0));
    EXPECT_EQ(lit("shadows TRUE", Shadows::none), Vec3f(1, 1, 0));
    EXPECT_EQ(lit("", Shadows::authored), Vec3f(1, 1, 0));
}

// Vertex colours whose alpha is a half let half of the light through, though no material is see-through.
TEST(LightTracer, OnlyWhatALightReachesByItsScopeCastsItsShadow) {
    // 17.3.1 speaks of shadows "behind illuminated X3DShapeNode geometry". The ball is between lamp and floor.
    const std::string floor = square(100, matte("1 1 1"));
    const auto ball = [](const char* shape = "appearance Appearance { material Material { } }") {
        return fmt::format("Transform {{ translation 0 0 2 children Shape {{ {} geometry Sphere {{ radius .5 }} }} }}",
                           shape);
    };
    const auto lit = [](const std::string& body, Integrator integrator) {
        LightScene s("Viewpoint { position 0 0 1 } NavigationInfo { headlight FALSE } " + body);
        s.options.settings.shadows = Shadows::all, s.options.settings.integrator = integrator;
        s.options.settings.colorSpace = ColorSpace::linear;
        return s.center().r;
    };
    const std::string lamp = "PointLight { location 0 0 9 global FALSE } ",
                      sun = "DirectionalLight { direction 0 0 -1 } ", global = "PointLight { location 0 0 9 } ";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        for (const std::string& light : {lamp, sun}) {
            EXPECT_NEAR(lit("Group { children [ " + light + floor + " ] } " + ball(), integrator), 1, 1e-5);
            EXPECT_EQ(lit("Group { children [ " + light + floor + ball() + " ] }", integrator), 0);
            EXPECT_EQ(lit("Group { children [ " + light + floor + "Group { children " + ball() + " } ] }", integrator),
                      0)
                << "what is within a part of it is reached too";
            EXPECT_EQ(lit("Group { children [ " + light + floor + "Group { children [ " + sun + ball() + " ] } ] }",
                          integrator),
                      0)
                << "whatever else shines there";
        }
        EXPECT_EQ(lit(global + "Group { children [ " + floor + " ] } " + ball(), integrator), 0);
        // A clear ball outside takes nothing, one inside takes its share: front and back.
        const char* clear = "appearance Appearance { material Material { transparency .5 } }";
        EXPECT_NEAR(lit("Group { children [ " + lamp + floor + " ] } " + ball(clear), integrator), 1, 1e-5);
        EXPECT_NEAR(lit("Group { children [ " + lamp + floor + ball(clear) + " ] }", integrator), .25, 1e-5);
    }
}

TEST(LightTracer, TwoScopesHaveShadowsOfTheirOwn) {
    // Both lamps reach the floor, the inner one by the outer group alone: red from the whole, green from within.
    const auto lit = [](const std::string& inner, const std::string& outer) {
        LightScene s(
            "Viewpoint { position 0 0 1 } NavigationInfo { headlight FALSE } "
            "PointLight { location 0 0 9 color 1 0 0 } Group { children [ "
            "PointLight { location 0 0 9 color 0 1 0 global FALSE } " +
            square(100, matte("1 1 1")) + inner + " ] } " + outer);
        s.options.settings.shadows = Shadows::all;
        return s.center();
    };
    const std::string ball =
        "Transform { translation 0 0 2 children Shape { appearance Appearance { material Material "
        "{ } } geometry Sphere { radius .5 } } }";
    EXPECT_EQ(lit("", ""), Vec3f(1, 1, 0));
    EXPECT_EQ(lit(ball, ""), Vec3f(0));
    EXPECT_EQ(lit("", ball), Vec3f(0, 1, 0));
    // A plane that cuts the ball away for one scope does so for its light as well.
    EXPECT_EQ(lit("Group { children [ ClipPlane { plane 0 0 -1 1 } " + ball + " ] }", ""), Vec3f(1, 1, 0));
    // A ball beyond the scope that coincides with one in it hides none of its shadow.
    EXPECT_EQ(lit(ball, ball), Vec3f(0));
}

TEST(LightTracer, VertexColorsWithAlphaLetShadowRaysThrough) {
    LightScene s(
        "Viewpoint { position 0 0 1 } PointLight { location 0 0 9 } " + square(100, matte("1 1 1")) +
        "Transform { translation 0 0 2 children " +
        square(0.5, "material Material { }", "solid FALSE colorPerVertex FALSE color ColorRGBA { color [1 1 1 0.5] }") +
        "}");
    EXPECT_NEAR(s.center().r, 0.5, 1e-5);
}

// Shadows are the same beside a clear thing that no ray meets; and of two things behind one another, whichever comes
// first, the opaque one blocks.
TEST(LightTracer, OpaqueThingsBlockBesideAndBehindClearOnes) {
    const auto ball = [](double z, const char* transparency) {
        return fmt::format(
            "Transform {{ translation 0 0 {} children Shape {{ appearance Appearance {{ material Material "
            "{{ transparency {} }} }} geometry Sphere {{ radius 0.5 }} }} }}",
            z, transparency);
    };
    const std::string start =
        "Viewpoint { position 0 0 1 } PointLight { location 0 0 9 } " + square(100, matte("1 1 1"));
    for (const std::string& items :
         {ball(2, "0") + ball(900, "0.5"), ball(2, "0") + ball(4, "0.5"), ball(2, "0.5") + ball(4, "0")})
        EXPECT_EQ(LightScene(start + items).center().r, 0) << items;
    EXPECT_NEAR(LightScene(start + ball(2, "0.5") + ball(4, "0.5")).center().r, 1 / 16.0, 1e-5);
}

// However many clear things are in the way, light is what they leave of it: from lights, and in `path` from a panel and
// from the sky.
TEST(LightTracer, LightComesThroughHundredsOfClearSurfaces) {
    constexpr int kSheets = 100;
    std::string under =
        "OrthoViewpoint { position 0 0 .5 fieldOfView [-.01 -.01 .01 .01] }" + square(90, matte("1 1 1"));
    for (int i = 0; i < kSheets; ++i)
        under += fmt::format("Transform {{ translation 0 0 {} children {} }}", 1 + .01 * i,
                             square(90, "material Material { diffuseColor 0 0 0 transparency .999 }"));
    const double left = std::pow(.999, kSheets);
    const auto lit = [&](const std::string& light, Integrator integrator) {
        LightScene s(under + light, 1, 1);
        s.options.settings.integrator = integrator;
        s.options.settings.colorSpace = ColorSpace::linear;
        s.options.settings.samplesPerPixel = integrator == Integrator::path ? 1024 : 1;
        return s.center().r;
    };
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        EXPECT_NEAR(lit("DirectionalLight { direction 0 0 -1 }", integrator), left, 1e-4);
        EXPECT_NEAR(lit("PointLight { location 0 0 9 }", integrator), left, 1e-4);
    }
    // The share of what a point sees that a square of 2 m is, 3 m above it.
    const double a = 1 / 3.0, b = std::sqrt(1 + a * a), panel = 4 / kPi * a / b * std::atan(a / b);
    const std::string square2m = square(1, "material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 }");
    EXPECT_NEAR(lit("Transform { translation 0 0 3 children " + square2m + "}", Integrator::path), panel * left,
                .02 * panel);
    // A sky whose light is all within 0.3 rad of the floor's normal.
    const double cap = std::sin(.3005) * std::sin(.3005);
    EXPECT_NEAR(
        lit("Transform { rotation 1 0 0 1.5707963 children Background { skyColor [1 1 1, 1 1 1, 0 0 0] skyAngle "
            "[.3 .301] } }",
            Integrator::path),
        cap * left, .03 * cap);
}

// Through N panes a lamp is as bright as the share that one lets through to the power of N, wherever rays go through
// them: also where their two triangles meet. Through panes of one mesh, of several, turned ones and textured ones.
TEST(LightTracer, PanesTakeTheirShareEach) {
    const auto pane = [](int kind, int i) {
        const char* clear = "material Material { diffuseColor 0 0 0 transparency .75 }";
        const char* textured =
            "material Material { diffuseColor 0 0 0 } texture PixelTexture { image 1 1 2 0xff40 repeatS TRUE }";
        const std::string shape = square(40, kind == 2 ? textured : clear);
        return fmt::format("Transform {{ translation 0 0 {} rotation {} children {} }}", 1 + i,
                           kind == 1 ? "0 0 1 .3" : "0 0 1 0", shape);
    };
    for (int kind = 0; kind < 3; ++kind)
        for (const int count : {1, 2, 3, 4}) {
            const double through = kind == 2 ? 1 - 64 / 255.0 : .75;
            std::string body = "OrthoViewpoint { position 0 0 .5 fieldOfView [-1 -1 1 1] }" +
                               std::string("DirectionalLight { direction 0 0 -1 }") + square(100, matte("1 1 1"));
            for (int i = 0; i < count; ++i) body += pane(kind, i);
            LightScene s(body, 32, 32);
            const Picture p = s.picture();
            for (int y = 0; y < 32; ++y)
                for (int x = 0; x < 32; ++x)
                    ASSERT_NEAR(p.at(x, y).r, std::pow(through, count), 1e-6) << kind << ' ' << count << ' ' << x;
        }
}

// A ClipPlane leaves out the panes on one side of it, be they the first or the last in a ray's way: those that are left
// all count. And of a strong light a thousandth is more than a weak one has.
TEST(LightTracer, PanesThatAreLeftOfCutOnesAllCountAndSoDoManyUnderAStrongLight) {
    // Rays go aslant, and the last panes are small: where one is met tells where the next one is looked for.
    const auto lit = [](int panes, const std::string& plane, double intensity, bool shut = false) {
        std::string body = fmt::format(
            "OrthoViewpoint {{ position 0 0 .5 fieldOfView [-1 -1 1 1] }} PointLight {{ location 60 40 100 radius 1e9 "
            "intensity {} }}{} Group {{ children [{}",
            intensity, square(100, matte("1 1 1")), plane);
        if (shut) body += fmt::format("Transform {{ translation 0 0 3 children {} }}", square(5, matte("1 1 1")));
        for (int i = 0; i < panes; ++i)
            body += fmt::format("Transform {{ translation 0 0 {} children {} }}", 1 + .1 * i,
                                square(i < 6 ? 40 : 5, "material Material { diffuseColor 0 0 0 transparency .5 }"));
        LightScene s(body + "]}");
        s.options.settings.colorSpace = ColorSpace::linear;
        return static_cast<double>(s.center().r);
    };
    const double free = lit(0, "", 1);
    ASSERT_GT(free, .7);
    const auto clip = [](double side, double z) {
        return fmt::format("ClipPlane {{ plane 0 0 {} {} }} ", side, -side * z);
    };
    EXPECT_NEAR(lit(8, clip(1, 1.45), 1), free / 8, 1e-5) << "the first five are cut";
    EXPECT_NEAR(lit(8, clip(-1, 1.45), 1), free / 32, 1e-5) << "the last three are cut";
    EXPECT_NEAR(lit(8, clip(1, 9), 1), free, 1e-5) << "all are cut";
    EXPECT_NEAR(lit(8, clip(1, .5), 1), free / 256, 1e-6) << "none is cut";
    EXPECT_EQ(lit(8, clip(1, 1.45), 1, true), 0) << "something opaque behind them";
    for (const int panes : {9, 10, 12, 16, 20})
        EXPECT_NEAR(lit(panes, "", 1e6) / (free * 1e6 * std::pow(.5, panes)), 1, 1e-4) << panes;
}

// A pane that is there twice is one, as it is for an eye; what is opaque blocks wherever it is, also in a clear thing's
// place.
TEST(LightTracer, OpaqueThingsBlockInTheirPlaceOfClearOnes) {
    const auto lit = [](const std::string& items) {
        return LightScene(
                   "OrthoViewpoint { position 0 0 .5 fieldOfView [-1 -1 1 1] } DirectionalLight { direction 0 0 "
                   "-1 }" +
                   square(100, matte("1 1 1")) + "Transform { translation 0 0 2 children [" + items + "] }")
            .center()
            .r;
    };
    const std::string clear = square(9, "material Material { transparency .5 }"), opaque = square(9, matte("1 1 1"));
    EXPECT_NEAR(lit(clear + clear), .5, 1e-6);
    EXPECT_EQ(lit(clear + opaque), 0);
    EXPECT_EQ(lit(opaque + clear), 0);
}

// A sheet that is nearly clear is not asked whether it is in shadow, where that would change its pixel by less than a
// fourth of the cutoff; what is seen more of it is, and is black there. So is what is seen in a faint mirror.
TEST(LightTracer, ShadowsThatNobodySeesAreLeftOut) {
    const auto seen = [](double transparency, float cutoff, std::uint64_t& shadowRays, int lights = 1) {
        std::string all;
        for (int i = 0; i < lights; ++i) all += "DirectionalLight { direction 0 0 -1 } ";
        LightScene s(
            "OrthoViewpoint { position 0 0 .5 fieldOfView [-1 -1 1 1] } " + all +
            square(9, fmt::format("material Material {{ diffuseColor 1 1 1 ambientIntensity 0 transparency {} }}",
                                  transparency)) +
            "Transform { translation 0 0 2 children " + square(9, matte("1 1 1")) + "}");
        s.options.settings.cutoff = cutoff;
        const float found = s.center().r;
        shadowRays = static_cast<std::uint64_t>(s.stats.shadowRays);
        return found;
    };
    std::uint64_t rays = 0;
    EXPECT_NEAR(seen(.9999, 1 / 1024.0f, rays), 0, 1 / 4096.0);
    EXPECT_EQ(rays, 0u);
    EXPECT_EQ(seen(.9999, 1 / 8192.0f, rays), 0);
    EXPECT_EQ(rays, 33u * 33u);
    EXPECT_EQ(seen(.999, 1 / 1024.0f, rays), 0);
    EXPECT_EQ(seen(.5, 1 / 1024.0f, rays), 0);
    // With many lights, none may leave out so much that the sum shows it.
    EXPECT_EQ(seen(.9999, 1 / 1024.0f, rays, 200), 0);
    EXPECT_EQ(rays, 200u * 33u * 33u);
}

// A plain lit from 80 degrees off its normal, with everything far from the origin, must not shadow itself.
TEST(LightTracer, NoFalseSelfShadowsFarFromTheOrigin) {
    for (const double offset : {0.0, 1e4, 1e6}) {
        const double a = 80 * kPi / 180;
        LightScene s(fmt::format("Transform {{ translation {0} {0} {0} rotation 0.26726124 0.53452248 0.80178373 0.7 "
                                 "children [ Viewpoint {{ position 0 0 3 }} "
                                 "DirectionalLight {{ direction {1} 0 {2} }} {3} ] }}",
                                 offset, -std::sin(a), -std::cos(a), square(50, matte("1 1 1"))),
                     64, 64);
        const Picture p = s.picture();
        int dark = 0;
        for (const Vec4f& pixel : p.pixels) dark += std::abs(pixel.r - std::cos(a)) > 2e-3;
        EXPECT_EQ(dark, 0) << "offset " << offset;
    }
}

TEST(LightTracer, SphereDoesNotShadowItsLitSide) {
    LightScene s(
        "PointLight { location 0 0 10 } Transform { translation 300 0 0 children [ Viewpoint { } Shape { appearance "
        "Appearance { material Material { } } geometry Sphere { radius 2 } } ] }"
        "PointLight { location 300 0 20 radius 1000 }",
        64, 64);
    const Picture p = s.picture();
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            const Vec3d d = pixelDirection(x, y, 64, 64, 0.7854);
            const double b = 10 * d.z, disc = b * b - (100 - 4);
            if (disc < 6) continue;  // well within the disk
            EXPECT_GT(p.at(x, y).r, 0.2f) << x << ' ' << y;
        }
}

TEST(LightTracer, SolidShapesAreOpenFromBehind) {
    const std::string box =
        "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } } geometry Box { size 4 4 4 "
        "solid %s } }";
    for (const bool solid : {true, false}) {
        std::string shape = box;
        shape.replace(shape.find("%s"), 2, solid ? "TRUE" : "FALSE");
        LightScene s("Viewpoint { position 0 0 0 } Background { skyColor 0 1 0 }" + shape);
        EXPECT_EQ(s.center(), solid ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0)) << solid;
    }
}

TEST(LightTracer, InsideOfARoomIsLitOnItsInnerSide) {
    LightScene s(
        "Viewpoint { position 0 0 0 } PointLight { location 0 0 0 } Shape { appearance Appearance { material Material "
        "{ diffuseColor 0.5 0.5 0.5 } } geometry Box { size 4 4 4 solid FALSE } }");
    EXPECT_NEAR(s.center().r, 0.5, 1e-6);
}

// A sheet with another material behind lets through as it is seen from where the shadow would fall.
TEST(LightTracer, BackMaterialsLetLightThroughAsTheyAreSeenThrough) {
    const char* const opaqueBehind =
        "material Material { transparency 1 } backMaterial Material { diffuseColor 0 0 0 }";
    const char* const clearBehind =
        "material Material { diffuseColor 0 0 0 } backMaterial Material { transparency .75 diffuseColor 0 0 0 }";
    const auto lit = [](const char* material, double angle, Integrator integrator) {
        LightScene s("Viewpoint { position 3 0 6 orientation 0 1 0 .4636476 } DirectionalLight { direction 0 0 -1 }" +
                     square(100, matte("1 1 1")) +
                     fmt::format("Transform {{ translation 0 0 2 rotation 0 1 0 {} children {} }}", angle,
                                 square(.5, material)));
        s.options.settings.integrator = integrator;
        s.options.settings.colorSpace = ColorSpace::linear;
        return s.center().r;
    };
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        EXPECT_NEAR(lit(opaqueBehind, 0, integrator), 0, 1e-5);
        EXPECT_NEAR(lit(opaqueBehind, kPi, integrator), 1, 1e-5);
        EXPECT_NEAR(lit(clearBehind, 0, integrator), .75, 1e-5);
        EXPECT_NEAR(lit(clearBehind, kPi, integrator), 0, 1e-5);
    }
}

TEST(LightTracer, BackMaterialShowsBehind) {
    const std::string two =
        "material UnlitMaterial { emissiveColor 1 0 0 } backMaterial UnlitMaterial { emissiveColor 0 0 1 }";
    LightScene front(square(5, two)), behind("Transform { rotation 0 1 0 3.14159265 children " + square(5, two) + "}");
    EXPECT_EQ(front.center(), Vec3f(1, 0, 0));
    EXPECT_EQ(behind.center(), Vec3f(0, 0, 1));
}

// 12.2.3: what is opaque by its alphaMode is so whatever its transparency, also from one frame to the next.
TEST(LightTracer, AlphaModeMakesWhollyTransparentShapesOpaque) {
    for (const char* material : {"Material { emissiveColor 1 0 0 diffuseColor 0 0 0 transparency 1 }",
                                 "UnlitMaterial { emissiveColor 1 0 0 transparency 1 }"}) {
        LightScene s(fmt::format("Shape {{ appearance DEF A Appearance {{ alphaMode \"OPAQUE\" material {} }} geometry "
                                 "Rectangle2D {{ size 9 9 }} }}",
                                 material),
                     1, 1);
        const auto seen = [&s](const char* mode, float cutoff, int frame) {
            EXPECT_TRUE(s.scene.set(s.node("A"), x3d::Appearance::alphaMode, String(mode)));
            EXPECT_TRUE(s.scene.set(s.node("A"), x3d::Appearance::alphaCutoff, cutoff));
            s.scene.newFrame(frame);
            return s.center();
        };
        const Vec3f red(1, 0, 0), nothing(0);
        EXPECT_EQ(s.center(), red);
        EXPECT_EQ(seen("AUTO", .5f, 1), nothing);
        EXPECT_EQ(seen("MASK", .5f, 2), nothing);
        EXPECT_EQ(seen("MASK", 0, 3), red);
        EXPECT_EQ(seen("BLEND", 0, 4), nothing);
        EXPECT_EQ(seen("OPAQUE", .5f, 5), red);
    }
}

// A Sphere stands for a ball: no facet that a light's rays reach by its normal lies in the shadow of its neighbours.
TEST(LightShadows, NoFacetsAtTheEdgeOfABallsShadow) {
    const std::string ball = "Shape { appearance Appearance { " + matte("1 1 1") + " } geometry Sphere { } }";
    const Vec3d towards = glm::normalize(Vec3d(1, .2, .3));
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const char* light :
             {"DirectionalLight { direction -1 -.2 -.3 }", "PointLight { location 1000 200 300 radius 1e5 }"}) {
            LightScene s(std::string("Viewpoint { position 0 0 3.2 fieldOfView .8 }") + light + ball, 160, 160);
            s.options.settings.integrator = integrator;
            s.options.settings.colorSpace = ColorSpace::linear;
            s.options.settings.layers = kNormal;
            const Picture p = s.picture();
            int near = 0, dark = 0;
            for (std::size_t i = 0; i < p.pixels.size(); ++i) {
                const float* n = &p.layers[0].values[3 * i];
                const double facing = glm::dot(Vec3d(n[0], n[1], n[2]), towards);
                if (!(facing > .02) || facing > .2) continue;
                ++near, dark += p.pixels[i].r < .5 * facing;
            }
            EXPECT_GT(near, 500) << light;
            EXPECT_EQ(dark, 0) << light << ' ' << static_cast<int>(integrator);
        }
    // Things in between still block it there.
    LightScene s(
        "Viewpoint { position 0 0 3.2 fieldOfView .8 } DirectionalLight { direction -1 -.2 -.3 } Transform { "
        "translation 3 .6 .9 children Shape { geometry Box { size .1 9 9 } } }" +
            ball,
        40, 40);
    double maximum = 0;
    const Picture p = s.picture();
    for (int y = 0; y < 40; ++y)
        for (int x = 10; x < 30; ++x)
            if (std::hypot(x - 19.5, y - 19.5) < 9) maximum = std::max(maximum, double{p.at(x, y).r});
    EXPECT_EQ(maximum, 0);
}

}  // namespace
}  // namespace rtsg
