// Cube maps: composed, from files and generated, against directions worked out in double precision.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>

#include <rtsg/renderers/space_texture.h>

#include <rtsg/core/x3d.h>

#include "dds_file.h"
#include "light_scene.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using namespace test;

constexpr const char* kSideNames[] = {"front", "back", "left", "right", "top", "bottom"};
constexpr const char* kSideColors[] = {"0xFF0000", "0x00FF00", "0x0000FF", "0xFFFF00", "0xFF00FF", "0x00FFFF"};
const Vec3f kSeen[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};

std::string composed() {
    std::string text = "ComposedCubeMapTexture {";
    for (int i = 0; i < 6; ++i)
        text += fmt::format(" {}Texture PixelTexture {{ image 1 1 3 {} }}", kSideNames[i], kSideColors[i]);
    return text + " }";
}

/// The side that a direction leaves through, in the order of kSideNames: those of a Background (24.2.1).
int sideOf(const Vec3d& d) {
    const Vec3d a = glm::abs(d);
    if (a.z > a.x && a.z > a.y) return d.z < 0 ? 0 : 1;
    if (a.x > a.y) return d.x < 0 ? 2 : 3;
    return d.y > 0 ? 4 : 5;
}

// 34.2: each point shows the side that is seen in its direction from the middle.
TEST(CubeMap, AShapeWithoutCoordinatesShowsTheSideOfItsDirection) {
    const char* rotations[] = {"0 1 0 3.14159265",  "0 1 0 0",          "0 1 0 1.57079633",
                               "0 1 0 -1.57079633", "1 0 0 1.57079633", "1 0 0 -1.57079633"};
    for (int i = 0; i < 6; ++i) {
        LightScene s(
            fmt::format("Transform {{ rotation {} children Shape {{ appearance Appearance {{ material "
                        "UnlitMaterial {{ }} texture {} }} geometry Sphere {{ }} }} }}",
                        rotations[i], composed()));
        EXPECT_EQ(s.center(), kSeen[i]) << kSideNames[i];
    }
}

/// A large plane whose normals all are `normal`, in front of the default viewpoint.
std::string plane(const Vec3d& normal, const char* mode, const std::string& texture) {
    const std::string n = fmt::format("{} {} {}", normal.x, normal.y, normal.z);
    return fmt::format(
        "Shape {{ appearance Appearance {{ material UnlitMaterial {{ }} texture {} }} geometry IndexedFaceSet {{ solid "
        "FALSE coordIndex [ 0 1 2 3 ] texCoord TextureCoordinateGenerator {{ mode \"{}\" }} normal Normal {{ vector [ "
        "{}, {}, {}, {} ] }} coord Coordinate {{ point [ -9 -9 0, 9 -9 0, 9 9 0, -9 9 0 ] }} }} }}",
        texture, mode, n, n, n, n);
}

/// Checks, in the picture of a plane with these normals, that each pixel shows the side that `lookedUp` gives for the
/// direction of its ray.
template <class LookedUp>
void expectSides(LightScene& s, const Vec3d& n, const LookedUp& lookedUp) {
    const Picture p = s.picture();
    int compared = 0;
    for (int y = 0; y < 17; y += 4)
        for (int x = 0; x < 17; x += 4) {
            const Vec3d d = pixelDirection(x, y, 17, 17, .7854);
            if (glm::dot(d, n) > -.05) continue;  // seen from behind, where the normal is turned
            const Vec3d v = lookedUp(d);
            Vec3d a = glm::abs(v);
            std::sort(&a.x, &a.x + 3);
            if (a.z - a.y < 1e-3) continue;  // on the edge between two
            EXPECT_EQ(Vec3f(p.at(x, y)), kSeen[sideOf(v)]) << x << " " << y;
            ++compared;
        }
    EXPECT_GT(compared, 10);
}
Vec3d mirrored(const Vec3d& d, const Vec3d& n) {
    return d - 2 * glm::dot(d, n) * n;
}

TEST(CubeMap, ReflectionsFollowTheMirroredRay) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> slope(-1.2, 1.2);
    for (int round = 0; round < 12; ++round) {
        SCOPED_TRACE(round);
        const Vec3d n = glm::normalize(Vec3d(slope(random), slope(random), 1));
        LightScene s(plane(n, "CAMERASPACEREFLECTIONVECTOR", composed()), 17, 17);
        expectSides(s, n, [&](const Vec3d& d) { return mirrored(d, n); });
    }
}

