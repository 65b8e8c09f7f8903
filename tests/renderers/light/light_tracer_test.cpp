// Through the whole path: X3D text to pixels, against closed forms and independent double-precision code.
#include <rtsg/renderers/light_tracer.h>

#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

TEST(LightTracer, UnlitColorsArriveUnchanged) {
    LightScene s(square(100, unlit("0.25 0.5 0.75")), 20, 12);
    const Picture p = s.picture();
    for (const Vec4f& pixel : p.pixels) ASSERT_EQ(pixel, Vec4f(0.25f, 0.5f, 0.75f, 1));
}

TEST(LightTracer, ShapeWithoutAppearanceIsUnlitWhite) {
    LightScene s("Shape { geometry Sphere { radius 2 } }");
    EXPECT_EQ(s.center(), Vec3f(1));
    const Picture p = s.picture();
    EXPECT_EQ(p.at(0, 0), Vec4f(0, 0, 0, 1)) << "and the background is black";
}

TEST(LightTracer, LambertFollowsTheCosine) {
    for (const double degrees : {0.0, 30.0, 60.0, 85.0}) {
        const double a = degrees * kPi / 180;
        LightScene s(fmt::format("DirectionalLight {{ direction 0 {} {} intensity 0.8 color 1 0.5 0.25 }}",
                                 -std::sin(a), -std::cos(a)) +
                     square(100, matte("0.5 0.6 0.7")));
        expectColor(s.center(), Vec3d(0.8 * 0.5, 0.4 * 0.6, 0.2 * 0.7) * std::cos(a), 1e-6);
    }
}

TEST(LightTracer, LightFromBehindDoesNotReachTheFront) {
    LightScene s("DirectionalLight { direction 0 0 1 }" + square(100, "material Material { specularColor 1 1 1 }"));
    EXPECT_EQ(s.center(), Vec3f(0));
}

// A light ten degrees below the horizon, seen from above: half way between light and eye lies above the surface, so
// only n . l > 0 keeps a highlight of exponent 0 (which is 1 wherever there is one) off it.
TEST(LightTracer, NoHighlightFromBelowTheHorizon) {
    const auto seen = [](double degrees, const char* material, Integrator integrator) {
        const double a = degrees * kPi / 180;
        LightScene s(fmt::format("DirectionalLight {{ direction {} 0 {} }}", -std::sin(a), -std::cos(a)) +
                     square(100, fmt::format("material {}", material)));
        s.options.settings.shadows = Shadows::none;
        s.options.settings.integrator = integrator;
        return s.center().r;
    };
    const char* materials[] = {"Material { diffuseColor 0 0 0 specularColor 1 1 1 shininess 0 }",
                               "PhysicalMaterial { metallic 1 roughness 1 }"};
    for (const char* material : materials)
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            EXPECT_EQ(seen(100, material, integrator), 0) << material;
            EXPECT_GT(seen(80, material, integrator), 0.01) << material;
        }
}

// Authored normals lean towards a light that is behind a sheet of paper: its light must not come through to the front,
// nor round the edge of the error bound. Without shadows 17.2.2 knows the normals alone.
TEST(LightTracer, LightBehindASheetIsBlockedByTheSheetItself) {
    for (const char* light : {"DirectionalLight { direction -0.9 0 0.2 }", "PointLight { location 9 0 -2 }",
                              "SpotLight { location 9 0 -2 direction -0.9 0 0.2 }"})
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            LightScene s(light + square(1, matte("1 1 1"),
                                        "solid FALSE normal Normal { vector [0.8 0 0.6, 0.8 0 0.6, "
                                        "0.8 0 0.6, 0.8 0 0.6] }"));
            s.options.settings.integrator = integrator;
            s.options.settings.shadows = Shadows::none;
            EXPECT_GT(s.center().r, 0.5) << light;
            s.options.settings.shadows = Shadows::all;
            EXPECT_EQ(s.center().r, 0) << light;
        }
}

