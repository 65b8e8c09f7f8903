// Picks and pointers meet what pictures show: not the backs of solids, nor what masks, hatches and alpha leave clear.
#include <cmath>
#include <random>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/world_queries.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using test::LightScene;

constexpr int kSeenSide = 64;

std::string wallBeforeSensor(const std::string& wall) {
    return "OrthoViewpoint { position 0 0 10 fieldOfView [ -1 -1 1 1 ] }\n"
           "Group { children [ DEF TS TouchSensor { } DEF RED Shape { appearance Appearance { material UnlitMaterial "
           "{ emissiveColor 1 0 0 } } geometry Rectangle2D { size 2 2 } } ] }\n"
           "Transform { translation 0 0 1 children DEF WALL Shape { " +
           wall + " } }\n";
}

struct Wall {
    std::string what, shape;
    const char* met;
};

const std::string kFaces = "coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] } coordIndex [ 0 1 2 3 -1 ] ";
const std::string kBackwards =
    "coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] } coordIndex [ 3 2 1 0 -1 ] ";

std::vector<Wall> seenWalls() {
    const std::string plain = "appearance Appearance { material UnlitMaterial { } } ";
    const auto fill = [](const std::string& how) {
        return "appearance Appearance { material UnlitMaterial { } fillProperties FillProperties { " + how +
               " } } geometry Rectangle2D { size 2 2 }";
    };
    const auto masked = [](const std::string& mode, const std::string& alpha) {
        return "appearance Appearance { alphaMode \"" + mode +
               "\" material UnlitMaterial { emissiveTexture PixelTexture { image 1 1 4 0x00ff00" + alpha +
               " } } } geometry Rectangle2D { size 2 2 }";
    };
    const auto colored = [&](const std::string& alpha) {
        return plain + "geometry IndexedFaceSet { " + kFaces + "color ColorRGBA { color [ 0 1 0 " + alpha + ", 0 1 0 " +
               alpha + ", 0 1 0 " + alpha + ", 0 1 0 " + alpha + " ] } }";
    };
    return {
        {"the back of a solid", plain + "geometry IndexedFaceSet { " + kBackwards + "}", "RED"},
        {"its front", plain + "geometry IndexedFaceSet { " + kFaces + "}", "WALL"},
        {"the back of what is none", plain + "geometry IndexedFaceSet { solid FALSE " + kBackwards + "}", "WALL"},
        {"neither filled nor hatched", fill("filled FALSE hatched FALSE"), "RED"},
        {"not filled, but hatched: a pointer meets its lines", fill("filled FALSE"), "WALL"},
        {"a mask's clear texel", masked("MASK", "20"), "RED"},
        {"its opaque one", masked("MASK", "c0"), "WALL"},
        {"a texel of no alpha", masked("AUTO", "00"), "RED"},
        {"one of little", masked("AUTO", "10"), "WALL"},
        {"one that does not count", masked("OPAQUE", "00"), "WALL"},
        {"colours without alpha", colored("0"), "RED"},
        {"colours with some", colored(".5"), "WALL"},
        {"clear by its Material alone",
         "appearance Appearance { material UnlitMaterial { transparency 1 } } geometry Rectangle2D { size 2 2 }",
         "WALL"},
    };
}

Result<Pick> pickAt(LightScene& s, double x, double y) {
    const RayWorld& rays = s.world->rays();
    const LightTracer& tracer = s.light->tracer();
    const auto camera = tracer.camera(rays, 1);
    if (!camera) return std::unexpected(camera.error());
    return tracer.pick(Picker(rays, s.world->flattener()), rays, tracer.layers(rays, *camera, kSeenSide, kSeenSide), x,
                       y);
}

TEST(SeenSurfaces, PointersAndPicksGoThroughWhatIsNotThere) {
    for (const Wall& wall : seenWalls()) {
        SCOPED_TRACE(wall.what);
        LightScene s(wallBeforeSensor(wall.shape), kSeenSide, kSeenSide);
        WorldQueries queries(*s.world);
        s.scene.setSpaceQueries(&queries);
        const auto hit = queries.firstHit({.3, .3, 10}, {0, 0, -1});
        ASSERT_TRUE(hit);
        EXPECT_EQ(hit->path.back(), s.node(wall.met));
        PointerInput input;
        input.origin = {.3, .3, 10};
        ASSERT_TRUE(sendPointer(s.scene, input));
        s.scene.newFrame(1);
        EXPECT_EQ(s.scene.node(s.node("TS")).get(x3d::TouchSensor::isOver), std::string(wall.met) == "RED");
        const auto onLine = pickAt(s, 42.5, 31.5), off = pickAt(s, 42.5, 29.5);
        ASSERT_TRUE(onLine && off);
        EXPECT_EQ(onLine->shape, s.node(wall.met));
        EXPECT_EQ(off->shape, s.node(wall.what.starts_with("not filled") ? "RED" : wall.met)) << "a picture's pixel";
        s.scene.setSpaceQueries(nullptr);
    }
}

