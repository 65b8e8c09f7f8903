// Lines and points in pictures: how many pixels they cover, their colours, shadows, mirror images, and that they follow
// the scene; against closed forms.
#include <random>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picking.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// In pixels.
double covered(const Picture& p) {
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel.g;
    return sum;
}
std::string points(const std::string& positions, double size, const char* color = "1 1 1") {
    return fmt::format(
        "Shape {{ appearance Appearance {{ {} pointProperties DEF P PointProperties {{ "
        "pointSizeScaleFactor {} }} }} geometry DEF G PointSet {{ coord DEF C Coordinate {{ point [ {} ] }} }} }}",
        unlit(color), size, positions);
}
std::string lines(const std::string& positions, double width, const char* more = "", const char* style = "",
                  const char* color = "1 1 1") {
    return fmt::format(
        "Shape {{ appearance Appearance {{ {} lineProperties DEF L LineProperties {{ linewidthScaleFactor {} {} }} }} "
        "geometry DEF G IndexedLineSet {{ coordIndex [ 0 1 -1 ] coord DEF C Coordinate {{ point [ {} ] }} {} }} }}",
        unlit(color), width, style, positions, more);
}
const std::string kParallel = "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } ";  // 50 pixels a metre of 200

/// 200 x 200 pixels of 16 samples each.
struct Fine : LightScene {
    explicit Fine(const std::string& body, Integrator integrator = Integrator::whitted) : LightScene(body, 200, 200) {
        options.settings.samplesPerPixel = 16;
        options.settings.integrator = integrator;
    }
};

TEST(StrokesInPictures, APointIsASquareOfItsPixels) {
    const double square = 20 * 20;
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        EXPECT_NEAR(covered(Fine(kParallel + points("0 0 0", 20), integrator).picture()), square, 1);
        EXPECT_NEAR(covered(Fine(points("0 0 0", 20), integrator).picture()), square, 1) << "10 m from the eye";
        EXPECT_NEAR(covered(Fine(points("0 0 -990", 20), integrator).picture()), square, 1) << "1000 m from it";
    }
    EXPECT_NEAR(covered(Fine(kParallel + lines("-1 0 0, 1 0 0", .1)).picture()), 100, 2) << "at least one pixel";
}

TEST(StrokesInPictures, APointOfOnePixelIsMetOnceWhereverItIs) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> at(-1.9, 1.9), deep(-20, 5);
    for (const std::string& eye : {kParallel, std::string("Viewpoint { } "),
                                   std::string("Viewpoint { position 0 1 9 orientation 0 0 1 .3 fieldOfView 1.7 } ")})
        for (int i = 0; i < 100; ++i) {
            const std::string position =
                i == 0 ? "0 0 0" : fmt::format("{} {} {}", at(random), at(random), deep(random));
            SCOPED_TRACE(eye + position);
            Fine s(eye + points(position, 1));
            s.options.settings.samplesPerPixel = 1;
            const Picture picture = s.picture();
            EXPECT_EQ(covered(picture), 1);
            const RayWorld& rays = s.world->rays();
            const LightTracer& tracer = s.light->tracer();
            const auto camera = tracer.camera(rays, 1);
            ASSERT_TRUE(camera);
            const auto views = tracer.layers(rays, *camera, 200, 200);
            for (std::size_t k = 0; k < picture.pixels.size(); ++k) {
                const int x = static_cast<int>(k) % 200, y = static_cast<int>(k) / 200;
                if (picture.pixels[k].g == 0 && (x + y + i) % 97 != 0) continue;
                const auto pick = tracer.pick(Picker(rays, s.world->flattener()), rays, views, x + .5, y + .5);
                ASSERT_TRUE(pick);
                EXPECT_EQ(static_cast<bool>(*pick), picture.pixels[k].g > 0);
            }
        }
}

// On the middle of a pixel, which is .01 m off that of the picture.
TEST(StrokesInPictures, APointOnAPixelsMiddleFillsIt) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const int samples : {1, 4, 16}) {
            Fine s(kParallel + points(".01 .01 0", 1, "1 .5 .25"), integrator);
            s.options.settings.samplesPerPixel = samples;
            s.options.settings.colorSpace = ColorSpace::linear;
            const Picture p = s.picture();
            EXPECT_NEAR(p.at(100, 99).r, 1, 2e-3) << samples;
            EXPECT_NEAR(covered(p), p.at(100, 99).g, 2e-3) << "and nothing else";
        }
}

