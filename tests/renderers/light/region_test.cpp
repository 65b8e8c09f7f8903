// Regions of pictures: whatever a picture is divided into, its parts have the bits of the whole, in all that it holds.
#include <algorithm>
#include <cstring>
#include <random>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picture_tiles.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// Mirrors, glass, shadows, a clear thing, lines, text, and things that move.
std::string mixedScene() {
    return "DEF SKY Background { skyColor [ .2 .3 .5, .8 .8 .9 ] skyAngle [ 1.57 ] groundColor [ .1 .1 .1 ] } "
           "NavigationInfo { headlight FALSE } DEF EYE Viewpoint { position 0 1.5 9 } "
           "DirectionalLight { direction 1 -2 -1 intensity .5 } PointLight { location -3 5 3 intensity .6 } "
           "Transform { translation 0 -1.6 0 children Shape { appearance Appearance { material DEF RED Material { "
           "diffuseColor .8 .3 .2 } } geometry Box { size 14 .2 14 } } } "
           "Transform { translation 2 1 -2 children Shape { appearance Appearance { " +
           mirror(".8") +
           " } geometry Box { size 3 3 .2 } } } Transform { translation -1.5 0 1 children Shape { "
           "appearance Appearance { " +
           glass(1.5) +
           " } geometry Sphere { } } } "
           "DEF BALL Transform { translation 1 0 2 children Shape { appearance Appearance { material PhysicalMaterial "
           "{ "
           "baseColor .2 .6 .9 metallic .3 roughness .3 } } geometry Sphere { radius .7 } } } "
           "Transform { translation 0 2.6 0 children Shape { appearance Appearance { material Material { transparency "
           ".5 "
           "emissiveColor .4 .5 .1 } } geometry Box { size 2 .5 .5 } } } "
           "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 1 0 } } geometry IndexedLineSet { "
           "coordIndex [ 0 1 2 ] coord Coordinate { point [ -4 0 2, 0 3 1, 4 0 2 ] } } }";
}
/// The same under a clear layer in a part of the picture, and one without anything.
std::string layeredScene() {
    return mixedScene() +
           " LayerSet { order [ 0 1 2 ] layers [ Layer { viewport Viewport { clipBoundary [ .31 .9 .27 .83 ] } "
           "children [ NavigationInfo { headlight TRUE } Viewpoint { position 0 0 5 } Shape { appearance Appearance { "
           "material Material { diffuseColor .1 .9 .4 } } geometry Cone { } } ] } Layer { } ] }";
}
/// A scene with a cube map that must be made before the picture.
std::string generatedScene() {
    return mixedScene() +
           " Transform { translation 0 0 3 children Shape { appearance Appearance { material Material { } texture "
           "GeneratedCubeMapTexture { update \"ALWAYS\" size 16 } } geometry Sphere { radius .5 } } }";
}

bool haveSameBits(const std::vector<float>& a, const std::vector<float>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}
void expectSamePictures(const Picture& whole, const Picture& joined, const std::string& what) {
    ASSERT_EQ(whole.width, joined.width) << what;
    ASSERT_EQ(whole.height, joined.height) << what;
    EXPECT_EQ(whole.space, joined.space) << what;
    EXPECT_EQ(whole.notes, joined.notes) << what;
    ASSERT_EQ(whole.interval.size(), joined.interval.size()) << what;
    ASSERT_EQ(whole.layers.size(), joined.layers.size()) << what;
    std::size_t differ = 0;
    for (std::size_t i = 0; i < whole.pixels.size(); ++i)
        differ += std::memcmp(&whole.pixels[i], &joined.pixels[i], sizeof(Vec4f)) != 0;
    EXPECT_EQ(differ, 0u) << what << ": pixels";
    differ = 0;
    for (std::size_t i = 0; i < whole.interval.size(); ++i) differ += whole.interval[i] != joined.interval[i];
    EXPECT_EQ(differ, 0u) << what << ": intervals";
    for (std::size_t i = 0; i < whole.layers.size(); ++i)
        EXPECT_TRUE(haveSameBits(whole.layers[i].values, joined.layers[i].values))
            << what << ": layer " << whole.layers[i].channels[0];
}

class Regions : public testing::Test {
  protected:
    std::mt19937 random{20261130};
    int pick(int minimum, int maximum) { return std::uniform_int_distribution(minimum, maximum)(random); }