/// From wherever it is looked at, and however the surface is turned, the cube lies along the axes of the world.
TEST(CubeMap, WorldSpaceVectorsDoNotTurnWithTheEye) {
    std::mt19937 random(9);
    std::uniform_real_distribution<double> slope(-1.2, 1.2), angle(-3, 3);
    for (int round = 0; round < 12; ++round) {
        SCOPED_TRACE(round);
        const Vec3d n = glm::normalize(Vec3d(slope(random), slope(random), 1));
        const double rotation = angle(random);
        // All turned about y: eye, surface and its normals. The cube stays.
        const auto turned = [&](const Vec3d& v) {
            return Vec3d(v.x * std::cos(rotation) + v.z * std::sin(rotation), v.y,
                         v.z * std::cos(rotation) - v.x * std::sin(rotation));
        };
        const auto scene = [&](const char* mode) {
            return fmt::format("Transform {{ rotation 0 1 0 {} children [ Viewpoint {{ }} {} ] }}", rotation,
                               plane(n, mode, composed()));
        };
        LightScene reflecting(scene("WORLDSPACEREFLECTIONVECTOR"), 17, 17);
        expectSides(reflecting, n, [&](const Vec3d& d) { return turned(mirrored(d, n)); });
        LightScene facing(scene("WORLDSPACENORMAL"), 17, 17);
        expectSides(facing, n, [&](const Vec3d&) { return turned(n); });
    }
}

TEST(CubeMap, SidesAndPlacesAreThoseOfDirections) {
    std::mt19937 random(1);
    std::normal_distribution<float> any;
    for (int i = 0; i < 10000; ++i) {
        const Vec3f d = glm::normalize(Vec3f(any(random), any(random), any(random)));
        const CubePosition onCube = cubePosition(d);
        EXPECT_EQ(static_cast<int>(onCube.side), sideOf(Vec3d(d)));
        EXPECT_TRUE(onCube.st.x >= 0 && onCube.st.x <= 1 && onCube.st.y >= 0 && onCube.st.y <= 1);
        EXPECT_LT(glm::distance(cubeDirection(onCube.side, onCube.st), d), 1e-6f);
    }
    for (const Vec3f& bad : {Vec3f(0), Vec3f(NAN, 0, 0), Vec3f(INFINITY, 1, 0)}) {
        const CubePosition onCube = cubePosition(bad);
        EXPECT_TRUE(std::isfinite(onCube.st.x) && std::isfinite(onCube.st.y));
    }
}

// ---- files --------------------------------------------------------------------------------------------------------

class CubeFiles : public testing::Test {
  protected:
    void write(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder.path() / name, std::ios::binary) << bytes;
    }
    LightRenderer::Options options() const {
        return LightRenderer::Options(Resources::ofFile(folder.path() / "main.x3dv"));
    }
    static std::string sphere(const char* round, const std::string& texture) {
        return fmt::format(
            "Transform {{ rotation {} children Shape {{ appearance Appearance {{ material UnlitMaterial {{ }} texture "
            "{} }} geometry Sphere {{ radius 4 }} }} }}",
            round, texture);
    }
    const TempFolder folder;
};

// Faces of a DDS file lie +x -x +y -y +z -z, each as seen from inside in a world whose +z is the front.
TEST_F(CubeFiles, FacesOfADdsFileAreSides) {
    constexpr std::uint32_t faces[] = {0xFFFFFF00, 0xFF0000FF, 0xFFFF00FF, 0xFF00FFFF, 0xFFFF0000, 0xFF00FF00};
    std::vector<std::uint32_t> pixels;
    for (const std::uint32_t face : faces)
        // The upper row of each is half as bright.
        for (int i = 0; i < 16; ++i) pixels.push_back(i < 8 ? (face & 0xFF808080u) | 0xFF000000u : face);
    write("cube.dds", dds(4, true, 1, pixels));
    const char* rotations[] = {"0 1 0 3.14159265",  "0 1 0 0",          "0 1 0 1.57079633",
                               "0 1 0 -1.57079633", "1 0 0 1.57079633", "1 0 0 -1.57079633"};
    for (int i = 0; i < 6; ++i) {
        LightScene s(sphere(rotations[i], "ImageCubeMapTexture { url \"cube.dds\" }"), 33, 33, options());
        const Picture p = s.picture();
        EXPECT_TRUE(s.light->diagnostics().all().empty());
        // Below and above the middle, beyond where the rows mix.
        // The shape is turned so that top and bottom hang upside down.
        const int lower = i < 4 ? 23 : 9;
        EXPECT_EQ(Vec3f(p.at(16, lower)), kSeen[i]) << kSideNames[i];
        EXPECT_LT(glm::distance(Vec3f(p.at(16, 32 - lower)), kSeen[i] * (128 / 255.f)), .01f) << kSideNames[i];
    }
}