TEST(StrokesInPictures, TexturesAreTold) {
    for (const std::string& shape :
         {std::string("PointSet { coord Coordinate { point 0 0 0 } }"),
          std::string("LineSet { vertexCount 2 coord Coordinate { point [ 0 0 0, 1 0 0 ] } }"),
          std::string("Circle2D { }")}) {
        SCOPED_TRACE(shape);
        const auto reported = [](const LightScene& s) {
            int count = 0;
            for (const Diagnostic& d : s.light->tracer().diagnostics().all())
                if (d.text.find("lines and points have no textures") != std::string::npos) {
                    ++count;
                    EXPECT_GT(d.where.line, 0) << d.format();
                }
            return count;
        };
        const std::string texture = "texture PixelTexture { image 1 1 3 0xff0000 } ";
        const std::string use = "Shape { appearance DEF A Appearance { material UnlitMaterial { } ";
        LightScene with(use + texture + "} geometry DEF G " + shape + " } Shape { appearance USE A geometry USE G }");
        EXPECT_EQ(reported(with), 1);
        LightScene later(use + "} geometry DEF G " + shape + " } Group { children Shape { appearance Appearance { " +
                         "texture DEF T PixelTexture { image 1 1 3 0xff0000 } } geometry Box { } } }");
        EXPECT_EQ(reported(later), 0);
        ASSERT_TRUE(later.scene.set(later.node("A"), x3d::Appearance::texture, later.node("T")));
        later.scene.newFrame(1);
        EXPECT_EQ(reported(later), 1);
    }
}

// A point of 100 pixels is a square of 1 m here: 10 m, .3 m and .01 m before the eye, and behind it.
TEST(StrokesInPictures, BeforeAParallelEyeTheyAreAsWideHoweverNear) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const double depth : {10.0, .3, .01}) {
            const std::string z = fmt::format("{}", 10 - depth);
            EXPECT_NEAR(covered(Fine(kParallel + points("0 0 " + z, 100), integrator).picture()), 1e4, 20) << z;
            const std::string ends = fmt::format("-.5 0 {0}, .5 0 {0}", z);
            EXPECT_NEAR(covered(Fine(kParallel + lines(ends, 60), integrator).picture()), 50 * 60 + kPi * 900, 20) << z;
        }
    EXPECT_EQ(covered(Fine(kParallel + points("0 0 10.3", 100)).picture()), 0);
    // The same far from the origin, askew.
    const std::string placed = "Transform {{ translation 3e4 100 -2e3 rotation 0 .6 .8 .7 children [ {} {} ] }}";
    for (const char* position : {"0 0 9.7", "1 -.5 9.9"})
        EXPECT_NEAR(covered(Fine(fmt::format(fmt::runtime(placed), kParallel, points(position, 100))).picture()), 1e4,
                    20)
            << position;
}

// At 40 degrees from the middle a ball would look longer by 1 / cos 40: 30 %.
TEST(StrokesInPictures, WidthIsTheSameEverywhereInThePicture) {
    const std::string wide = "Viewpoint { position 0 0 0 fieldOfView 1.8 } ";
    for (const char* position : {"0 0 -5", "4 0 -5", "0 -4.2 -5", "4 4 -5", "40 30 -50"})
        EXPECT_NEAR(covered(Fine(wide + points(position, 20)).picture()), 400, 1) << position;
    // 158.7 pixels are 2 tan .9 times the depth.
    const double pixels = 200 / (2 * std::tan(.9));
    for (const double x : {0.0, 4.0}) {
        const double length = pixels * 4 / 5, caps = kPi * 25;
        EXPECT_NEAR(covered(Fine(wide + lines(fmt::format("{0} -2 -5, {0} 2 -5", x), 10)).picture()),
                    10 * length + caps, .02 * 10 * length)
            << x;
    }
}

