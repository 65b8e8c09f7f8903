// Fogs that reach some shapes alone, and depths that authors give, against the formulas of clause 24.
#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

Vec3f seen(const std::string& body, Integrator integrator = Integrator::whitted,
           ColorSpace space = ColorSpace::display) {
    LightScene s(body);
    s.options.settings.integrator = integrator;
    s.options.settings.colorSpace = integrator == Integrator::path ? ColorSpace::linear : space;
    return s.center();
}
/// A red square 10 m from the eye with something beside it in its group.
std::string group(const std::string& beside) {
    return "Group { children [ " + beside + " " + square(5, unlit("1 0 0")) + " ] }";
}

// 24.4.4, 24.4.2: linear (V - d) / V, exponential exp(-d / (V - d)).
TEST(LocalFog, ReachesItsGroupAndWhatIsBelow) {
    const char* fog = "LocalFog { color 0 0 1 visibilityRange 40 }";
    expectColor(seen(group(fog)), {.75, 0, .25}, 1e-6);
    expectColor(seen("Group { children [ " + std::string(fog) + group("") + " ] }"), {.75, 0, .25}, 1e-6);
    expectColor(seen("Group { children [ " + std::string(fog) + " ] } " + group("")), {1, 0, 0}, 0);
    const double f = std::exp(-10. / 30);
    expectColor(seen(group("LocalFog { color 0 0 1 visibilityRange 40 fogType \"EXPONENTIAL\" }")), {f, 0, 1 - f},
                1e-6);
    expectColor(seen(group("LocalFog { color 0 0 1 visibilityRange 40 enabled FALSE }")), {1, 0, 0}, 0);
    // Its range is in its own frame.
    expectColor(seen("Transform { scale 2 2 2 children [ LocalFog { color 0 0 1 visibilityRange 20 } " +
                     square(5, unlit("1 0 0")) + " ] }"),
                {.75, 0, .25}, 1e-6);
}

/// Strips that begin within blocks of pixels, in the fog and not.
TEST(LocalFog, EndsAtThePixelWhereItsShapesDo) {
    const auto strip = [](int from, int to) {
        return fmt::format(
            "Shape {{ appearance Appearance {{ {0} }} geometry IndexedFaceSet {{ coordIndex [ 0 1 2 3 ] coord "
            "Coordinate {{ point [ {1} 0 0, {2} 0 0, {2} 10 0, {1} 10 0 ] }} }} }}",
            unlit("1 0 0"), from, to);
    };
    LightScene s("OrthoViewpoint { fieldOfView [ 0 0 50 10 ] } " + strip(11, 23) +
                     " Group { children [ LocalFog { color 0 0 1 visibilityRange 40 } " + strip(0, 11) + strip(23, 50) +
                     " ] }",
                 50, 10);
    const Picture picture = s.picture();
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 50; ++x) {
            const bool clear = x >= 11 && x < 23;
            expectColor(Vec3f(picture.at(x, y)), clear ? Vec3d(1, 0, 0) : Vec3d(.75, 0, .25), 1e-6);
        }
}

TEST(LocalFog, TheNearestOneCounts) {
    const std::string near = group("LocalFog { color 0 0 1 visibilityRange 40 }");
    expectColor(seen("Fog { color 0 1 0 visibilityRange 20 } " + near), {.75, 0, .25}, 1e-6);
    expectColor(seen("Group { children [ LocalFog { color 0 1 0 visibilityRange 20 } " + near + " ] }"), {.75, 0, .25},
                1e-6);
    expectColor(seen("Fog { color 0 1 0 visibilityRange 20 } " + group("LocalFog { enabled FALSE }")), {.5, .5, 0},
                1e-6);
    expectColor(seen("Fog { color 0 1 0 visibilityRange 20 } " + group("LocalFog { visibilityRange 0 }")), {1, 0, 0},
                1e-6);
    // A thing seen through another has its own fog.
    expectColor(seen("Transform { translation 0 0 5 children [ " +
                     square(5, "material UnlitMaterial { emissiveColor 0 1 0 transparency .5 }") + " ] }" + near),
                {.5 * .75, .5, .5 * .25}, 1e-6);
}

TEST(LocalFog, PathsSeeTheSame) {
    const std::string body = group("LocalFog { color 0 0 .5 visibilityRange 40 }");
    const Vec3f direct = seen(body, Integrator::whitted, ColorSpace::linear);
    expectColor(seen(body, Integrator::path), Vec3d(direct), 1e-6);
    expectColor(direct, {.75, 0, .25 * linearFromSrgb(.5f)}, 1e-6);
}