    /// Edges of a random division, wherever they fall.
    std::vector<int> edges(int size) {
        std::vector<int> all{0, size};
        for (int i = pick(0, 3); i > 0; --i) all.push_back(pick(0, size));
        std::ranges::sort(all);
        all.erase(std::ranges::unique(all).begin(), all.end());
        return all;
    }
    Picture joined(const Picture& like, const std::vector<PixelRegion>& regions,
                   const std::function<Picture(const PixelRegion&)>& make) {
        Picture whole(like.width, like.height, Vec4f(-1));
        for (const PixelRegion& region : regions) {
            const Picture part = make(region);
            EXPECT_EQ(part.width, region.width);
            EXPECT_EQ(part.height, region.height);
            if (whole.layers.empty() && whole.interval.empty()) {
                whole.space = part.space, whole.notes = part.notes;
                if (!part.interval.empty()) whole.interval.resize(whole.pixels.size());
                for (const PictureLayer& layer : part.layers)
                    whole.layers.push_back({layer.channels, layer.integers,
                                            std::vector<float>(whole.pixels.size() * layer.channels.size())});
            }
            layTile(part, region.left, region.top, whole);
        }
        return whole;
    }
    std::vector<PixelRegion> division(int width, int height) {
        std::vector<PixelRegion> all;
        const std::vector<int> across = edges(width), down = edges(height);
        for (std::size_t y = 0; y + 1 < down.size(); ++y)
            for (std::size_t x = 0; x + 1 < across.size(); ++x)
                all.push_back({across[x], down[y], across[x + 1] - across[x], down[y + 1] - down[y]});
        std::ranges::shuffle(all, random);
        return all;
    }
    void expectPartsOfTheWhole(LightScene& s, const std::string& what) {
        s.options.settings.width = pick(1, 75), s.options.settings.height = pick(1, 60);
        const Picture whole = s.picture();
        const auto regions = division(whole.width, whole.height);
        const Picture parts = joined(whole, regions, [&](const PixelRegion& region) {
            s.options.settings.region = region;
            return s.picture();
        });
        s.options.settings.region = {};
        expectSamePictures(whole, parts, fmt::format("{}, {} x {}", what, whole.width, whole.height));
    }
};

TEST_F(Regions, HaveTheBitsOfTheWhole) {
    struct Kind {
        const char* name;
        std::string scene;
        void (*set)(ImageOptions&);
    };
    const Kind kinds[] = {
        {"whitted", mixedScene(), [](ImageOptions&) {}},
        {"several samples", mixedScene(), [](ImageOptions& o) { o.settings.samplesPerPixel = 3; }},
        {"paths", mixedScene(),
         [](ImageOptions& o) { o.settings.integrator = Integrator::path, o.settings.samplesPerPixel = 2; }},
        {"data", mixedScene(),
         [](ImageOptions& o) { o.settings.layers = kAllLayers & ~kMotion, o.settings.samplesPerPixel = 2; }},
        {"light", mixedScene(), [](ImageOptions& o) { o.settings.colorSpace = ColorSpace::linear; }},
        {"a panorama", mixedScene(), [](ImageOptions& o) { o.panorama = true; }},
        {"a lens", mixedScene(),
         [](ImageOptions& o) { o.lensRadius = .2, o.focus = 8, o.settings.samplesPerPixel = 4; }},
        {"layers", layeredScene(), [](ImageOptions& o) { o.settings.layers = kAllLayers & ~kMotion; }},
        {"layers by paths", layeredScene(),
         [](ImageOptions& o) { o.settings.integrator = Integrator::path, o.settings.samplesPerPixel = 4; }},
        {"cubes", generatedScene(), [](ImageOptions& o) { o.settings.samplesPerPixel = 2; }},
    };
    for (const Kind& kind : kinds) {
        LightScene s(kind.scene);
        kind.set(s.options);
        for (int round = 0; round < 3; ++round) expectPartsOfTheWhole(s, kind.name);
    }
}

/// A region that is sampled to an error reaches it by itself: that of its own pixels.
TEST_F(Regions, ReachAnErrorByThemselves) {
    LightScene s(mixedScene(), 48, 32);
    s.options.settings.error = .1f, s.options.settings.samplesPerPixel = 1024;
    for (const int left : {0, 16, 32}) {
        s.options.settings.region = {left, 0, 16, 32};
        const Picture part = s.picture();
        EXPECT_EQ(part.width, 16);
        EXPECT_EQ(part.interval.size(), part.pixels.size());
        EXPECT_LE(s.stats.error, .1f);
        EXPECT_EQ(s.stats.unreached, 0);
    }
}