// However the space is scaled that they stand in, and that they are seen from.
TEST(StrokesInPictures, WidthIsThatOfItsPixelsBelowUnevenScales) {
    const double square = 400;
    const std::string eye = "Viewpoint { } ", parallel = kParallel;
    for (const std::string scale : {"scale .25 4 2", "scale 1 30 1", "scale 3 .2 5 scaleOrientation 0 .6 .8 .6",
                                    "translation 50 3 -2 rotation .6 0 .8 .8 scale -1 6 .5"})
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            SCOPED_TRACE(scale);
            const auto seen = [&](const std::string& view, const std::string& items) {
                return covered(
                    Fine("Transform { " + scale + " children [ " + view + items + " ] }", integrator).picture());
            };
            // 2 m are 100 pixels; for the perspective at 10 m, 200 / (2 tan 22.5 degrees) / 10 of them a metre.
            const double width = 6, ends = kPi * width * width / 4, perspective = 20 / (2 * std::tan(kPi / 8));
            for (const char* positions : {"-1 0 0, 1 0 0", "0 -1 0, 0 1 0", "-.6 -.8 0, .6 .8 0"}) {
                EXPECT_NEAR(seen(parallel, lines(positions, width)), 100 * width + ends, 8) << positions;
                EXPECT_NEAR(seen(eye, lines(positions, width)), 2 * perspective * width + ends, 8) << positions;
            }
            for (const char* position : {"0 0 0", "2 -1.5 1"})
                EXPECT_NEAR(seen(eye, points(position, 20)), square, 1) << position;
            EXPECT_NEAR(seen(parallel, points(".5 1 -3", 20)), square, 1);
        }
    // Seen from outside.
    for (const char* scale : {"scale 1 30 1", "scale .01 2 1"})
        EXPECT_NEAR(
            covered(Fine(fmt::format("{} Transform {{ {} children {} }}", kParallel, scale, points("0 0 0", 20)))
                        .picture()),
            square, 1)
            << scale;
}

TEST(StrokesInPictures, ALineIsARectangleWithRoundEnds) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const double width : {1.0, 7.0}) {
            const double expected = width * 100 + kPi * width * width / 4;  // 2 m of 50 pixels each
            EXPECT_NEAR(covered(Fine(kParallel + lines("-1 0 0, 1 0 0", width), integrator).picture()), expected,
                        .01 * expected);
            EXPECT_NEAR(covered(Fine(kParallel + lines("-.6 -.8 0, .6 .8 0", width), integrator).picture()), expected,
                        .01 * expected);
        }
}

// Its width follows the depth along it: the picture of a line that leads away is straight and as wide everywhere.
TEST(StrokesInPictures, ALineThatLeadsAwayKeepsItsWidth) {
    const Picture p = Fine(lines("0 -1 5, 0 -20 -390", 6)).picture();
    const auto rowSum = [&](int y) {
        double sum = 0;
        for (int x = 0; x < p.width; ++x) sum += p.at(x, y).g;
        return sum;
    };
    std::vector<double> rows;
    for (int y = 0; y < p.height; ++y)
        if (rowSum(y) > 0) rows.push_back(rowSum(y));
    ASSERT_GT(rows.size(), 20u);
    for (std::size_t i = 4; i + 4 < rows.size(); ++i) EXPECT_NEAR(rows[i], 6, .1) << i << ", and its ends are round";
}