TEST_F(CubeFiles, ShapesOfPicturesSayWhereSidesLie) {
    const auto pgm = [](int w, int h, const std::function<int(int, int)>& at) {
        std::string out = fmt::format("P5\n{} {}\n255\n", w, h);
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) out += static_cast<char>(at(x, y));
        return out;
    };
    // A cross of 4 x 3 sides of two pixels: each shows its column and row.
    write("cross.pgm", pgm(8, 6, [](int x, int y) { return 10 + 40 * (x / 2) + 10 * (y / 2); }));
    write("strip.pgm", pgm(12, 2, [](int x, int) { return 10 + 40 * (x / 2); }));
    write("round.pgm", pgm(8, 4, [](int x, int) { return 10 + 30 * x; }));
    write("odd.pgm", pgm(5, 3, [](int, int) { return 9; }));
    const auto seen = [&](const char* file, const char* round) {
        LightScene s(sphere(round, fmt::format("ImageCubeMapTexture {{ url \"{}\" }}", file)), 33, 33, options());
        return s.center().r * 255;
    };
    EXPECT_NEAR(seen("cross.pgm", "0 1 0 3.14159265"), 10 + 40 + 10, .01) << "front";
    EXPECT_NEAR(seen("cross.pgm", "0 1 0 0"), 10 + 120 + 10, .01) << "back";
    EXPECT_NEAR(seen("cross.pgm", "0 1 0 1.57079633"), 10 + 10, .01) << "left";
    EXPECT_NEAR(seen("cross.pgm", "1 0 0 1.57079633"), 10 + 40, .01) << "top";
    EXPECT_NEAR(seen("strip.pgm", "0 1 0 3.14159265"), 10 + 160, .01) << "+z of a strip is the front";
    EXPECT_NEAR(seen("round.pgm", "0 1 0 3.14159265"), 10 + 30 * 3.5, .5) << "a panorama's middle is the front";
    EXPECT_NEAR(seen("round.pgm", "0 1 0 -1.57079633"), 10 + 30 * 5.5, .5) << "and a quarter further the right";
    LightScene s(sphere("0 1 0 0", "ImageCubeMapTexture { url \"odd.pgm\" }"), 33, 33, options());
    EXPECT_EQ(s.center(), Vec3f(1)) << "shown without";
    ASSERT_EQ(s.light->diagnostics().all().size(), 1u);
    EXPECT_NE(s.light->diagnostics().all()[0].text.find("5 x 3"), std::string::npos);
}

