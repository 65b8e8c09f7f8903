// Projectors: pictures as light, against closed forms.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

/// A white wall of 8 m at z = 0, seen straight on by an orthographic view of 8 x 8 m: pixel (i, j) of 80 looks at
/// (i / 10 - 3.95, 3.95 - j / 10).
std::string wallLitBy(const std::string& lights) {
    return "NavigationInfo { headlight FALSE }\n"
           "OrthoViewpoint { position 0 0 9 fieldOfView [-4 -4 4 4] }\n" +
           lights +
           "\nDEF WALL Shape { appearance Appearance { material Material { diffuseColor 1 1 1 ambientIntensity 0 } }\n"
           "  geometry IndexedFaceSet { coordIndex [0 1 2 3] coord Coordinate { point [-4 -4 0, 4 -4 0, 4 4 0, -4 4 0] "
           "} } }";
}
/// 2 x 2 pixels: below red and green, above blue and white (5.3.6: from the lower left).
constexpr const char* kFourColors = "PixelTexture { image 2 2 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF }";

struct ProjectedScene : test::LightScene {
    explicit ProjectedScene(const std::string& lights) : LightScene(wallLitBy(lights), 80, 80) {}
    /// The colour at a place of the wall, the middle of a pixel.
    Vec3f at(const Picture& picture, double x, double y) const {
        return Vec3f(
            picture.at(static_cast<int>(std::floor((x + 4) * 10)), static_cast<int>(std::floor((4 - y) * 10))));
    }
};
void expectColorAt(const Vec3f& seen, const Vec3d& expected, const char* what, double tolerance = 2e-3) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen[c], expected[c], tolerance) << what;
}
/// The light on a wall that is lit from (0, 0, height).
double slant(double x, double y, double height) {
    return height / std::sqrt(x * x + y * y + height * height);
}

TEST(Projector, LightsItsPyramidInTheColoursOfThePicture) {
    ProjectedScene scene(std::string("TextureProjector { location 0 0 2 direction 0 0 -1 upVector 0 1 0 "
                                     "fieldOfView 1.5707963 intensity .8 color 1 .5 1 texture ") +
                         kFourColors + " }");
    const Picture picture = scene.picture();
    // At 2 m the picture is 4 m wide; a pixel's own colour is in its middle.
    const double x = 1.05, cosine = .8 * slant(x, x, 2);
    // .05 m beside the middle of a picture's pixel of 2 m: a fortieth of the next one is mixed in.
    const double own = .975, next = .025;
    expectColorAt(scene.at(picture, -1.05, -1.05), Vec3d(1, 0, 0) * cosine, "below on the left, towards the edge");
    expectColorAt(scene.at(picture, 1.05, -1.05), Vec3d(0, .5, 0) * cosine, "below on the right");
    expectColorAt(scene.at(picture, -1.05, 1.05), Vec3d(0, 0, 1) * cosine, "above on the left");
    expectColorAt(scene.at(picture, 1.05, 1.05), Vec3d(1, .5, 1) * cosine, "above on the right");
    expectColorAt(scene.at(picture, -.95, -.95),
                  Vec3d(own * own + next * next, .5 * (own * next + next * next), next) * .8 * slant(.95, .95, 2),
                  "mixed with its neighbours");
    EXPECT_GT(scene.at(picture, 1.95, 1.95).r, .3f) << "up to the edge";
    EXPECT_EQ(scene.at(picture, 2.05, 1.05), Vec3f(0)) << "and no further";
    EXPECT_EQ(scene.at(picture, 0.05, -2.05), Vec3f(0));
}

TEST(Projector, HasTheShapeOfItsPicture) {
    // The angle is that of the shorter side: 90 degrees over the height, the width twice as much.
    ProjectedScene wide(
        "TextureProjector { location 0 0 1 direction 0 0 -1 fieldOfView 1.5707963 texture PixelTexture { image 2 1 1 "
        "0xFF 0xFF } }");
    Picture picture = wide.picture();
    EXPECT_GT(wide.at(picture, 1.95, .95).r, 0);
    EXPECT_EQ(wide.at(picture, 2.05, .95), Vec3f(0));
    EXPECT_EQ(wide.at(picture, 1.95, 1.05), Vec3f(0));
    ProjectedScene high(
        "TextureProjector { location 0 0 1 direction 0 0 -1 fieldOfView 1.5707963 texture PixelTexture { image 1 2 1 "
        "0xFF 0xFF } }");
    picture = high.picture();
    EXPECT_GT(high.at(picture, .95, -1.95).r, 0);
    EXPECT_EQ(high.at(picture, 1.05, -1.95), Vec3f(0));
    EXPECT_EQ(high.at(picture, .95, -2.05), Vec3f(0));
}