// Every term of 17.2.2 at once, at every pixel, against the equations written out in double.
TEST(LightTracer, LightingEquationsAtEveryPixel) {
    LightScene s(
        "Viewpoint { fieldOfView 0.9 position 0 0 10 }"
        "PointLight { location 1 2 1.5 attenuation 0.5 0.2 0.1 color 1 0.8 0.6 intensity 0.9 ambientIntensity 0.3 "
        "radius 6 }"
        "SpotLight { location -2 -1 2 direction 0.3 0.2 -1 beamWidth 0.3 cutOffAngle 0.8 color 0.2 0.4 1 intensity 0.7 "
        "}"
        "DirectionalLight { direction -1 0 -2 intensity 0.4 ambientIntensity 0.5 }" +
            square(100,
                   "material Material { diffuseColor 0.8 0.5 0.3 specularColor 0.5 0.6 0.7 shininess 0.15 "
                   "ambientIntensity 0.25 "
                   "emissiveColor 0.01 0.02 0.03 }"),
        47, 31);
    const Picture p = s.picture();
    const Vec3d diffuse(0.8f, 0.5f, 0.3f), specular(0.5f, 0.6f, 0.7f), emissive(0.01f, 0.02f, 0.03f), n(0, 0, 1),
        eye(0, 0, 10);
    double worst = 0;
    int inRadius = 0, inCone = 0;
    for (int y = 0; y < 31; ++y)
        for (int x = 0; x < 47; ++x) {
            const Vec3d d = pixelDirection(x, y, 47, 31, 0.9f), point = eye - d * (10 / d.z);
            Vec3d sum = emissive;
            const auto add = [&](Vec3d toLight, double factor, Vec3d color, double intensity, double ambient) {
                toLight = glm::normalize(toLight);
                const Vec3d half = glm::normalize(toLight - d);
                const double cosine = std::max(glm::dot(n, toLight), 0.0);
                const double shine = cosine > 0 ? std::pow(std::max(glm::dot(n, half), 0.0), 0.15f * 128) : 0;
                sum += factor * color * (ambient * diffuse * 0.25 + intensity * (diffuse * cosine + specular * shine));
            };
            {
                const Vec3d to = Vec3d(1, 2, 1.5) - point;
                const double r = glm::length(to);
                if (r <= 6)
                    add(to, 1 / std::max(0.5 + 0.2f * r + 0.1f * r * r, 1.0), Vec3d(1, 0.8f, 0.6f), 0.9f, 0.3f),
                        ++inRadius;
            }
            {
                const Vec3d to = Vec3d(-2, -1, 2) - point, axis = glm::normalize(Vec3d(0.3f, 0.2f, -1));
                const double angle = std::acos(glm::dot(-glm::normalize(to), axis));
                const double spot = angle >= 0.8 ? 0 : angle <= 0.3 ? 1 : (angle - 0.8) / (0.3 - 0.8);
                add(to, spot, Vec3d(0.2f, 0.4f, 1), 0.7f, 0);
                inCone += spot > 0 && spot < 1;
            }
            add(Vec3d(1, 0, 2), 1, Vec3d(1), 0.4f, 0.5f);
            for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(p.at(x, y)[c] - sum[c]));
        }
    EXPECT_LT(worst, 2e-5);
    EXPECT_GT(inRadius, 100);
    EXPECT_GT(inCone, 50);
}

// Attenuation and radius count in the light's own frame.
TEST(LightTracer, AttenuationScalesWithTheLightsFrame) {
    LightScene s("Transform { scale 2 2 2 children PointLight { location 0 0 1 attenuation 0 0 1 radius 1.5 } }" +
                 square(100, matte("1 1 1")));
    expectColor(s.center(), Vec3d(1), 1e-6);  // 2 m away, but 1 of the light's own units
    LightScene far(
        "Transform { scale 0.5 0.5 0.5 children PointLight { location 0 0 4 attenuation 0 0 1 radius 3.9 } }" +
        square(100, matte("1 1 1")));
    expectColor(far.center(), Vec3d(0), 0);
    LightScene near(
        "Transform { scale 0.5 0.5 0.5 children PointLight { location 0 0 4 attenuation 0 0 1 radius 4.1 } }" +
        square(100, matte("1 1 1")));
    expectColor(near.center(), Vec3d(1 / 16.0), 1e-6);
}

TEST(LightTracer, HeadlightShinesUnlessSwitchedOff) {
    const std::string shape = square(100, matte("0.3 0.6 0.9"));
    LightScene on("NavigationInfo { }" + shape);
    expectColor(on.center(), Vec3d(0.3, 0.6, 0.9), 1e-6);
    LightScene off("NavigationInfo { headlight FALSE }" + shape);
    expectColor(off.center(), Vec3d(0), 0);
    LightScene turned("NavigationInfo { } Viewpoint { position 10 0 10 orientation 0 1 0 0.785398163 }" + shape);
    expectColor(turned.center(), Vec3d(0.3, 0.6, 0.9) * std::sqrt(0.5), 1e-5);
}