// Every layout shows every side upright and not mirrored: sides of 4 pixels whose red is s, green is t, and blue is
// the side's number; looked up in the middle of each pixel, in directions that are written out.
TEST_F(CubeFiles, EveryLayoutShowsSidesUpright) {
    enum Side { front, back, left, right, top, bottom, none };
    struct Layout {
        int columns, rows;
        std::vector<Side> sides;  // row by row, from the top
        int turned = -1;          // the one that hangs upside down
    };
    for (const Layout& layout :
         {Layout{4, 3, {none, top, none, none, left, front, right, back, none, bottom, none, none}},
          Layout{3, 4, {none, top, none, left, front, right, none, bottom, none, none, back, none}, back},
          Layout{6, 1, {right, left, top, bottom, front, back}}, Layout{1, 6, {right, left, top, bottom, front, back}},
          Layout{3, 2, {right, top, front, left, bottom, back}}}) {
        constexpr int n = 4;
        std::string ppm = fmt::format("P6\n{} {}\n255\n", n * layout.columns, n * layout.rows);
        for (int y = 0; y < n * layout.rows; ++y)
            for (int x = 0; x < n * layout.columns; ++x) {
                const Side side = layout.sides[static_cast<std::size_t>(y / n * layout.columns + x / n)];
                const int column = side == layout.turned ? n - 1 - x % n : x % n;
                const int row = side == layout.turned ? y % n : n - 1 - y % n;
                for (const int value : {20 + 50 * column, 20 + 50 * row, 40 * side}) ppm += static_cast<char>(value);
            }
        write("sides.ppm", ppm);
        const auto texture = Texture::fromFile(folder.path() / "sides.ppm", Texture::Content::color);
        ASSERT_TRUE(texture);
        const auto cube = SpaceTexture::ofPicture(std::make_shared<const Texture>(*texture));
        ASSERT_TRUE(cube);
        for (int side = 0; side < 6; ++side)
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) {
                    const float x = (2 * i + 1.f) / n - 1, y = (2 * j + 1.f) / n - 1;  // to the right and up
                    const Vec3f towards[] = {{x, y, -1}, {-x, y, 1}, {-1, y, -x}, {1, y, x}, {x, 1, y}, {x, -1, -y}};
                    const Vec4f seen = cube->sample(towards[side], 0, {}, ColorSpace::display) * 255.f;
                    EXPECT_LT(glm::distance(Vec3f(seen), Vec3f(20 + 50 * i, 20 + 50 * j, 40 * side)), .01f)
                        << layout.columns << ":" << layout.rows << " " << kSideNames[side] << " " << i << " " << j;
                }
    }
}

// ---- three dimensions ---------------------------------------------------------------------------------------------

/// A plane z = 0 of two metres with coordinates (s, t, r) = (x, y, r) from 0 to 1.
std::string slice(double r, const std::string& texture, const std::string& more = "") {
    return fmt::format(
        "OrthoViewpoint {{ fieldOfView [ -1 -1 1 1 ] }} Shape {{ appearance Appearance {{ material UnlitMaterial {{ }} "
        "texture {1} {2} }} "
        "geometry IndexedFaceSet {{ solid FALSE coordIndex [ 0 1 2 3 ] texCoord TextureCoordinate3D {{ point [ 0 0 "
        "{0}, 1 0 {0}, 1 1 {0}, 0 1 {0} ] }} "
        "coord Coordinate {{ point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] }} }} }}",
        r, texture, more);
}
double grey(const std::string& body, LightRenderer::Options options = LightRenderer::Options()) {
    LightScene s(body, 33, 33, std::move(options));
    s.options.settings.colorSpace = ColorSpace::display;
    return s.center().r * 255;
}
const char* const kBlock = "PixelTexture3D { image [ 1 1 1 4 0 60 120 240 ] repeatS TRUE repeatT TRUE }";

TEST(Texture3D, IsLinearBetweenLayersAndEndsAtItsEdges) {
    // Layers' middles lie at 1/8, 3/8 ...
    const double at[] = {0, .125, .25, .375, .5, .7, .875, 1};
    const double expected[] = {0, 0, 30, 60, 90, 120 + 120 * (.7 - .625) * 4, 240, 240};
    for (int i = 0; i < 8; ++i) EXPECT_NEAR(grey(slice(at[i], kBlock)), expected[i], .01) << at[i];
    EXPECT_NEAR(grey(slice(1.125, "PixelTexture3D { image [ 1 1 1 4 0 60 120 240 ] repeatR TRUE }")), 0, .01);
    EXPECT_NEAR(grey(slice(.5,
                           "PixelTexture3D { image [ 1 1 1 4 0 60 120 240 ] textureProperties TextureProperties { "
                           "magnificationFilter \"NEAREST_PIXEL\" } }")),
                120, .01);
    const char* mirrored =
        "PixelTexture3D { image [ 1 1 1 4 0 60 120 240 ] textureProperties TextureProperties { boundaryModeR "
        "\"MIRRORED_REPEAT\" } }";
    EXPECT_NEAR(grey(slice(1.375, mirrored)), 120, .01);
    const char* bordered =
        "PixelTexture3D { image [ 1 1 1 4 0 60 120 240 ] textureProperties TextureProperties { boundaryModeR "
        "\"CLAMP_TO_BOUNDARY\" borderColor .4 .4 .4 1 } }";
    EXPECT_NEAR(grey(slice(1.5, bordered)), 102, .01);
    EXPECT_NEAR(grey(slice(1, bordered)), (240 + 102) / 2., .01);
}