TEST(StrokesInPictures, ColoursRunAlongLinesAndStayOnPoints) {
    LightScene s(kParallel + lines("-1 0 0, 1 0 0", 10, "color Color { color [ 1 0 0, 0 1 .5 ] }"), 201, 201);
    const Picture p = s.picture();
    const double pixel = 4.0 / 201;
    for (const int x : {60, 100, 140}) {
        const double u = ((x + .5) * pixel - 2 + 1) / 2;
        expectColor(Vec3f(p.at(x, 100)), Vec3d(1 - u, u, .5 * u), 2e-3);
    }
    LightScene byLine(
        kParallel +
            "Shape { geometry IndexedLineSet { colorPerVertex FALSE coordIndex [ 0 1 -1 2 3 -1 ] colorIndex [ 1 "
            "0 ] color Color { color [ 0 0 1, 1 0 0 ] } coord Coordinate { point [ -1 1 0, 1 1 0, -1 -1 0, "
            "1 -1 0 ] } } }",
        201, 201);
    EXPECT_EQ(Vec3f(byLine.picture().at(100, 50)), Vec3f(1, 0, 0));
    EXPECT_EQ(Vec3f(byLine.picture().at(100, 150)), Vec3f(0, 0, 1));
    LightScene dots(
        kParallel +
            "Shape { geometry PointSet { color ColorRGBA { color [ 1 0 0 1, 0 1 0 .5 ] } coord Coordinate { "
            "point [ -1 0 0, 1 0 0 ] } } }",
        201, 201);
    EXPECT_EQ(Vec3f(dots.picture().at(50, 100)), Vec3f(1, 0, 0));
    EXPECT_EQ(Vec3f(dots.picture().at(150, 100)), Vec3f(0, .5f, 0)) << "half of it is the black behind";
}

// Nothing but what it shines with: emissiveColor of a Material, and no light.
TEST(StrokesInPictures, TheColourIsWhatTheMaterialShinesWith) {
    LightScene s(
        "DirectionalLight { } Shape { appearance Appearance { material Material { diffuseColor 1 0 0 emissiveColor "
        ".25 .5 .75 } pointProperties PointProperties { pointSizeScaleFactor 9 } } geometry PointSet { coord "
        "Coordinate { point 0 0 0 } } }");
    EXPECT_EQ(s.center(), Vec3f(.25f, .5f, .75f));
}

TEST(StrokesInPictures, TheNearerOneIsSeen) {
    const auto at = [&](double z) {
        return LightScene(square(.5, unlit("1 0 0")) + points(fmt::format("0 0 {}", z), 3)).center();
    };
    EXPECT_EQ(at(1), Vec3f(1));
    EXPECT_EQ(at(-1), Vec3f(1, 0, 0));
    EXPECT_EQ(at(0), Vec3f(1)) << "on a surface";
    EXPECT_EQ(at(11), Vec3f(1, 0, 0)) << "behind the eye";
}

/// Turned by 1.1 about the x axis.
std::string aslant(const std::string& shapes) {
    return "Transform { rotation 1 0 0 1.1 children [ " + shapes + " ] } ";
}

TEST(StrokesInPictures, CountFromTheirAxisHoweverWideTheyAre) {
    const std::string black = square(4, unlit("0 0 0")), line = lines("-1 0 0, 1 0 0", 10), dot = points("0 0 0", 20);
    const double whole = 10 * 100 + kPi * 25;
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const auto seen = [&](const std::string& shapes) {
            return covered(Fine(kParallel + shapes, integrator).picture());
        };
        const auto wall = [&](double z) {
            return fmt::format("Transform {{ translation 0 0 {} children {} }} ", z, black);
        };
        for (const double z : {.001, .05}) {
            EXPECT_EQ(seen(wall(z) + line), 0) << "the wall is " << z << " m before it";
            EXPECT_EQ(seen(wall(z) + dot), 0) << z;
            EXPECT_NEAR(seen(wall(-z) + line), whole, 10) << "behind it";
            EXPECT_NEAR(seen(wall(-z) + dot), 400, 1) << z;
        }
        EXPECT_EQ(covered(Fine(wall(.001) + line, integrator).picture()), 0) << "in perspective";
    }
}

// Half of such a line is behind the surface and half before it; edges drawn on faces are seen as a whole.
TEST(StrokesInPictures, WhatLiesInASurfaceIsSeenAsAWhole) {
    const std::string black = square(4, unlit("0 0 0")), line = lines("-1 0 0, 1 0 0", 10), dot = points("0 0 0", 20);
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const auto expectSame = [&](const std::string& eye, const std::string& shapes) {
            const double alone = covered(Fine(eye + aslant(shapes), integrator).picture());
            EXPECT_GT(alone, 300);
            EXPECT_NEAR(covered(Fine(eye + aslant(black + shapes), integrator).picture()), alone, 1) << eye;
        };
        for (const std::string& eye : {kParallel, std::string("Viewpoint { position 0 .3 4 } ")})
            for (const std::string& shapes : {line, dot}) expectSame(eye, shapes);
        // Less than half of a line that is .01 m behind the surface is in front of it.
        const std::string behind = aslant("Transform { translation 0 0 -.01 children [ " + line + " ] }");
        EXPECT_LT(covered(Fine(kParallel + aslant(black) + behind, integrator).picture()), 520);
    }
}