TEST(LightTracer, LocalLightsReachTheirSiblingsOnly) {
    // The left square is a sibling of the light, the right one is not.
    LightScene s("Group { children [ DirectionalLight { } Transform { translation -3 0 0 children " +
                     square(1, matte("1 1 1")) + "} ] } Transform { translation 3 0 0 children " +
                     square(1, matte("1 1 1")) + "}",
                 64, 64);
    const Picture p = s.picture();
    const auto column = [](double x) { return static_cast<int>((x / 10 / std::tan(0.7854 / 2) + 1) * 32); };
    EXPECT_EQ(Vec3f(p.at(column(-3), 32)), Vec3f(1));
    EXPECT_EQ(Vec3f(p.at(column(3), 32)), Vec3f(0));
}

// ---- shadows -----------------------------------------------------------------------------------------------------

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
    for (const std::string& things :
         {ball(2, "0") + ball(900, "0.5"), ball(2, "0") + ball(4, "0.5"), ball(2, "0.5") + ball(4, "0")})
        EXPECT_EQ(LightScene(start + things).center().r, 0) << things;
    EXPECT_NEAR(LightScene(start + ball(2, "0.5") + ball(4, "0.5")).center().r, 1 / 16.0, 1e-5);
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

TEST(LightTracer, BackMaterialShowsBehind) {
    const std::string two =
        "material UnlitMaterial { emissiveColor 1 0 0 } backMaterial UnlitMaterial { emissiveColor 0 0 1 }";
    LightScene front(square(5, two)), behind("Transform { rotation 0 1 0 3.14159265 children " + square(5, two) + "}");
    EXPECT_EQ(front.center(), Vec3f(1, 0, 0));
    EXPECT_EQ(behind.center(), Vec3f(0, 0, 1));
}

// ---- transforms --------------------------------------------------------------------------------------------------

TEST(LightTracer, MirroredInstancesKeepTheirOutside) {
    for (const char* scale : {"1 1 1", "-1 1 1", "1 -1 1", "-1 -1 1", "-2 3 0.5"}) {
        LightScene s(fmt::format("DirectionalLight {{ direction 0 0 -1 }} Transform {{ scale {} children ", scale) +
                     square(5, matte("1 1 1"), "solid TRUE") + "}");
        EXPECT_NEAR(s.center().r, 1, 1e-6) << scale;
        LightScene ball(
            fmt::format(
                "DirectionalLight {{ direction -1 0 0 global TRUE }} Transform {{ scale {} children Shape {{ "
                "appearance Appearance {{ material Material {{ diffuseColor 1 1 1 }} }} geometry Sphere {{ }} }} }}",
                scale),
            65, 65);
        const Picture p = ball.picture();
        EXPECT_GT(p.at(34, 32).r, 0.02f) << "right of the centre faces the light, scale " << scale;
        EXPECT_LT(p.at(30, 32).r, 1e-6f) << scale;
    }
}

// The normal of a stretched sphere goes by the inverse transpose.
TEST(LightTracer, StretchedSphereHasEllipsoidNormals) {
    LightScene s(
        "OrthoViewpoint { fieldOfView [-3 -3 3 3] } DirectionalLight { direction 0 -1 -1 } Transform { scale 3 1 0.5 "
        "children Shape { appearance Appearance { material Material { diffuseColor 1 1 1 } } geometry Sphere { } } }",
        61, 61);
    s.options.settings.shadows = Shadows::none;  // facets near the terminator shadow themselves
    const Picture p = s.picture();
    int checked = 0;
    for (int y = 0; y < 61; ++y)
        for (int x = 0; x < 61; ++x) {
            const double px = -3 + 6 * (x + 0.5) / 61, py = 3 - 6 * (y + 0.5) / 61, q = px * px / 9 + py * py;
            if (q > 0.8) continue;
            const double pz = 0.5 * std::sqrt(1 - q);
            const Vec3d n = glm::normalize(Vec3d(px / 9, py, pz / 0.25));
            EXPECT_NEAR(p.at(x, y).r, std::max(glm::dot(n, glm::normalize(Vec3d(0, 1, 1))), 0.0), 0.02)
                << x << ' ' << y;
            ++checked;
        }
    EXPECT_GT(checked, 500);
}

TEST(LightTracer, SingularTransformsAreSurvived) {
    for (const char* scale : {"1 0 1", "0 0 0", "1e-20 1e-20 1e-20", "1e20 1 1", "1 1 0"}) {
        LightScene s(
            fmt::format("PointLight {{ location 0 3 3 }} Transform {{ scale {} children [ Viewpoint {{ position 0 0 10 "
                        "}} PointLight {{ }} Shape {{ appearance Appearance {{ material Material {{ }} }} geometry "
                        "Sphere {{ radius 2 }} }} ] }}",
                        scale));
        const Picture p = s.picture();
        for (const Vec4f& pixel : p.pixels)
            ASSERT_TRUE(std::isfinite(pixel.r) && std::isfinite(pixel.g) && std::isfinite(pixel.b)) << scale;
    }
}