// If a thing covers a part, that part is fogged by its own distance; the thing behind by its own, once.
TEST(Fog, HidesClearSurfacesByWhatTheyCover) {
    const std::string behind = "Fog { color 0 0 1 visibilityRange 40 } " + square(5, unlit("1 0 0"));
    const auto before = [](const std::string& appearance) {
        return "Transform { translation 0 0 5 children " + square(2, appearance) + " }";
    };
    const Vec3d far(.75, 0, .25), near(0, .875, .125);
    const std::string halfClear = "texture PixelTexture { image 1 1 4 0x00FF0066 } ";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const auto shown = [&](const std::string& body) { return seen(body, integrator, ColorSpace::linear); };
        expectColor(shown(behind + before("material UnlitMaterial { emissiveColor 0 1 0 transparency .4 }")),
                    .6 * near + .4 * far, 1e-4);
        expectColor(shown(behind + before(halfClear + "material UnlitMaterial { }")), .4 * near + .6 * far, 1e-4);
        expectColor(shown(behind + before("material UnlitMaterial { emissiveColor 0 1 0 transparency 1 }")), far, 1e-4);
        expectColor(
            shown(behind + before("material Material { diffuseColor 0 0 0 emissiveColor 0 1 0 transparency .5 }")),
            .5 * near + .5 * far, 1e-4);
        // A mirror is fogged as a whole, and what it shows by the way from it on.
        expectColor(shown("Fog { color 0 0 1 visibilityRange 40 } " + square(5, mirror("1")) +
                          "Transform { translation 0 0 15 children " + square(50, unlit("1 0 0")) + " }"),
                    .75 * Vec3d(.625, 0, .375) + Vec3d(0, 0, .25), 1e-4);
    }
}

/// The rows of a wall of 10 m x 10 m at heights from -5 to 5, seen from 10 m.
std::vector<Vec3f> rowsOfWall(const std::string& fog, Integrator integrator) {
    LightScene s("OrthoViewpoint { fieldOfView [ -5 -5 5 5 ] position 0 0 10 } " + fog + square(5, unlit("1 0 0")), 10,
                 10);
    s.options.settings.integrator = integrator;
    s.options.settings.colorSpace = ColorSpace::linear;
    const Picture picture = s.picture();
    std::vector<Vec3f> rows;
    for (int y = 0; y < 10; ++y) rows.emplace_back(picture.at(5, y));
    return rows;
}

// Castle Game Engine's fields: the depth is the way along the direction, from the fog's own origin, beyond the start.
TEST(Fog, VolumetricOnesThickenAlongTheirDirection) {
    struct Case {
        const char *fog, *what;
        double (*depth)(double height);
        double range = 8;
        bool exponential = false;
    };
    const Case cases[] = {
        {"Fog { color 0 0 1 volumetric TRUE visibilityRange 8 }", "down from the origin", [](double y) { return -y; }},
        {"Fog { color 0 0 1 volumetric TRUE visibilityRange 8 volumetricVisibilityStart -4 }", "from above",
         [](double y) { return -y + 4; }},
        {"Fog { color 0 0 1 volumetric TRUE visibilityRange 8 volumetricDirection 0 30 0 volumetricVisibilityStart 1 }",
         "up, whatever the direction's length", [](double y) { return y - 1; }},
        {"Fog { color 0 0 1 volumetric TRUE visibilityRange 8 fogType \"EXPONENTIAL\" }", "exponential",
         [](double y) { return -y; }, 8, true},
        {"Transform { translation 3 2 1 scale 2 2 2 rotation 0 0 1 3.14159265358979 children Fog { color 0 0 1 "
         "volumetric TRUE visibilityRange 4 volumetricVisibilityStart .5 } }",
         "in the frame of the fog", [](double y) { return y - 2 - 1; }},
        {"LocalFog { color 0 0 1 volumetric TRUE visibilityRange 8 }", "a LocalFog", [](double y) { return -y; }},
        {"Fog { color 0 0 1 volumetricDirection 0 1 0 visibilityRange 20 }", "not volumetric",
         [](double) { return 10.; }, 20},
        {"Fog { color 0 0 1 volumetric TRUE volumetricDirection 0 0 0 visibilityRange 8 }", "without a direction: none",
         [](double) { return 0.; }},
    };
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const Case& c : cases) {
            const std::vector<Vec3f> rows = rowsOfWall(c.fog, integrator);
            for (int row = 0; row < 10; ++row) {
                const double depth = std::clamp(c.depth(4.5 - row), 0., c.range);
                const double left = depth >= c.range ? 0
                                    : c.exponential  ? std::exp(-depth / (c.range - depth))
                                                     : 1 - depth / c.range;
                expectColor(rows[static_cast<std::size_t>(row)], {left, 0, 1 - left}, 1e-5);
            }
            if (testing::Test::HasFailure()) FAIL() << c.what;
        }
}