TEST(Projector, TurnsMovesAndGrowsWithItsTransform) {
    // Turned by a quarter round the view, moved by 1 and twice as large: up in the picture points left.
    ProjectedScene scene(std::string("Transform { translation 1 0 0 rotation 0 0 1 1.5707963 scale 2 2 2 children "
                                     "TextureProjectorParallel { location 0 0 1 direction 0 0 -1 upVector 0 1 0 "
                                     "fieldOfView -1 -.5 1 .5 texture ") +
                         kFourColors + " } }");
    const Picture picture = scene.picture();
    // In the wall's frame: right of the picture is up, 4 m; up is left, 2 m.
    expectColorAt(scene.at(picture, 1.55, -1.05), {1, 0, 0}, "lower left of the picture", .03);
    expectColorAt(scene.at(picture, 1.55, 1.05), {0, 1, 0}, "lower right", .03);
    expectColorAt(scene.at(picture, .55, -1.05), {0, 0, 1}, "upper left", .06);
    EXPECT_EQ(scene.at(picture, 2.05, .05), Vec3f(0));
    EXPECT_EQ(scene.at(picture, -.05, .05), Vec3f(0));
    EXPECT_EQ(scene.at(picture, 1.05, 2.05), Vec3f(0));
    EXPECT_GT(scene.at(picture, 1.95, 1.95).g, .9f);
}

TEST(Projector, ShinesBetweenItsDistancesAndNotBehind) {
    const auto center = [](const std::string& fields) {
        ProjectedScene scene(
            "TextureProjectorParallel { fieldOfView -1 -1 1 1 texture PixelTexture { image 1 1 1 0x80 } " + fields +
            " }");
        return scene.at(scene.picture(), .05, .05).r;
    };
    const double grey = 128 / 255.0;
    EXPECT_NEAR(center("location 0 0 2 direction 0 0 -1"), grey, 1e-3);
    EXPECT_NEAR(center("location 0 0 2 direction 0 0 -1 nearDistance 1.9 farDistance 2.1"), grey, 1e-3);
    EXPECT_EQ(center("location 0 0 2 direction 0 0 -1 nearDistance 2.1"), 0);
    EXPECT_EQ(center("location 0 0 2 direction 0 0 -1 farDistance 1.9"), 0);
    EXPECT_EQ(center("location 0 0 -2 direction 0 0 -1"), 0) << "the wall is behind it";
    EXPECT_EQ(center("location 0 0 2 direction 0 0 1"), 0) << "it looks away";
    EXPECT_EQ(center("location 0 0 2 direction 0 0 -1 on FALSE"), 0);
    EXPECT_NEAR(center("location 0 0 2 direction 0 0 -1 upVector 0 0 1"), grey, 1e-3) << "an up along its direction";
    ProjectedScene turned(
        "DEF P TextureProjectorParallel { fieldOfView -1 -1 1 1 location 0 0 2 direction 0 0 -1 texture PixelTexture { "
        "image 1 1 1 0x80 } }");
    ASSERT_TRUE(turned.scene.set(turned.node("P"), x3d::TextureProjectorParallel::direction, Vec3f(0)));
    turned.scene.newFrame(1);
    EXPECT_EQ(turned.at(turned.picture(), .05, .05), Vec3f(0)) << "no direction";
    ProjectedScene empty(
        "TextureProjectorParallel { fieldOfView 1 -1 -1 1 location 0 0 2 direction 0 0 -1 texture "
        "PixelTexture { image 1 1 1 0x80 } }");
    EXPECT_EQ(empty.at(empty.picture(), .05, .05), Vec3f(0)) << "an empty field of view";
}