TEST(StrokesInPictures, ThrowShadowsAsThickAsTheyAre) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const std::string wall =
            "NavigationInfo { headlight FALSE } DirectionalLight { direction 0 0 -1 } " + square(10, matte("1 1 1"));
        // They are black, or a path would find their light. The eye is between them and the wall, so that the shadow
        // alone is in the picture.
        const std::string eye = "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] position 0 0 1 } ";
        const double disc = kPi * 100, line = 10 * 100 + kPi * 25;
        EXPECT_NEAR(200 * 200 - covered(Fine(wall + eye + points("0 0 2", 20, "0 0 0"), integrator).picture()), disc,
                    5);
        EXPECT_NEAR(
            200 * 200 - covered(Fine(wall + eye + lines("-1 0 2, 1 0 2", 10, "", "", "0 0 0"), integrator).picture()),
            line, 10);
    }
}

TEST(StrokesInPictures, AreSeenInMirrors) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        EXPECT_NEAR(covered(Fine("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] position 0 0 1 } " +
                                     square(10, mirror("1")) + lines("-1 0 2, 1 0 2", 10),
                                 integrator)
                                .picture()),
                    1000 + kPi * 25, 15);
}

// Half clear, it shows what is behind it in its place.
TEST(StrokesInPictures, ClearOnesLetLightThrough) {
    const std::string clear =
        "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 1 1 transparency .75 } "
        "pointProperties PointProperties { pointSizeScaleFactor 9 } } geometry PointSet { coord "
        "Coordinate { point 0 0 1 } } }";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        LightScene s(clear + square(1, unlit("1 0 0")));
        s.options.settings.integrator = integrator;
        s.options.settings.samplesPerPixel = integrator == Integrator::path ? 4000 : 1;
        expectColor(s.center(), Vec3d(.25 + .75, .25, .25), integrator == Integrator::path ? .04 : 1e-6);
    }
    LightScene shadow("OrthoViewpoint { position 0 0 .5 } DirectionalLight { direction 0 0 -1 } " + clear +
                      square(1, matte("1 1 1")));
    EXPECT_NEAR(shadow.center().r, .75, 1e-5);
}

TEST(StrokesInPictures, DashesAreMeasuredInPixels) {
    // 8 on, 4 off, of a line of 120 pixels and a pixel's width: ten times.
    const std::string dashed = lines("-1.2 0 0, 1.2 0 0", 1, "", "linetype 2");
    EXPECT_NEAR(covered(Fine(kParallel + dashed).picture()), 80, 2);
    EXPECT_NEAR(covered(Fine(kParallel + lines("-1.2 0 0, 1.2 0 0", 1, "", "linetype 2 applied FALSE")).picture()),
                120 + kPi / 4, 2);
}

TEST(StrokesInPictures, PointsShrinkWithDistanceIfToldTo) {
    const auto size = [&](double z) {
        const Picture p =
            Fine("Shape { appearance Appearance { " + unlit("1 1 1") +
                 " pointProperties PointProperties { attenuation 0 1 0 pointSizeScaleFactor 100 pointSizeMinValue 4 "
                 "pointSizeMaxValue 12 } } geometry PointSet { coord Coordinate { point " +
                 fmt::format("0 0 {}", z) + " } } }")
                .picture();
        return std::sqrt(covered(p));
    };
    EXPECT_NEAR(size(5), 12, .2);
    EXPECT_NEAR(size(0), 10, .2);
    EXPECT_NEAR(size(-10), 5, .2);
    EXPECT_NEAR(size(-90), 4, .2);
}