TEST(Fog, VolumetricOnesLieBeforeVolumesAndBehindGlass) {
    const std::string fog = "Fog { color 0 0 1 volumetric TRUE volumetricDirection 0 0 -1 visibilityRange 20 } ";
    const std::string wall = "Transform { translation 0 0 -5 children " + square(50, unlit("1 0 0")) + " }";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        // By where it is, not by how far light has come: 5 m into the fog behind a pane, and in a mirror.
        expectColor(seen(fog + wall, integrator, ColorSpace::linear), {.75, 0, .25}, 1e-5);
        expectColor(seen(fog + wall + "Transform { translation 0 0 5 children " +
                             square(2, "material UnlitMaterial { emissiveColor 0 1 0 transparency .5 }") + " }",
                         integrator, ColorSpace::linear),
                    {.375, .5, .125}, 1e-5);
        // A small box full of what hides at once, 10 m into the fog.
        expectColor(seen(fog +
                             "Transform { translation 0 0 -10 children VolumeData { dimensions 4 4 .002 voxels "
                             "PixelTexture3D { image [ 4 2 2 2 " +
                             std::string("0xFF0000FF 0xFF0000FF 0xFF0000FF 0xFF0000FF 0xFF0000FF 0xFF0000FF 0xFF0000FF "
                                         "0xFF0000FF") +
                             " ] } renderStyle OpacityMapVolumeStyle { } } }",
                         integrator, ColorSpace::linear),
                    {.5, 0, .5}, 2e-3);
    }
}

TEST(LocalFog, FollowsTheScene) {
    LightScene s("DEF A Group { children [ DEF F LocalFog { color 0 0 1 visibilityRange 40 } " +
                 square(5, unlit("1 0 0")) + " ] }");
    s.options.settings.colorSpace = ColorSpace::display;
    expectColor(s.center(), {.75, 0, .25}, 1e-6);
    ASSERT_TRUE(s.scene.set(s.node("F"), x3d::LocalFog::visibilityRange, 20.f));
    s.scene.newFrame(1);
    expectColor(s.center(), {.5, 0, .5}, 1e-6);
    ASSERT_TRUE(s.scene.set(s.node("F"), x3d::LocalFog::enabled, false));
    s.scene.newFrame(2);
    expectColor(s.center(), {1, 0, 0}, 1e-6);
}

// 24.4.3: depths stand in for the distance.
TEST(FogCoordinate, GivesTheShareOfTheFog) {
    const auto quad = [](const char* depths) {
        return std::string("Shape { appearance Appearance { ") + unlit("1 0 0") +
               " } geometry IndexedFaceSet { coordIndex [ 0 1 2 3 ] fogCoord FogCoordinate { depth [ " + depths +
               " ] } coord Coordinate { point [ -4 -4 0, 4 -4 0, 4 4 0, -4 4 0 ] } } }";
    };
    const std::string fog = "Fog { color 0 0 1 visibilityRange 1000 } ";
    expectColor(seen(fog + quad("0 0 0 0")), {1, 0, 0}, 1e-6);
    expectColor(seen(fog + quad(".25 .25 .25 .25")), {.75, 0, .25}, 1e-6);
    expectColor(seen(fog + quad("0 1 1 0")), {.5, 0, .5}, 1e-4);
    expectColor(seen(quad("1 1 1 1")), {1, 0, 0}, 0);  // no fog, nothing to be hidden by
    expectColor(
        seen("Group { children [ LocalFog { color 0 0 1 visibilityRange 1000 } " + quad(".5 .5 .5 .5") + " ] }"),
        {.5, 0, .5}, 1e-6);
}

TEST(FogCoordinate, OfLinesAndPoints) {
    const std::string fog = "Fog { color 0 0 1 visibilityRange 1000 } ";
    const std::string look =
        "appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } lineProperties LineProperties { "
        "linewidthScaleFactor 9 } "
        "pointProperties PointProperties { pointSizeScaleFactor 9 } } ";
    expectColor(seen(fog + "Shape { " + look +
                     "geometry LineSet { vertexCount 2 fogCoord FogCoordinate { depth [ 0 1 ] } coord Coordinate { "
                     "point [ -2 0 0, 2 0 0 ] } } }"),
                {.5, 0, .5}, .02);
    expectColor(seen(fog + "Shape { " + look +
                     "geometry PointSet { fogCoord FogCoordinate { depth .25 } coord Coordinate { point 0 0 0 } } }"),
                {.75, 0, .25}, 1e-5);
}

}  // namespace
}  // namespace rtsg
