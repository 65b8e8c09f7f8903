// Text in pictures: seen, mirrored, throwing shadows and picked; by how much of the picture it covers.
#include <rtsg/core/x3d.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/tessellate.h>

#include "light_scene.h"
#include "support/written_font.h"

namespace rtsg {
namespace {

using namespace test;

const std::string kLetters =
    "geometry Text { string [ \"ho\" \"%\" ] fontStyle FontStyle { justify [ \"MIDDLE\" \"MIDDLE\" ] size 1 } }";

double inkArea() {
    TextParams p;
    p.strings = {"ho", "%"};
    p.major = p.minor = TextParams::Justify::middle;
    return surfaceArea(tessellate(p));
}
/// Metres squared, of a picture 4 m wide and high.
double litPixels(const Picture& p, float level) {
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel.r / level;
    return sum * 16 / (double(p.width) * p.height);
}

TEST(TextInPictures, CoversItsAreaInBothIntegrators) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        LightScene s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } Shape { appearance Appearance { " + unlit("1 1 1") +
                         " } " + kLetters + " }",
                     200, 200);
        s.options.settings.integrator = integrator;
        s.options.settings.samplesPerPixel = 4;
        EXPECT_NEAR(litPixels(s.picture(), 1), inkArea(), .01 * inkArea());
    }
}

TEST(TextInPictures, ThrowsItsShadow) {
    LightScene s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } DirectionalLight { direction 0 0 -1 }" +
                     square(10, matte("1 1 1")) + "Transform { translation 0 0 20 children Shape { " + kLetters +
                     " } }",
                 200, 200);
    s.options.settings.samplesPerPixel = 4;
    EXPECT_NEAR(16 - litPixels(s.picture(), 1), inkArea(), .01 * inkArea());
}

TEST(TextInPictures, IsSeenInAMirror) {
    LightScene s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } " + square(10, mirror("1")) +
                     "Transform { translation 0 0 20 children Shape { appearance Appearance { " + unlit("1 1 1") +
                     " } " + kLetters + " } }",
                 200, 200);
    s.options.settings.samplesPerPixel = 4;
    EXPECT_NEAR(litPixels(s.picture(), 1), inkArea(), .01 * inkArea());
}

// The head-up display of the paper: text before the eye that says what was clicked.
TEST(TextInPictures, IsPicked) {
    LightScene s(
        "Transform { translation 0 0 9 children Shape { geometry DEF HUD Text { string \"l\" fontStyle "
        "FontStyle { family \"SANS\" style \"BOLD\" size .1 justify \"MIDDLE\" } } } } " +
        square(10, unlit("1 1 1")));
    const Picker picker(s.world->rays(), s.world->flattener());
    const auto hit = picker.ray({0, .04, 10}, {0, 0, -1});
    ASSERT_TRUE(hit && *hit);
    EXPECT_EQ(hit->geometry, s.node("HUD"));
    EXPECT_NEAR(hit->distance, 1, 1e-6);
    const auto beside = picker.ray({.05, .04, 10}, {0, 0, -1});
    ASSERT_TRUE(beside && *beside);
    EXPECT_NE(beside->geometry, s.node("HUD"));
}

TEST(TextInPictures, FollowsTheScene) {
    LightScene s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } Shape { appearance Appearance { " + unlit("1 1 1") +
                     " } geometry DEF T Text { fontStyle DEF F FontStyle { family \"TYPEWRITER\" } } }",
                 200, 200);
    s.options.settings.samplesPerPixel = 16;
    EXPECT_EQ(litPixels(s.picture(), 1), 0);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Text::string, Array<String>{"M"}));
    s.scene.newFrame(1);
    const double one = litPixels(s.picture(), 1);
    EXPECT_GT(one, .1);
    ASSERT_TRUE(s.scene.set(s.node("F"), x3d::FontStyle::size, 2.0f));
    s.scene.newFrame(2);
    EXPECT_NEAR(litPixels(s.picture(), 1), 4 * one, .04 * one);
}

// A FontLibrary's letter is a rectangle of .5 by .7 m; what its url leads to changes while the scene runs, and a
// replica, which has no files, shows the same.
TEST(TextInPictures, TakesTheFontOfALibrary) {
    test::WrittenFont wide;
    wide.left = 0, wide.right = 900;
    LightScene s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } Shape { appearance Appearance { " + unlit("1 1 1") +
                     " } geometry Text { string \"A\" fontStyle FontStyle { family \"Boxes\" } } } DEF L FontLibrary { "
                     "family \"Boxes\" url \"" +
                     test::fontUrl(test::WrittenFont().bytes()) + "\" }",
                 200, 200);
    s.options.settings.samplesPerPixel = 4;
    Diagnostics said;
    InlineLoader loader(s.scene, said);
    EXPECT_NEAR(litPixels(s.picture(), 1), .5 * .7, .003);
    ASSERT_TRUE(s.scene.set(s.node("L"), x3d::FontLibrary::url, Array<String>{String(test::fontUrl(wide.bytes()))}));
    s.scene.newFrame(1);
    EXPECT_EQ(loader.update(), 1u);
    s.scene.newFrame(2);
    EXPECT_NEAR(litPixels(s.picture(), 1), .9 * .7, .003);

    Scene replica;
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(s.scene.snapshot())));
    SharedWorld world(replica);
    LightRenderer light(world);
    const auto there = light.picture(s.options);
    ASSERT_TRUE(there);
    EXPECT_NEAR(litPixels(*there, 1), .9 * .7, .003);

    ASSERT_TRUE(s.scene.set(s.node("L"), x3d::FontLibrary::load, false));
    s.scene.newFrame(3);
    loader.update();
    s.scene.newFrame(4);
    const double serif = litPixels(s.picture(), 1);
    EXPECT_GT(serif, .05);
    EXPECT_LT(serif, .3) << "a letter of the font that is installed";
}

}  // namespace
}  // namespace rtsg