TEST(StrokesInPictures, TheKindsOfClause14) {
    const auto seen = [&](const char* geometry) {
        return covered(Fine(kParallel + std::string("Shape { appearance Appearance { ") + unlit("1 1 1") +
                            " lineProperties LineProperties { linewidthScaleFactor 4 } } geometry " + geometry + " }")
                           .picture());
    };
    EXPECT_NEAR(seen("Circle2D { radius 1 }"), 4 * 2 * kPi * 50, 10);
    EXPECT_NEAR(seen("Arc2D { radius 1 endAngle 1.5707963 }"), 4 * kPi / 2 * 50 + kPi * 4, 5);
    EXPECT_NEAR(seen("Polyline2D { lineSegments [ -1 -1, 1 -1, 1 1 ] }"), 4 * 200 + kPi * 4 - 4 + kPi, 8);
    EXPECT_NEAR(seen("Polypoint2D { point [ -1 -1, 1 1 ] }"), 2, 1e-6);
    EXPECT_NEAR(seen("LineSet { vertexCount [ 2 2 ] coord Coordinate { point [ -1 0 0, 0 0 0, 0 1 0, 1 1 0 ] } }"),
                2 * (4 * 50 + kPi * 4), 5);
}

TEST(StrokesInPictures, FollowTheScene) {
    Fine s(kParallel + lines("-1 0 0, 1 0 0", 10));
    const double ends = kPi * 25;
    EXPECT_NEAR(covered(s.picture()), 1000 + ends, 10);
    ASSERT_TRUE(s.scene.set(s.node("C"), x3d::Coordinate::point, Array<Vec3f>{{-.5f, 1, 0}, {.5f, 1, 0}}));
    s.scene.newFrame(1);
    EXPECT_NEAR(covered(s.picture()), 500 + ends, 10);
    ASSERT_TRUE(s.scene.set(s.node("L"), x3d::LineProperties::linewidthScaleFactor, 20.0f));
    s.scene.newFrame(2);
    EXPECT_NEAR(covered(s.picture()), 1000 + 4 * ends, 15);
    ASSERT_TRUE(s.scene.set(s.node("G"), x3d::IndexedLineSet::coord, NodeId{}));
    s.scene.newFrame(3);
    EXPECT_EQ(covered(s.picture()), 0);
}

TEST(StrokesInPictures, ArePicked) {
    LightScene s(lines("-1 0 0, 1 0 0", 10) + square(1, unlit("1 0 0")));
    const Picker picker(s.world->rays(), s.world->flattener());
    const auto hit = picker.ray({.5, .02, 5}, {0, 0, -1}, 100, .002);
    ASSERT_TRUE(hit && *hit);
    EXPECT_EQ(hit->geometry, s.node("G"));
    EXPECT_NEAR(hit->point.x, .5, 1e-5);
    EXPECT_NEAR(hit->point.y, 0, 1e-6);
    EXPECT_NEAR(hit->distance, 5, 1e-5);
    EXPECT_NEAR(hit->u, .75, 1e-5);
    EXPECT_NEAR(hit->normal.z, 1, 1e-9);
    const auto beside = picker.ray({.5, .06, 5}, {0, 0, -1}, 100, .002);
    ASSERT_TRUE(beside && *beside);
    EXPECT_NE(beside->geometry, s.node("G"));
    const auto none = picker.ray({.5, .02, 5}, {0, 0, -1}, 100, 0);
    ASSERT_TRUE(none && *none);
    EXPECT_NE(none->geometry, s.node("G")) << "without pixels it has no width";
    EXPECT_FALSE(picker.ray({0, 0, 5}, {0, 0, -1}, 100, -1));
    // In a parallel projection they are equally wide at any distance.
    for (const double height : {1., 5., 50.})
        for (const auto& [y, meets] : {std::pair{.045, true}, {.055, false}}) {
            const auto wide = picker.ray({.5, y, height}, {0, 0, -1}, 0, 100, PixelLens{Vec3f(0), {0, 0, -1}, 0, .01f});
            ASSERT_TRUE(wide && *wide);
            EXPECT_EQ(wide->geometry == s.node("G"), meets) << height << " " << y;
        }
    EXPECT_FALSE(picker.ray({0, 0, 5}, {0, 0, -1}, 0, 100, PixelLens{Vec3f(0), {0, 0, -1}, 0, -1}));
}

}  // namespace
}  // namespace rtsg
