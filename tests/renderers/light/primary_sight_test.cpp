// Hybrid pictures: rays start from what a rasteriser has seen, and find what they would find from the eye.
#include <rtsg/renderers/primary_sight.h>

#include <bit>
#include <cmath>
#include <map>

#include <gmock/gmock.h>

#include <rtsg/renderers/surface_tables.h>

#include "renderers/light/light_scene.h"
#include "renderers/light/volume_scene.h"

namespace rtsg {
namespace {

using namespace test;
using ::testing::HasSubstr;

const Vec4f kPainted(1, 0, 1, 1);  // what nothing in the scenes shows

/// A scene whose sight is made by rays, with colours that no ray would find.
struct Sighted : LightScene {
    explicit Sighted(const std::string& body, int width = 48, int height = 36) : LightScene(body, width, height) {
        world->add(tables);
    }
    ~Sighted() { world->remove(tables); }
    PrimarySight sight() {
        ImageOptions data = options;
        data.settings.layers = kDepth | kNode;
        const auto drawn = light->picture(data);
        PrimarySight seen;
        EXPECT_TRUE(drawn);
        if (!drawn) return seen;
        std::map<std::uint32_t, std::uint32_t> slots;
        for (const Instance& instance : world->flattener().instances())
            if (instance.id) slots[instance.shape.value] = instance.id.slot;
        seen.width = options.settings.width, seen.height = options.settings.height;
        for (const PictureLayer& layer : drawn->layers)
            for (const float value : layer.values) {
                const auto node = std::bit_cast<std::uint32_t>(value);
                if (layer.channels[0] == "Z")
                    seen.depths.push_back(value);
                else
                    seen.instances.push_back(slots.contains(node) ? slots[node] : kNoInstance);
            }
        seen.colors.assign(seen.depths.size(), kPainted);
        return seen;
    }
    Result<Picture> hybrid(const PrimarySight& sight) {
        const std::vector<PrimarySight> all{sight};
        return tables.latest().trace(world->rays(), light->camera(), options.settings, all, &stats);
    }
    SurfaceTables tables;
};

std::string at(const char* position, const std::string& what) {
    return std::string("Transform { translation ") + position + " children " + what + " }\n";
}
std::string ball(const std::string& material) {
    return "Shape { appearance Appearance { " + material + " } geometry Sphere { } }";
}
/// Pixels that are other by more than rounding.
int countOther(const Picture& a, const Picture& b) {
    int count = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) count += glm::distance(a.pixels[i], b.pixels[i]) > 1e-3f;
    return count;
}

const std::string kScene =
    "Viewpoint { position 0 1 9 }\nDirectionalLight { direction -1 -2 -1 }\n"
    "Background { skyColor .2 .4 .8 }\n" +
    at("0 -1.6 0", "Shape { appearance Appearance { " + matte(".6 .6 .5") + " } geometry Box { size 8 1 6 } }") +
    at("-2.2 0 0", ball(mirror(".8"))) + at("0 0 0", ball(matte(".8 .2 .1"))) + at("2.2 0 0", ball(unlit("0 1 0")));

TEST(PrimarySights, RaysFindWhatTheyFindFromTheEye) {
    Sighted s(kScene);
    const Picture traced = s.picture();
    const PrimarySight sight = s.sight();
    const auto drawn = s.hybrid(sight);
    ASSERT_TRUE(drawn) << drawn.error().format();
    std::size_t stayed = 0, wrong = 0;
    for (std::size_t i = 0; i < drawn->pixels.size(); ++i) {
        if (drawn->pixels[i] == kPainted) {
            ++stayed;
            const Vec3f from(traced.pixels[i]);
            // The unlit ball and the sky are all that needs no ray.
            wrong += glm::distance(from, Vec3f(0, 1, 0)) > .01f && glm::distance(from, Vec3f(.2f, .4f, .8f)) > .01f;
        } else {
            wrong += glm::distance(drawn->pixels[i], traced.pixels[i]) > 1e-3f;
        }
    }
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(stayed, 500u);
    EXPECT_EQ(s.stats.primaryRays, drawn->pixels.size() - stayed);
    EXPECT_GT(s.stats.shadowRays, 0u);
    EXPECT_GT(s.stats.secondaryRays, 0u);
}

// A depth that is off, or of what rays see another thing of, only costs time.
TEST(PrimarySights, RaysGoTheirWholeWayWhereNothingLiesAtTheDepth) {
    Sighted s(kScene);
    const Picture traced = s.picture();
    for (const float factor : {.98f, 1.02f, 0.f, -1.f, std::nanf(""), INFINITY}) {
        PrimarySight sight = s.sight();
        for (float& depth : sight.depths) depth *= factor;
        sight.colors = traced.pixels;
        const auto drawn = s.hybrid(sight);
        ASSERT_TRUE(drawn);
        EXPECT_LE(countOther(traced, *drawn), 2) << factor;
    }
}

TEST(PrimarySights, WhatIsUnnamedIsLeftToRays) {
    Sighted s(kScene);
    PrimarySight sight = s.sight();
    for (const std::uint32_t unnamed : {kUnnamedInstance, std::uint32_t{1'000'000}}) {
        sight.instances.assign(sight.instances.size(), unnamed);
        const auto drawn = s.hybrid(sight);
        ASSERT_TRUE(drawn);
        EXPECT_EQ(countOther(s.picture(), *drawn), 0);
        EXPECT_EQ(s.stats.primaryRays, drawn->pixels.size());
    }
}

// Clear things, volumes and other spaces of colours leave nothing of the rasteriser's colours.
TEST(PrimarySights, ColoursStayOnlyWhereRaysWouldAddNothing) {
    const std::string light = "DirectionalLight { direction 0 0 -1 }\n";
    const std::string plain = ball(matte("1 0 0"));
    struct Case {
        std::string body;
        bool stays;
        Shadows shadows = Shadows::none;
        ColorSpace space = ColorSpace::automatic;
    };
    for (const Case& c :
         {Case{light + plain, true}, Case{light + plain, false, Shadows::all},
          Case{ball(unlit("1 0 0")), true, Shadows::all}, Case{light + plain, false, Shadows::none, ColorSpace::linear},
          Case{ball(unlit("1 0 0")), false, Shadows::none, ColorSpace::linear},
          Case{"NavigationInfo { headlight TRUE }\n" + plain, true, Shadows::all},
          Case{"Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 ] coord Coordinate { point [ -9 -9 "
               "0, 9 -9 0, 0 9 0 ] } color ColorRGBA { color [ 1 0 0 .5, 1 0 0 .5, 1 0 0 .5 ] } } }\n",
               false},
          Case{"TextureProjectorParallel { location 0 0 4 direction 0 0 -1 fieldOfView -3 -3 3 3 texture "
               "PixelTexture { image 1 1 3 "
               "0xFFFFFF } }\n" +
                   plain,
               false},
          Case{
              "Shape { appearance Appearance { material UnlitMaterial { } texture PixelTexture { image 1 1 3 0xFF0000 "
              "} } "
              "geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 ] coord Coordinate { point [ -9 -9 0, 9 -9 0, 0 9 0 ] } "
              "texCoord TextureCoordinateGenerator { mode \"SPHERE\" } } }\n",
              false},
          Case{light + ball(mirror(".5")), false}, Case{light + ball(glass(1.5)), false},
          Case{light + ball("material Material { transparency .5 }"), false},
          Case{"NavigationInfo { headlight TRUE }\nGroup { children [ PointLight { global FALSE location 9 9 9 } " +
                   at("4 0 0", plain) + "] }\n" + plain,
               true, Shadows::all},
          Case{"EnvironmentLight { }\n" + plain, false}}) {
        Sighted s(c.body);
        s.options.settings.shadows = c.shadows, s.options.settings.colorSpace = c.space;
        const auto drawn = s.hybrid(s.sight());
        ASSERT_TRUE(drawn) << drawn.error().format();
        EXPECT_EQ(drawn->at(24, 18) == kPainted, c.stays) << c.body;
        EXPECT_EQ(drawn->at(0, 0) == kPainted, c.space == ColorSpace::automatic) << c.body;
    }
}

// Layers that need a depth march to it from the eye, and so does the sky.
TEST(PrimarySights, VolumesAreBeforeWhatWasSeen) {
    Sighted s("Viewpoint { position 0 0 6 }\n" + volume(evenVoxels(120, 2, 2, 2)) +
              at("0.6 0 -3", "Shape { appearance Appearance { " + unlit("1 0 0") + " } geometry Box { } }"));
    PrimarySight sight = s.sight();
    std::uint32_t box = kNoInstance;
    for (const Instance& instance : s.world->flattener().instances())
        if (instance.id && !instance.volume) box = instance.id.slot;
    // The volume is no surface: a rasteriser sees the box behind it, or the sky.
    for (std::uint32_t& instance : sight.instances)
        if (instance != box) instance = kNoInstance;
    const auto drawn = s.hybrid(sight);
    ASSERT_TRUE(drawn);
    const Picture traced = s.picture();
    EXPECT_EQ(countOther(traced, *drawn), 0);
    EXPECT_GT(glm::distance(traced.at(20, 18), traced.at(0, 0)), .05f) << "the volume is seen";
}

TEST(PrimarySights, SamplesLieWhereTheRasteriserHasThem) {
    Sighted s(kScene);
    PrimarySight sight = s.sight();
    sight.instances.assign(sight.instances.size(), kUnnamedInstance);
    const auto through = [&](Vec2d point) {
        sight.position = point;
        auto drawn = s.hybrid(sight);
        EXPECT_TRUE(drawn);
        return drawn ? std::move(*drawn) : Picture(48, 36);
    };
    const Picture left = through({0, .5}), right = through({1, .5}), top = through({.5, 0}), low = through({.5, 1});
    int aside = 0, downwards = 0;
    for (int y = 0; y + 1 < 36; ++y)
        for (int x = 0; x + 1 < 48; ++x) {
            aside += glm::distance(right.at(x, y), left.at(x + 1, y)) > .02f;
            downwards += glm::distance(low.at(x, y), top.at(x, y + 1)) > .02f;
        }
    EXPECT_LE(aside, 20);
    EXPECT_LE(downwards, 20);
    EXPECT_GT(countOther(left, right), 100);
}

TEST(PrimarySights, ThoseOfAnotherPictureAreErrors) {
    Sighted s(kScene);
    const PrimarySight sight = s.sight();
    const auto refused = [&](auto change, const char* what) {
        PrimarySight other = sight;
        const RenderSettings before = s.options.settings;
        change(other, s.options.settings);
        const auto drawn = s.hybrid(other);
        s.options.settings = before;
        ASSERT_FALSE(drawn) << what;
        EXPECT_THAT(drawn.error().text, HasSubstr(what));
    };
    refused([](PrimarySight& o, RenderSettings&) { o.width = 47; }, "48 x 36");
    refused([](PrimarySight& o, RenderSettings&) { o.colors.pop_back(); }, "48 x 36");
    refused([](PrimarySight& o, RenderSettings&) { o.depths.clear(); }, "48 x 36");
    refused([](PrimarySight& o, RenderSettings&) { o.position.x = std::nan(""); }, "no place");
    refused([](PrimarySight& o, RenderSettings&) { o.samples = 0; }, "no place");
    refused([](PrimarySight&, RenderSettings& r) { r.samplesPerPixel = 4; }, "several samples");
    refused([](PrimarySight&, RenderSettings& r) { r.integrator = Integrator::path; }, "paths");
    refused([](PrimarySight&, RenderSettings& r) { r.layers = kDepth; }, "layers of data");
    refused([](PrimarySight&, RenderSettings& r) { r.width = 0; }, "0 x 36");
    EXPECT_FALSE(s.tables.latest().trace(s.world->rays(), s.light->camera(), s.options.settings, {}));
}

}  // namespace
}  // namespace rtsg