/// Each part knows the movements since the picture before.
TEST_F(Regions, KnowThePictureBefore) {
    LightScene s(mixedScene());
    s.options.settings.samplesPerPixel = 4, s.options.settings.shutter = .7f, s.options.settings.layers = kMotion;
    const auto before = std::make_shared<PictureBefore>();
    before->world = s.world->present().value()->rays;
    before->camera = s.light->tracer().camera(s.world->rays(), 1).value();
    s.options.settings.before = before;
    EXPECT_TRUE(s.scene.set(s.node("BALL"), x3d::Transform::translation, Vec3f(2, .5f, 2)));
    EXPECT_TRUE(s.scene.set(s.node("EYE"), x3d::Viewpoint::position, Vec3f(.2f, 1.5f, 9)));
    s.scene.newFrame(1);
    for (int round = 0; round < 3; ++round) expectPartsOfTheWhole(s, "a shutter");
}

/// Pictures that follow each other keep tiles of their own regions.
TEST_F(Regions, OfPicturesInARowAreKept) {
    for (const bool layers : {false, true}) {
        const std::string body = layers ? layeredScene() : mixedScene();
        LightScene whole(body, 61, 47);
        const std::vector<PixelRegion> regions = division(61, 47);
        std::vector<std::unique_ptr<LightScene>> parts;
        for (std::size_t i = 0; i < regions.size(); ++i) parts.push_back(std::make_unique<LightScene>(body, 61, 47));
        double kept = 0;
        for (int frame = 1; frame < 6; ++frame) {
            const auto next = [&](LightScene& s) {
                EXPECT_TRUE(
                    s.scene.set(s.node("BALL"), x3d::Transform::translation, Vec3f(1 + .2f * float(frame / 2), 0, 2)));
                s.scene.newFrame(frame);
                return s.light->nextPicture(s.options, &s.stats).value();
            };
            const Picture one = next(whole);
            const Picture all = joined(one, regions, [&](const PixelRegion& region) {
                const auto at = static_cast<std::size_t>(std::ranges::find(regions, region) - regions.begin());
                parts[at]->options.settings.region = region;
                Picture part = next(*parts[at]);
                kept += parts[at]->stats.kept;
                return part;
            });
            expectSamePictures(one, all, fmt::format("frame {}", frame));
        }
        EXPECT_GT(kept, 0);
    }
}

/// One that adds samples to the last does so where only a part of its tiles is shown.
TEST_F(Regions, AreRefined) {
    LightScene whole(mixedScene(), 50, 40), part(mixedScene(), 50, 40);
    const PixelRegion region{5, 9, 30, 20};
    for (LightScene* s : {&whole, &part}) s->options.settings.integrator = Integrator::path, s->options.refine = true;
    part.options.settings.region = region;
    for (int round = 0; round < 3; ++round) {
        const Picture all = whole.light->nextPicture(whole.options).value();
        const Picture shown = part.light->nextPicture(part.options, &part.stats).value();
        ASSERT_EQ(shown.width, region.width);
        for (int y = 0; y < region.height; ++y)
            for (int x = 0; x < region.width; ++x)
                ASSERT_EQ(shown.at(x, y), all.at(region.left + x, region.top + y)) << round << ' ' << x << ' ' << y;
    }
    EXPECT_EQ(part.stats.samples, 3);
}

TEST_F(Regions, CostTheirShare) {
    LightScene s(mixedScene(), 160, 160);
    s.picture();
    const auto all = s.stats.primaryRays;
    s.options.settings.region = {32, 64, 16, 32};
    s.picture();
    EXPECT_EQ(s.stats.primaryRays, all / 50);
}

TEST_F(Regions, OutsideOfThePictureAreRefused) {
    LightScene s(mixedScene(), 20, 10);
    for (const PixelRegion region :
         {PixelRegion{0, 0, 21, 10}, {-1, 0, 5, 5}, {0, 6, 5, 5}, {3, 3, 0, 5}, {0, 0, 5, -1}, {2147483647, 0, 5, 5}}) {
        s.options.settings.region = region;
        const auto created = s.light->picture(s.options);
        ASSERT_FALSE(created);
        EXPECT_NE(created.error().text.find("is not in a picture of 20 x 10"), std::string::npos)
            << created.error().text;
    }
    s.options.settings.region = {0, 0, 5, 5}, s.options.stereo = Stereo::beside;
    EXPECT_FALSE(s.light->picture(s.options));
}

}  // namespace
}  // namespace rtsg