TEST(Projector, LeavesShadowsOfWhatIsOnItsWayAlone) {
    const std::string projector =
        "TextureProjectorParallel { location 0 0 3 direction 0 0 -1 fieldOfView -2 -2 2 2 shadows TRUE texture "
        "PixelTexture { image 1 1 1 0xFF } }\n";
    const auto boxAt = [](const char* z) {
        return "Transform { translation 0 0 " + std::string(z) +
               " children Shape { appearance Appearance { material Material { } } geometry Box { size 1 1 .1 } } }";
    };
    // Seen from behind the box: an oblique look would need the perspective; so the place beside the box is looked at
    // through the picture of a wall that lies before it.
    const auto seen = [&](const std::string& box, bool perspective) {
        const std::string light =
            perspective
                ? "TextureProjector { location 0 0 3 direction 0 0 -1 fieldOfView 1.5707963 shadows TRUE texture "
                  "PixelTexture { image 1 1 1 0xFF } }\n"
                : projector;
        ProjectedScene scene(light + box);
        const Picture picture = scene.picture();
        return scene.at(picture, .75, .75).r;
    };
    // The perspective shadow of a box at half the height is twice its size; the parallel one is as large as the box.
    EXPECT_EQ(seen(boxAt("1.5"), true), 0);
    EXPECT_NEAR(seen(boxAt("1.5"), false), 1, 1e-3);
    EXPECT_NEAR(seen(boxAt("4"), true), slant(.75, .75, 3), 1e-3) << "behind the projector";
    ProjectedScene covered(projector +
                           "Transform { translation 0 0 5 children Shape { appearance Appearance { material "
                           "Material { transparency 1 } } geometry Box { size 9 9 .1 } } }\n");
    EXPECT_NEAR(covered.at(covered.picture(), 1.05, 1.05).r, 1, 1e-3) << "what is behind it throws no shadow";
}

TEST(Projector, ReachesItsScopeAloneUnlessItIsGlobal) {
    const std::string lights =
        "Group { children [ TextureProjectorParallel { global FALSE location 0 0 2 direction 0 0 -1 fieldOfView -4 -4 "
        "4 4 texture PixelTexture { "
        "image 1 1 1 0xFF } } Transform { translation 3 3 0 children Shape { appearance Appearance { material Material "
        "{ "
        "diffuseColor 1 1 1 } } geometry Box { } } } ] }";
    ProjectedScene scene(lights);
    const Picture picture = scene.picture();
    EXPECT_EQ(scene.at(picture, .05, .05), Vec3f(0));
    EXPECT_NEAR(scene.at(picture, 3.05, 3.05).r, 1, 1e-3) << "the box";
}

TEST(Projector, FollowsItsPicture) {
    ProjectedScene scene(
        "DEF P TextureProjectorParallel { location 0 0 2 direction 0 0 -1 texture DEF T PixelTexture { image 1 1 3 "
        "0xFF0000 } "
        "}");
    expectColorAt(scene.at(scene.picture(), .05, .05), {1, 0, 0}, "red");
    ASSERT_TRUE(
        scene.scene.set(scene.node("T"), x3d::PixelTexture::image, Image(Array<std::int32_t>{1, 1, 3, 0x0000FF})));
    scene.scene.newFrame(1);
    expectColorAt(scene.at(scene.picture(), .05, .05), {0, 0, 1}, "blue");
    ASSERT_TRUE(
        scene.scene.set(scene.node("T"), x3d::PixelTexture::image, Image(Array<std::int32_t>{1, 1, 4, 0x00FF0080})));
    scene.scene.newFrame(2);
    expectColorAt(scene.at(scene.picture(), .05, .05), {0, 128 / 255.0, 0}, "half clear");
    ASSERT_TRUE(scene.scene.set(scene.node("P"), x3d::TextureProjectorParallel::texture, NodeId{}));
    scene.scene.newFrame(3);
    EXPECT_EQ(scene.at(scene.picture(), .05, .05), Vec3f(0)) << "nothing to show";
}

TEST(Projector, ShowsTheSameInPaths) {
    ProjectedScene scene(
        std::string("TextureProjector { location 0 0 2 direction 0 0 -1 fieldOfView 1.5707963 texture ") + kFourColors +
        " }");
    scene.options.settings.colorSpace = ColorSpace::linear;
    const Picture direct = scene.picture();
    scene.options.settings.integrator = Integrator::path;
    scene.options.settings.samplesPerPixel = 4;
    const Picture path = scene.picture();
    for (const auto& [x, y] :
         {std::pair(1.05, 1.05), std::pair(-1.45, .55), std::pair(.35, -.75), std::pair(3.05, 0.05)})
        expectColorAt(scene.at(path, x, y), Vec3d(scene.at(direct, x, y)), "whitted is exact here", .02);
}

}  // namespace
}  // namespace rtsg