// ---- textures and colours ----------------------------------------------------------------------------------------

TEST(LightTracer, TextureLiesTheRightWayUp) {
    LightScene s(
        "Viewpoint { position 0 0 10 fieldOfView 0.199337 }" +
            square(
                1,
                "material UnlitMaterial { } texture PixelTexture { image 2 2 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF }"),
        64, 64);
    const Picture p = s.picture();
    // Half a pixel off the texels' centres: 1/64 of the neighbours' colours.
    expectColor(Vec3f(p.at(16, 48)), {1, 0, 0}, 0.032);  // lower left: s = t = 0
    expectColor(Vec3f(p.at(48, 48)), {0, 1, 0}, 0.032);
    expectColor(Vec3f(p.at(16, 16)), {0, 0, 1}, 0.032);
    expectColor(Vec3f(p.at(48, 16)), {1, 1, 1}, 0.032);
}

TEST(LightTracer, TextureModulatesTheMaterialAndIsTransformed) {
    // Shifted by half a texture: what was on the right is on the left.
    LightScene s("Viewpoint { position 0 0 10 fieldOfView 0.199337 } DirectionalLight { }" +
                     square(1,
                            "material Material { diffuseColor 0.5 0.5 0.5 } textureTransform TextureTransform { "
                            "translation 0.5 0 } texture PixelTexture { image 2 1 3 0xFF0000 0x00FF00 }"),
                 64, 64);
    const Picture p = s.picture();
    expectColor(Vec3f(p.at(16, 32)), {0, 0.5, 0}, 0.01);
    expectColor(Vec3f(p.at(48, 32)), {0.5, 0, 0}, 0.01);
}

TEST(LightTracer, TextureAlphaIsCoverage) {
    LightScene s(square(5, "material UnlitMaterial { } texture PixelTexture { image 1 1 4 0xFF000080 }") +
                 "Transform { translation 0 0 -1 children " + square(100, unlit("0 0 1")) + "}");
    expectColor(s.center(), {128 / 255.0, 0, 127 / 255.0}, 1e-5);
    LightScene mask(square(5,
                           "alphaMode \"MASK\" alphaCutoff 0.6 material UnlitMaterial { } texture PixelTexture { image "
                           "1 1 4 0xFF000080 }") +
                    "Transform { translation 0 0 -1 children " + square(100, unlit("0 0 1")) + "}");
    expectColor(mask.center(), {0, 0, 1}, 1e-5);
    LightScene opaque(
        square(5, "alphaMode \"OPAQUE\" material UnlitMaterial { } texture PixelTexture { image 1 1 4 0xFF000080 }"));
    expectColor(opaque.center(), {1, 0, 0}, 1e-5);
}

TEST(LightTracer, MissingTextureIsReportedAndLeftOut) {
    LightScene s(square(5,
                        "material UnlitMaterial { emissiveColor 0 0.5 0 } texture ImageTexture { url "
                        "[\"no/such/picture.png\" \"http://example.org/a.png\"] }"));
    EXPECT_EQ(s.center(), Vec3f(0, 0.5f, 0));
    s.center();
    ASSERT_EQ(s.light->tracer().diagnostics().all().size(), 1u) << "once";
    const std::string text = s.light->tracer().diagnostics().all()[0].text;
    EXPECT_NE(text.find("no/such/picture.png"), std::string::npos) << text;
    EXPECT_NE(text.find("http://example.org/a.png"), std::string::npos) << text;
}

TEST(LightTracer, VertexColorsStandInForTheMaterials) {
    const std::string colored =
        "Shape { appearance Appearance { material Material { diffuseColor 1 1 1 transparency 0 } } geometry "
        "IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] colorPerVertex FALSE "
        "color %s coord Coordinate { point [-5 -5 0, 5 -5 0, 5 5 0, -5 5 0] } } }";
    std::string rgb = colored, rgba = colored;
    rgb.replace(rgb.find("%s"), 2, "Color { color [0.2 0.4 0.6] }");
    rgba.replace(rgba.find("%s"), 2, "ColorRGBA { color [0.2 0.4 0.6 0.5] }");
    LightScene s("DirectionalLight { }" + rgb);
    expectColor(s.center(), {0.2, 0.4, 0.6}, 1e-6);
    LightScene t("DirectionalLight { } Background { skyColor 1 1 1 }" + rgba);
    expectColor(t.center(), {0.6, 0.7, 0.8}, 1e-6);
}

// ---- surroundings ------------------------------------------------------------------------------------------------