TEST(Texture3D, ComposedLayersAndTransforms) {
    const std::string layers =
        "ComposedTexture3D { repeatS TRUE repeatT TRUE repeatR TRUE texture [ PixelTexture { image 1 1 1 20 } "
        "PixelTexture { image 1 1 1 40 } ] }";
    EXPECT_NEAR(grey(slice(.25, layers)), 20, .01);
    EXPECT_NEAR(grey(slice(.75, layers)), 40, .01);
    EXPECT_NEAR(grey(slice(.25, layers, "textureTransform TextureTransform3D { translation 0 0 .5 }")), 40, .01);
    EXPECT_NEAR(grey(slice(.5, layers, "textureTransform TextureTransform3D { scale 1 1 .5 }")), 20, .01);
    // Half a turn about x around the middle: r becomes 1 - r.
    EXPECT_NEAR(grey(slice(.25, layers,
                           "textureTransform TextureTransform3D { rotation 1 0 0 3.14159265 center -.5 -.5 -.5 }")),
                40, .01);
    EXPECT_NEAR(grey(slice(.25, layers,
                           "textureTransform TextureTransformMatrix3D { matrix 1 0 0 0 0 1 0 0 0 0 1 0 0 0 .5 1 }")),
                40, .01);
}

TEST(Texture3D, LiesInTheBoxAroundWhatHasNoCoordinates) {
    // From the front, r = 0, to the back.
    const std::string shape =
        "Shape { appearance Appearance { material UnlitMaterial { } texture PixelTexture3D { image [ 1 1 1 2 50 200 ] "
        "} } geometry Box { size 2 2 2 } }";
    EXPECT_NEAR(grey(shape), 50, .01);
    EXPECT_NEAR(grey("Transform { rotation 0 1 0 3.14159265 children " + shape + " }"), 200, .01);
}

/// They are single textures, as those of two dimensions are: a material's, and one of a MultiTexture's.
TEST(Texture3D, AndCubeMapsAreTexturesOfMaterialsToo) {
    const auto shown = [](const std::string& appearance) {
        return "Shape { appearance Appearance { " + appearance + " } geometry Box { size 2 2 2 } }";
    };
    const std::string block = "PixelTexture3D { image [ 1 1 1 2 50 200 ] }";
    EXPECT_NEAR(grey(shown("material UnlitMaterial { emissiveColor .5 .5 .5 emissiveTexture " + block + " }")), 25,
                .01);
    EXPECT_NEAR(
        grey(shown("material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 emissiveTexture " + block + " }")), 50,
        .01);
    EXPECT_NEAR(grey(shown("material UnlitMaterial { } texture MultiTexture { texture [ " + block +
                           " PixelTexture { image 1 1 1 51 } ] }")),
                10, .01);
    LightScene s("Transform { rotation 0 1 0 3.14159265 children " +
                 shown("material UnlitMaterial { emissiveTexture " + composed() + " }") + " }");
    EXPECT_EQ(s.center(), kSeen[0]);
}

TEST_F(CubeFiles, LayersOfADdsFileAreABlock) {
    std::vector<std::uint32_t> pixels;
    for (std::uint32_t z = 0; z < 4; ++z)
        for (int i = 0; i < 16; ++i) pixels.push_back(0xFF000000u | (40 * z + 20) * 0x010101u);
    write("block.dds", dds(4, false, 4, pixels));
    for (int z = 0; z < 4; ++z)
        EXPECT_NEAR(grey(slice((z + .5) / 4, "ImageTexture3D { url \"block.dds\" }"), options()), 40 * z + 20, .01)
            << z;
    // Used as a flat picture it is refused, and not read beyond its end.
    LightScene s(square(5, "material UnlitMaterial { } texture ImageTexture { url \"block.dds\" }"), 33, 33, options());
    EXPECT_EQ(s.center(), Vec3f(1));
    ASSERT_EQ(s.light->diagnostics().all().size(), 1u);
    EXPECT_NE(s.light->diagnostics().all()[0].text.find("layers"), std::string::npos);
}