TEST(SeenSurfaces, OtherQueriesGoByGeometry) {
    LightScene s(wallBeforeSensor(seenWalls()[0].shape), kSeenSide, kSeenSide);
    WorldQueries queries(*s.world);
    EXPECT_EQ(queries.crossings({.3, .3, 10}, {0, 0, -1}, 20).size(), 2u);
    EXPECT_EQ(queries.obstacles({.3, .3, 10}, {0, 0, -1}, 20).size(), 2u);
    EXPECT_EQ(queries.within({.3, .3, 1.1}, .5).size(), 1u);
    const auto ray = Picker(s.world->rays(), s.world->flattener()).ray({.3, .3, 10}, {0, 0, -1});
    ASSERT_TRUE(ray);
    EXPECT_EQ(ray->shape, s.node("WALL"));
}

TEST(SeenSurfaces, AnEditCountsAtOnce) {
    LightScene s(wallBeforeSensor("appearance DEF A Appearance { material UnlitMaterial { } fillProperties DEF F "
                                  "FillProperties { filled FALSE hatched FALSE } } geometry Rectangle2D { size 2 2 }"),
                 kSeenSide, kSeenSide);
    WorldQueries queries(*s.world);
    const auto met = [&] { return queries.firstHit({.3, .3, 10}, {0, 0, -1})->path.back(); };
    EXPECT_EQ(met(), s.node("RED"));
    ASSERT_TRUE(s.scene.set(s.node("F"), x3d::FillProperties::filled, true));
    EXPECT_EQ(met(), s.node("WALL"));
}

/// Faces here and there, each of a colour of its own: number / 255 as red.
std::string randomFaces(std::mt19937& random, int count, bool lines) {
    std::uniform_real_distribution<double> at(-4, 4), angle(-1.1, 1.1), size(1, 3), unit(0, 1);
    std::ostringstream text;
    for (int i = 1; i <= count; ++i) {
        const double red = i / 255.0;
        const int kind = static_cast<int>(unit(random) * 4);
        const bool isTurned = unit(random) < .5, isSolid = unit(random) < .8;
        text << "Transform { translation " << at(random) << ' ' << at(random) << ' ' << at(random) << " rotation 0 1 0 "
             << angle(random) + (isTurned ? std::numbers::pi : 0) << " scale " << size(random) << ' ' << size(random)
             << " 1 children DEF S" << i << " Shape { appearance Appearance { material UnlitMaterial { emissiveColor "
             << red << " 0 0 } ";
        if (kind == 1) {
            text << "alphaMode \"MASK\" texture PixelTexture { image 4 4 2";
            for (int k = 0; k < 16; ++k) text << (unit(random) < .5 ? " 0xff00" : " 0xffff");
            text << " } ";
        }
        if (kind == 2)
            text << "fillProperties FillProperties { filled FALSE hatched " << (lines ? "TRUE" : "FALSE")
                 << " hatchStyle " << (unit(random) < .5 ? 1 : 5) << " hatchColor " << red << " 0 0 } ";
        text << "} geometry IndexedFaceSet { solid " << (isSolid ? "TRUE " : "FALSE ") << kFaces;
        if (kind == 3)
            text << "colorPerVertex FALSE color ColorRGBA { color [ " << red << " 0 0 " << (unit(random) < .5 ? 0 : 1)
                 << " ] } ";
        text << "} } }\n";
    }
    return text.str();
}

TEST(SeenSurfaces, AreThoseOfEveryPixel) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 random(seed);
        const bool lines = seed % 2 == 0, isParallel = seed % 3 == 0;
        LightScene s((isParallel ? "OrthoViewpoint { position 0 0 12 fieldOfView [ -5 -5 5 5 ] }\n"
                                 : "Viewpoint { position 0 0 12 }\n") +
                         randomFaces(random, 60, lines),
                     kSeenSide, kSeenSide);
        const Picture picture = s.picture();
        const RayWorld& rays = s.world->rays();
        const auto camera = s.light->tracer().camera(rays, 1);
        ASSERT_TRUE(camera);
        WorldQueries queries(*s.world);
        int shown = 0, through = 0;
        for (int y = 0; y < kSeenSide; ++y)
            for (int x = 0; x < kSeenSide; ++x) {
                const auto number = static_cast<int>(std::lround(picture.at(x, y).r * 255));
                const NodeId expected = number > 0 ? s.node(("S" + std::to_string(number)).c_str()) : NodeId();
                shown += number > 0;
                const auto pick = pickAt(s, x + .5, y + .5);
                ASSERT_TRUE(pick);
                EXPECT_EQ(pick->shape, expected) << x << ' ' << y;
                const Camera::WorldRay ray = camera->ray((x + .5) / kSeenSide, (y + .5) / kSeenSide);
                const auto first = Picker(rays, s.world->flattener()).ray(ray.origin, ray.direction);
                through += first && first->shape != expected;
                if (lines) continue;  // which lie anywhere for a pointer
                const auto hit = queries.firstHit(ray.origin, ray.direction);
                EXPECT_EQ(hit ? hit->path.back() : NodeId(), expected) << x << ' ' << y;
            }
        EXPECT_GT(shown, kSeenSide * kSeenSide / 4);
        EXPECT_GT(through, kSeenSide * kSeenSide / 8) << "what would be in the way";
    }
}

}  // namespace
}  // namespace rtsg