TEST(LightTracer, BackgroundGradientByAngle) {
    LightScene s(
        "Viewpoint { fieldOfView 1.4 orientation 1 0 0 0.4 } Background { skyColor [1 0 0, 0 1 0, 0 0 1] skyAngle [0.8 "
        "1.7] groundColor [0.1 0.1 0.1, 0.5 0.5 0] groundAngle [1.3] }",
        31, 31);
    const Picture p = s.picture();
    for (int y = 0; y < 31; ++y) {
        const Vec3d d = pixelDirection(15, y, 31, 31, 1.4);
        const Vec3d turned(d.x, d.y * std::cos(0.4) - d.z * std::sin(0.4), d.y * std::sin(0.4) + d.z * std::cos(0.4));
        const double zenith = std::acos(turned.y), nadir = kPi - zenith;
        Vec3d expected = zenith <= 0.8   ? glm::mix(Vec3d(1, 0, 0), Vec3d(0, 1, 0), zenith / 0.8)
                         : zenith <= 1.7 ? glm::mix(Vec3d(0, 1, 0), Vec3d(0, 0, 1), (zenith - 0.8) / 0.9)
                                         : Vec3d(0, 0, 1);
        if (nadir <= 1.3) expected = glm::mix(Vec3d(0.1), Vec3d(0.5, 0.5, 0), nadir / 1.3);
        expectColor(Vec3f(p.at(15, y)), expected, 1e-4);
    }
}

TEST(LightTracer, FogCoversByDistance) {
    LightScene s("Fog { color 0.5 0.6 0.7 visibilityRange 40 } Background { skyColor 1 0 0 }" +
                 square(1, unlit("0 0 1")));
    expectColor(s.center(), Vec3d(0, 0, 1) * 0.75 + Vec3d(0.5, 0.6, 0.7) * 0.25, 1e-5);
    EXPECT_EQ(Vec3f(s.picture().at(0, 0)), Vec3f(1, 0, 0)) << "the background is not fogged";
}

// What pictures leave out is named once for each kind, also when it comes later.
TEST(LightTracer, WhatIsNotDrawnIsNamed) {
    LightScene s("DEF CUT TextureProjector { } TextureProjector { } LocalFog { } LayerSet { }" +
                 square(1, unlit("1 1 1")));
    const auto texts = [&] {
        std::string all;
        for (const Diagnostic& d : s.light->diagnostics().all()) all += d.text + "\n";
        return all;
    };
    s.center();
    const std::string first = texts();
    EXPECT_EQ(s.light->diagnostics().all().size(), 3u) << first;
    EXPECT_NE(first.find("TextureProjector CUT is not in pictures: things show without it"), std::string::npos)
        << first;
    const NodeId later = s.scene.createNode(x3d::ParticleSystem::type);
    ASSERT_TRUE(s.scene.insertChild(s.scene.root(), x3d::RtsgScene::children, later));
    s.scene.newFrame(1);
    s.center();
    EXPECT_EQ(s.light->diagnostics().all().size(), 4u) << texts();
}

// A ball of a micrometre ten kilometres away cannot be told from a point in single precision: it is left out, and
// named. At home the same ball fills the picture as trigonometry says.
TEST(LightTracer, WhatIsTooSmallForItsPlaceIsNamed) {
    const auto look = [](double x) {
        return fmt::format(
            "Viewpoint {{ position {0} 0 3e-6 fieldOfView 0.9 }} Transform {{ translation {0} 0 0 children "
            "Shape {{ geometry Sphere {{ radius 1e-6 }} }} }}",
            x);
    };
    LightScene far(look(10000) + "Shape { geometry Box { size 1 1 1 } }");
    EXPECT_EQ(far.center(), Vec3f(0));
    const auto all = far.world->diagnostics().all();
    ASSERT_EQ(all.size(), 1u);
    EXPECT_NE(all[0].text.find("too small for its distance"), std::string::npos) << all[0].text;
    LightScene near(look(0), 101, 101);
    int white = 0;
    for (const Vec4f& pixel : near.picture().pixels) white += pixel.r > 0.5f;
    // The tangent cone of a ball at three radii: its rim is at tan = 1 / sqrt(8).
    const double radius = 50.5 / std::sqrt(8) / std::tan(0.45);
    EXPECT_NEAR(white, kPi * radius * radius, 0.03 * kPi * radius * radius);
    EXPECT_TRUE(near.world->diagnostics().all().empty());
}

// ---- viewpoints --------------------------------------------------------------------------------------------------