TEST(Texture3D, SaysWhatIsWrongWithItsPixels) {
    for (const char* image : {"5 1 1 1 0", "1 2 2 2 0 0 0", "1 -1 1 1 0", "1 2147483647 2147483647 2147483647 0"}) {
        LightScene s(slice(.5, fmt::format("PixelTexture3D {{ image [ {} ] }}", image)));
        EXPECT_EQ(s.center(), Vec3f(1)) << image;
        EXPECT_EQ(s.light->diagnostics().all().size(), 1u) << image;
    }
}

// ---- generated ----------------------------------------------------------------------------------------------------

/// Six unlit walls 20 m away, each of one colour, that of the side they are on.
std::string walls() {
    const char* rotations[] = {"0 1 0 0",           "0 1 0 3.14159265", "0 1 0 1.57079633",
                               "0 1 0 -1.57079633", "1 0 0 1.57079633", "1 0 0 -1.57079633"};
    std::string text;
    for (int i = 0; i < 6; ++i)
        text += fmt::format(
            "Transform {{ rotation {} children Transform {{ translation 0 0 -20 children [ {} ] }} }}\n", rotations[i],
            square(20, fmt::format("material UnlitMaterial {{ emissiveColor {} {} {} }}", kSeen[i].r, kSeen[i].g,
                                   kSeen[i].b)));
    return text;
}

TEST(GeneratedCubeMap, ShowsWhatIsAroundTheShape) {
    const char* generated = "GeneratedCubeMapTexture { update \"ALWAYS\" size 32 }";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const char* mode : {"CAMERASPACEREFLECTIONVECTOR", "WORLDSPACEREFLECTIONVECTOR"}) {
            // Facing the eye it mirrors what is behind the eye; half turned about y, what is to the side.
            for (const auto& [normal, side] : {std::pair(Vec3d(0, 0, 1), 1),
                                               {glm::normalize(Vec3d(1, 0, 1)), 3},
                                               {glm::normalize(Vec3d(0, -1, 1)), 5}}) {
                LightScene s(walls() + plane(normal, mode, generated));
                s.options.settings.integrator = integrator;
                EXPECT_LT(glm::distance(s.center(), kSeen[side]), 1e-5f) << mode << ' ' << side;
            }
            // However the eye is turned, the world stays where it is.
            LightScene turned("Viewpoint { position 10 0 0 orientation 0 1 0 1.57079633 } " + walls() +
                              "Transform { rotation 0 1 0 1.57079633 children [ " + plane({0, 0, 1}, mode, generated) +
                              " ] }");
            turned.options.settings.integrator = integrator;
            EXPECT_LT(glm::distance(turned.center(), kSeen[3]), 1e-5f) << mode;
        }
}

TEST(GeneratedCubeMap, FollowsTheSceneAndShowsNothingUntilAsked) {
    LightScene s(walls() + "DEF B Transform { translation 0 0 15 children Shape { appearance Appearance { " +
                 unlit("1 1 1") + " } geometry Box { } } }" +
                 plane({0, 0, 1}, "CAMERASPACEREFLECTIONVECTOR", "DEF G GeneratedCubeMapTexture { size 64 }"));
    EXPECT_EQ(s.center(), Vec3f(1)) << "NONE: as without a texture";
    ASSERT_TRUE(s.scene.set(s.node("G"), x3d::GeneratedCubeMapTexture::update, String("ALWAYS")));
    s.scene.newFrame(1);
    EXPECT_LT(glm::distance(s.center(), Vec3f(1)), 1e-5f) << "the box, behind the eye";
    ASSERT_TRUE(s.scene.set(s.node("B"), x3d::Transform::translation, Vec3f(9, 0, 15)));
    s.scene.newFrame(2);
    EXPECT_LT(glm::distance(s.center(), kSeen[1]), 1e-5f) << "the wall behind it";
}