TEST(LightTracer, ViewpointsByNameAndByOrder) {
    LightScene s(
        "DEF A Viewpoint { position 0 0 10 description \"front\" } DEF B Viewpoint { position 10 0 0 orientation 0 1 0 "
        "1.5707963 description \"side\" }"
        "Shape { appearance Appearance { material Material { } } geometry Box { } }");
    const auto eye = [&](const char* name) {
        const auto camera = s.light->tracer().camera(s.world->rays(), 1, name);
        return camera ? camera->position : Vec3d(NAN);
    };
    EXPECT_EQ(eye(""), Vec3d(0, 0, 10));
    EXPECT_EQ(eye("B"), Vec3d(10, 0, 0));
    EXPECT_EQ(eye("side"), Vec3d(10, 0, 0));
    const auto wrong = s.light->tracer().camera(s.world->rays(), 1, "nobody");
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().text.find("\"A\", \"B\""), std::string::npos) << wrong.error().text;
    ASSERT_TRUE(s.scene.sendEvent(s.node("B"), x3d::Viewpoint::set_bind.index, Value(true)));
    s.scene.newFrame(1);
    EXPECT_EQ(eye(""), Vec3d(10, 0, 0)) << "bound";
}

TEST(LightTracer, ViewpointFollowsItsTransform) {
    LightScene s("DEF T Transform { children Viewpoint { position 0 0 10 } }");
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(1, 2, 3)));
    s.scene.newFrame(1);
    EXPECT_EQ(s.light->tracer().camera(s.world->rays(), 1)->position, Vec3d(1, 2, 13));
}

TEST(LightTracer, WithoutAViewpointEverythingIsInThePicture) {
    LightScene s("# frame\nTransform { translation 100 50 -30 children Shape { geometry Box { size 3 1 2 } } }", 64,
                 32);
    const Picture p = s.picture();
    int white = 0;
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 64; ++x) {
            white += p.at(x, y).r > 0;
            const bool border = x == 0 || y == 0 || x == 63 || y == 31;
            EXPECT_FALSE(border && p.at(x, y).r > 0);
        }
    EXPECT_GT(white, 300);
}

// ---- sampling and threads ----------------------------------------------------------------------------------------

TEST(LightTracer, ManySamplesGiveTheCoveredShareOfAPixel) {
    // The edge at x = 0.3 of a pixel one metre wide.
    LightScene s("OrthoViewpoint { fieldOfView [-0.5 -0.5 0.5 0.5] } Transform { translation 4.8 0 0 children " +
                     square(5, unlit("1 1 1")) + "}",
                 1, 1);
    s.options.settings.samplesPerPixel = 256;
    EXPECT_NEAR(s.picture().at(0, 0).r, 0.7, 0.006) << "256 stratified columns";
    s.options.settings.seed = 5;
    EXPECT_NEAR(s.picture().at(0, 0).r, 0.7, 0.006);
}

TEST(LightTracer, PictureDoesNotDependOnTheThreads) {
    LightScene s("PointLight { location 3 5 8 } Shape { appearance Appearance { " + glass(1.5) +
                     " } geometry Sphere { } } Transform { translation 0 0 -4 children " +
                     square(4, matte("0.5 0.7 0.2")) + "}",
                 77, 53);
    s.options.settings.samplesPerPixel = 4;
    s.options.settings.threads = 1;
    const Picture one = s.picture();
    for (const unsigned threads : {2u, 0u}) {
        s.options.settings.threads = threads;
        EXPECT_EQ(s.picture().pixels, one.pixels) << threads;
    }
}

TEST(LightTracer, ImpossibleSettingsAreErrors) {
    LightScene s("Shape { geometry Box { } }");
    const Camera camera;
    for (auto change :
         {+[](RenderSettings& r) { r.width = 0; }, +[](RenderSettings& r) { r.height = -5; },
          +[](RenderSettings& r) { r.width = 1 << 20; }, +[](RenderSettings& r) { r.samplesPerPixel = 0; }}) {
        RenderSettings settings;
        change(settings);
        EXPECT_FALSE(s.light->tracer().render(s.world->rays(), camera, settings));
    }
    ImageOptions options;
    options.settings.integrator = Integrator::raster;
    EXPECT_FALSE(s.light->picture(options));
}

// ---- following the scene -----------------------------------------------------------------------------------------