/// The picture drawn for a node counts among the scene's pictures as long as it is shown.
TEST(GeneratedCubeMap, CountsAmongThePixelsThatASceneMayHave) {
    const auto shape = [](int i, const char* more) {
        return plane({0, 0, 1}, "CAMERASPACEREFLECTIONVECTOR",
                     fmt::format("DEF G{} GeneratedCubeMapTexture {{ {} }}", i, more).c_str());
    };
    ResourcePolicy policy;
    policy.maximumPixels = 4 * 6 * 32 * 32 + 4 * 6 * 16 * 16;
    LightRenderer::Options options{Resources({}, policy)};
    LightScene s(walls() + shape(0, "update \"ALWAYS\" size 32") + shape(1, "size 16") + shape(2, "size 16"), 9, 9,
                 options);
    const auto warnings = [&] {
        (void)s.picture();
        std::size_t count = 0;
        for (const Diagnostic& d : s.light->diagnostics().all())
            count += d.text.find("GeneratedCubeMapTexture shows nothing: the scene's pictures have more than") == 0;
        return count;
    };
    const auto update = [&](const char* node, const char* how) {
        ASSERT_TRUE(s.scene.set(s.node(node), x3d::GeneratedCubeMapTexture::update, String(how)));
        static double now = 0;
        s.scene.newFrame(++now);
    };
    EXPECT_EQ(warnings(), 0u);
    update("G1", "ALWAYS");
    EXPECT_EQ(warnings(), 0u) << "as much as it may have";
    update("G2", "ALWAYS");
    EXPECT_EQ(warnings(), 1u) << "more";
    update("G2", "NONE"), update("G1", "NONE"), update("G2", "ALWAYS");
    EXPECT_EQ(warnings(), 1u) << "another one in place of one that is shown no more";
}

TEST(RenderedTexture, ShowsWhatTheEyeSeesWithoutTheShapesThatShowIt) {
    // A cross of four walls around a blue one, which the square with the picture hides from the eye.
    const auto wall = [](const char* position, double half, const char* color) {
        return fmt::format("Transform {{ translation {} children {} }}\n", position, square(half, unlit(color)));
    };
    const std::string body = "OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] }\n" + wall("-1.5 0 -2", 1, "1 0 0") +
                             wall("1.5 0 -2", 1, "0 1 0") + wall("0 1 -1.9", .5, "1 1 0") +
                             wall("0 -1 -1.9", .5, "0 1 1") + wall("0 0 -1", .5, "0 0 1");
    const std::string shape = square(.5,
                                     "material UnlitMaterial { } texture DEF R RenderedTexture { update \"ALWAYS\" "
                                     "width 64 height 64 }",
                                     "solid FALSE texCoord TextureCoordinate { point [ 0 0, 1 0, 1 1, 0 1 ] }");
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        LightScene s(body + shape, 64, 64);
        s.options.settings.integrator = integrator;
        const Picture picture = s.picture();
        // At half the size around the middle: (x, y) of the square is (2 x, 2 y) of what the eye would see without it.
        const auto at = [&](double x, double y) { return Vec3f(picture.at(int((x + 1) * 32), int((1 - y) * 32))); };
        for (const auto& [x, y, color] : {std::tuple(-.4, 0., Vec3f(1, 0, 0)),
                                          {.4, 0., Vec3f(0, 1, 0)},
                                          {.05, .4, Vec3f(1, 1, 0)},
                                          {.05, -.4, Vec3f(0, 1, 1)},
                                          {.1, .1, Vec3f(0, 0, 1)},
                                          {-.2, -.1, Vec3f(0, 0, 1)}})
            EXPECT_LT(glm::distance(at(x, y), color), 1e-5f) << x << " " << y;
        EXPECT_LT(glm::distance(at(-.8, 0), Vec3f(1, 0, 0)), 1e-5f) << "beside it the wall itself";
        EXPECT_TRUE(s.diagnostics.all().empty());
    }
    LightScene s(body + shape);
    ASSERT_TRUE(s.scene.set(s.node("R"), x3d::RenderedTexture::update, String("NONE")));
    s.scene.newFrame(1);
    EXPECT_EQ(s.center(), Vec3f(1)) << "NONE: as without a texture";
}

TEST(RenderedTexture, TwoThatSeeEachOtherEnd) {
    const std::string shape = square(.4,
                                     "material UnlitMaterial { } texture RenderedTexture { update \"NEXT_FRAME_ONLY\" "
                                     "width 16 height 16 url \"out.png\" }",
                                     "solid FALSE texCoord TextureCoordinate { point [ 0 0, 1 0, 1 1, 0 1 ] }");
    LightScene s("OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] }\n" + shape +
                 "Transform { translation .6 0 -1 children " + shape + " }\n" +
                 "Transform { translation 0 0 -3 children " + square(9, unlit("0 0 1")) + " }");
    const Picture picture = s.picture();
    EXPECT_LT(glm::distance(Vec3f(picture.at(16, 16)), Vec3f(0, 0, 1)), 1e-5f) << "the wall behind it";
    EXPECT_LT(glm::distance(Vec3f(picture.at(19, 16)), Vec3f(1)), 1e-5f) << "the other one, which shows nothing there";
    std::string reported;
    for (const Diagnostic& d : s.light->diagnostics().all()) reported += d.text + '\n';
    EXPECT_NE(reported.find("a scene writes no files"), std::string::npos) << reported;
}

// ---- TextureProperties --------------------------------------------------------------------------------------------

TEST(TextureProperties, FiltersOfWhatIsFarAway) {
    // Columns of black and white; a pixel covers four of them.
    std::string image = "64 64 1";
    for (int i = 0; i < 64 * 64; ++i) image += i % 2 ? " 255" : " 0";
    const auto seen = [&](const char* properties) {
        LightScene s("OrthoViewpoint { fieldOfView [ -8 -8 8 8 ] } " +
                         square(8, fmt::format("material UnlitMaterial {{ }} texture PixelTexture {{ image {} "
                                               "textureProperties TextureProperties {{ {} }} }}",
                                               image, properties)),
                     16, 16);
        s.options.settings.colorSpace = ColorSpace::display;
        return s.center().r;
    };
    EXPECT_NEAR(seen(""), .5, .01) << "ours to choose: mixed";
    EXPECT_NEAR(seen("minificationFilter \"AVG_PIXEL_AVG_MIPMAP\" generateMipMaps TRUE"), .5, .01);
    EXPECT_NEAR(seen("minificationFilter \"NEAREST_PIXEL_NEAREST_MIPMAP\" generateMipMaps TRUE"), .5, .01);
    const float nearest = seen("minificationFilter \"NEAREST_PIXEL\"");
    EXPECT_TRUE(nearest == 0 || nearest == 1) << nearest;
    EXPECT_EQ(seen("minificationFilter \"NEAREST_PIXEL_AVG_MIPMAP\""), nearest) << "there are no coarser copies";
}

TEST(TextureProperties, BorderColoursLieBeyondTheEdge) {
    const auto seen = [&](double s) {
        LightScene scene(
            "OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] } Shape { appearance Appearance { material UnlitMaterial { } "
            "texture PixelTexture { image 1 1 1 0 textureProperties TextureProperties { boundaryModeS "
            "\"CLAMP_TO_BOUNDARY\" "
            "borderColor .2 .6 1 1 } } } geometry IndexedFaceSet { coordIndex [ 0 1 2 3 ] texCoord TextureCoordinate { "
            "point [ " +
            fmt::format("{0} 0, {0} 0, {0} 1, {0} 1", s) +
            " ] } coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] } } }");
        scene.options.settings.colorSpace = ColorSpace::display;
        return scene.center();
    };
    expectColor(seen(.5), {0, 0, 0}, 1e-5);
    expectColor(seen(1), {.1, .3, .5}, 1e-5);  // half way to the border's middle
    expectColor(seen(1.75), {.2, .6, 1}, 1e-5);
    expectColor(seen(-7), {.2, .6, 1}, 1e-5);
}

/// A border is as clear as its alpha says, whatever the texture itself is; the default one is clear.
TEST(TextureProperties, ClearBordersAreSeenThrough) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const auto& [border, sky] : {std::pair{"", 1.f}, {"borderColor 0 0 0 1", 0.f}}) {
            LightScene s(std::string("NavigationInfo { headlight FALSE } Background { skyColor 0 1 0 } ") +
                             "OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] } Shape { appearance Appearance { material "
                             "UnlitMaterial { } texture PixelTexture { image 1 1 3 0xFF0000 textureProperties "
                             "TextureProperties { boundaryModeS \"CLAMP_TO_BOUNDARY\" " +
                             border +
                             " } } } geometry IndexedFaceSet { coordIndex [ 0 1 2 3 ] texCoord TextureCoordinate { "
                             "point [ 2 0, 2 0, 2 1, 2 1 ] } coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 "
                             "0 ] } } }",
                         9, 9);
            s.options.settings.integrator = integrator;
            s.options.settings.colorSpace = ColorSpace::linear;
            expectColor(s.center(), {0, sky, 0}, 1e-5);
        }
}

}  // namespace
}  // namespace rtsg