TEST(LightTracer, ATransformNeverTouchesMaterials) {
    LightScene s(
        "DEF L PointLight { } DEF T Transform { children Shape { appearance DEF A Appearance { material DEF M Material "
        "{ } } geometry Box { } } }");
    const auto before = s.light->tracer().counts();
    for (int i = 1; i < 5; ++i) {
        ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(float(i), 0, 0)));
        s.scene.newFrame(i);
    }
    EXPECT_EQ(s.light->tracer().counts().materialsRead, before.materialsRead);
    EXPECT_EQ(s.light->tracer().counts().lightsRead, before.lightsRead);
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::Material::diffuseColor, Color{1, 0, 0}));
    s.scene.newFrame(6);
    EXPECT_EQ(s.light->tracer().counts().materialsRead, before.materialsRead + 1);
    ASSERT_TRUE(s.scene.set(s.node("L"), x3d::PointLight::intensity, 0.5f));
    s.scene.newFrame(7);
    EXPECT_EQ(s.light->tracer().counts().materialsRead, before.materialsRead + 1);
    EXPECT_EQ(s.light->tracer().counts().lightsRead, before.lightsRead + 1);
}

// Law 2 (no two surfaces may coincide, or which one is seen is open): after any run of edits the picture is the one
// that a renderer attached afresh gives, bit for bit.
TEST(LightTracer, IncrementalEqualsFromScratch) {
    const std::uint64_t seed = 20260721;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> unit(0, 1);
    std::string body =
        "DEF L0 PointLight { location 5 5 5 } DEF G Transform { translation 0.1 0.1 -2.5 children [ DEF L1 "
        "DirectionalLight { direction 1 -1 -1 "
        "intensity 0.4 } ] }";
    for (int i = 0; i < 8; ++i)
        body += fmt::format(
            "DEF T{0} Transform {{ translation {1} {2} 0 children DEF S{0} Shape {{ appearance DEF A{0} Appearance {{ "
            "material DEF M{0} Material {{ }} }} geometry {3} }} }}",
            i, -3 + 2 * (i % 4), -1 + 2 * (i / 4), i % 2 ? "Sphere { radius 0.8 }" : "Box { }");
    LightScene s("Viewpoint { }" + body, 48, 32);
    for (int round = 1; round <= 25; ++round) {
        for (int edit = 0; edit < 3; ++edit) {
            const int i = static_cast<int>(random() % 8);
            const auto named = [&](const char* kind) { return s.node(fmt::format("{}{}", kind, i).c_str()); };
            switch (random() % 7) {
                case 0:
                    ASSERT_TRUE(s.scene.set(named("T"), x3d::Transform::translation,
                                            Vec3f(unit(random) * 6 - 3, unit(random) * 4 - 2, unit(random))));
                    break;
                case 1:
                    ASSERT_TRUE(s.scene.set(named("M"), x3d::Material::diffuseColor,
                                            Color{unit(random), unit(random), unit(random)}));
                    break;
                case 2:
                    ASSERT_TRUE(
                        s.scene.set(named("M"), x3d::Material::transparency, unit(random) < 0.5f ? 0.0f : 0.6f));
                    break;
                case 3:
                    ASSERT_TRUE(s.scene.set(s.node("L0"), x3d::PointLight::location, Vec3f(unit(random) * 9, 5, 5)));
                    break;
                case 4:
                    ASSERT_TRUE(s.scene.set(s.node("L1"), x3d::DirectionalLight::global, unit(random) < 0.5f));
                    break;
                case 5:
                    ASSERT_TRUE(s.scene.set(named("S"), x3d::Shape::appearance,
                                            s.node(fmt::format("A{}", random() % 8).c_str())));
                    break;
                case 6: {
                    const auto& children = s.scene.node(s.node("G")).get(x3d::Transform::children);
                    if (children.size() > 3)
                        ASSERT_TRUE(s.scene.removeChild(s.node("G"), x3d::Transform::children.index, 1));
                    else
                        ASSERT_TRUE(s.scene.insertChild(s.node("G"), x3d::Transform::children.index, named("T")));
                    break;
                }
            }
        }
        s.scene.newFrame(round);
        const Picture followed = s.picture();
        SharedWorld freshWorld(s.scene);
        LightRenderer fresh(freshWorld);
        const auto scratch = fresh.picture(s.options);
        ASSERT_TRUE(scratch);
        // A moved instance is traced through its transform, one from scratch perhaps in ray space: along silhouettes
        // and shadow edges a ray may fall on either side.
        int different = 0;
        for (std::size_t k = 0; k < followed.pixels.size(); ++k)
            different += glm::any(glm::greaterThan(glm::abs(followed.pixels[k] - scratch->pixels[k]), Vec4f(1e-4f)));
        ASSERT_LE(different, 6) << "seed " << seed << " round " << round;
    }
}

// Whatever numbers a file or a script puts into fields, there is a picture and it is finite.
class WildNumbers : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(LightTracer, WildNumbers, testing::Range<std::uint64_t>(1, 9));
TEST_P(WildNumbers, InAnyFieldAreSurvived) {
    const std::uint64_t seed = GetParam();
    std::mt19937_64 random(seed);
    LightScene s(
        "Viewpoint { position 0 1 8 } NavigationInfo { visibilityLimit 50 } Background { skyColor [0 0 1, 1 1 1] "
        "skyAngle 1.57 groundColor [0 0 0, 0 1 0] groundAngle 1.5 }"
        "Fog { visibilityRange 40 } PointLight { location 3 3 3 ambientIntensity 0.1 } SpotLight { location -3 3 3 "
        "direction 1 -1 -1 } DirectionalLight { }"
        "Transform { children Shape { appearance Appearance { material Material { transparency 0.2 specularColor 1 1 1 "
        "metadata MetadataSet { name \"RTSG\" value [ "
        "MetadataFloat { name \"refractiveIndex\" value 1.5 } MetadataFloat { name \"absorption\" value 0.5 } "
        "MetadataFloat { name \"reflectivity\" value 0.1 } ] } } "
        "texture PixelTexture { image 2 2 4 0xFF0000FF 0x00FF0080 0x0000FFFF 0xFFFFFF00 } textureTransform "
        "TextureTransform { scale 2 2 } } geometry Sphere { } } }"
        "Transform { translation 0 -1 0 children Shape { appearance Appearance { material PhysicalMaterial { metallic "
        "0.5 roughness 0.2 } } geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] "
        "texCoord TextureCoordinate { point [0 0, 9 0, 9 9, 0 9] } normal Normal { vector [0 1 0, 0 1 0, 0 1 0, 0 1 0] "
        "} color ColorRGBA { color [1 1 1 1, 1 0 0 0.5, 0 1 0 1, 0 0 1 0.1] } "
        "coord Coordinate { point [-4 0 4, 4 0 4, 4 0 -4, -4 0 -4] } } } }",
        24, 16);
    const float wild[] = {NAN, INFINITY, -INFINITY, 3e38f, -3e38f, -1, 0, 1e-45f, 1e-30f, 1e20f, 1};
    const auto number = [&] { return wild[random() % std::size(wild)]; };
    std::vector<NodeId> nodes;
    s.scene.forEachNode([&](const Node& node) { nodes.push_back(node.id()); });
    int edits = 0;
    for (int round = 1; round <= 400; ++round) {
        const NodeId id = nodes[random() % nodes.size()];
        const Node& node = s.scene.node(id);
        if (node.type().fields.empty()) continue;
        const auto field = static_cast<FieldIndex>(random() % node.type().fields.size());
        const FieldDef& def = node.type().fields[field];
        if (!def.readable() || def.hidden || def.access == Access::outputOnly) continue;
        const Value before = node.value(field);
        Value value;
        switch (def.type) {
            case FieldType::SFFloat:
                value = Value(number());
                break;
            case FieldType::SFVec2f:
                value = Value(Vec2f(number(), number()));
                break;
            case FieldType::SFVec3f:
                value = Value(Vec3f(number(), number(), number()));
                break;
            case FieldType::SFColor:
                value = Value(Color{number(), number(), number()});
                break;
            case FieldType::SFRotation:
                value = Value(Rotation{number(), number(), number(), number()});
                break;
            case FieldType::MFFloat:
                value = Value(Array<float>{number(), number(), number()});
                break;
            case FieldType::MFColor:
                value = Value(Array<Color>{{number(), 0, 0}, {0, number(), 1}, {1, 1, number()}});
                break;
            case FieldType::MFVec2f:
                value = Value(Array<Vec2f>{{number(), 1}, {0, number()}});
                break;
            case FieldType::MFVec3f:
                value = Value(Array<Vec3f>{{number(), 0, 0}, {1, number(), 0}, {0, 1, number()}, {1, 1, 1}});
                break;
            case FieldType::MFColorRGBA:
                value = Value(Array<ColorRGBA>{{1, number(), 0, number()}, {0, 0, 1, number()}});
                break;
            case FieldType::SFBool:
                value = Value(random() % 2 == 0);
                break;
            case FieldType::SFString:
                value = Value(String("nonsense"));
                break;
            default:
                continue;
        }
        const std::string what = fmt::format("seed {} round {}: {}.{}", seed, round, node.type().name, def.name);
        if (!s.scene.setField(id, field, value)) continue;
        ++edits;
        s.scene.newFrame(round);
        const Picture p = s.picture();
        for (const Vec4f& pixel : p.pixels)
            for (int c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(pixel[c])) << what;
        // Mostly put it back, so that the scene stays worth looking at.
        if (random() % 8 != 0) {
            ASSERT_TRUE(s.scene.setField(id, field, before)) << what;
        }
    }
    EXPECT_GT(edits, 150);
}

}  // namespace
}  // namespace rtsg
