// Tangents of X3D 4.1 in pictures: normal textures lie where they say, against an evaluation of its own in double
// precision, and where they say what the texture coordinates say, as without them. And what turns and mirrors texture
// coordinates turns and mirrors what a normal texture says.
#include <array>
#include <random>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/light_tracer.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

constexpr int kTexelRed = 0xC8, kTexelGreen = 0x9A, kTexelBlue = 0xD0;  // of the normal texture's one pixel
const Vec3d kTowardsLight = glm::normalize(Vec3d(.5, .3, .8));

std::string lamp() {
    return fmt::format("DirectionalLight {{ direction {} {} {} }}", -kTowardsLight.x, -kTowardsLight.y,
                       -kTowardsLight.z);
}
std::string bumpyMaterial(const char* material = "Material { ambientIntensity 0 diffuseColor .8 .8 .8") {
    return fmt::format("material {} normalTexture PixelTexture {{ image 1 1 3 0x{:02X}{:02X}{:02X} }} }}", material,
                       kTexelRed, kTexelGreen, kTexelBlue);
}
/// Solid or not, and with tangents of the four corners, or without.
std::string tangents(const std::string& vectors, const std::string& more = "solid FALSE") {
    return more + " tangent DEF T Tangent { vector [ " + vectors + " ] }";
}
std::string four(const std::string& vector) {
    return vector + ", " + vector + ", " + vector + ", " + vector;
}

/// The brightness of the square that faces +z, by glTF's meaning: bitangent = w (normal x tangent).
double mappedLight(const Vec3d& tangent, double w) {
    const Vec3d n(0, 0, 1), t = glm::normalize(tangent - glm::dot(tangent, n) * n), b = w * glm::cross(n, t);
    const Vec3d mapped =
        (2 * kTexelRed / 255.0 - 1) * t + (2 * kTexelGreen / 255.0 - 1) * b + (2 * kTexelBlue / 255.0 - 1) * n;
    return .8 * std::max(0.0, glm::dot(glm::normalize(mapped), kTowardsLight));
}
double litBy(const std::string& body, Integrator integrator = Integrator::whitted) {
    LightScene s(body, 9, 9);
    s.options.settings.integrator = integrator;
    return double{s.center().r};
}

TEST(Tangents, TurnWhatTheNormalTextureSays) {
    for (const double degrees : {0.0, 30.0, 90.0, 200.0, 315.0})
        for (const double w : {1.0, -1.0}) {
            const double a = degrees * kPi / 180;
            const Vec3d direction(std::cos(a), std::sin(a), 0);
            const std::string vector = fmt::format("{} {} 0 {}", direction.x, direction.y, w);
            EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), tangents(four(vector)))), mappedLight(direction, w),
                        2e-6)
                << degrees << ' ' << w;
        }
}

// Of any length, and projected to the plane across the normal.
TEST(Tangents, NeedNotBeUnitNorAcrossTheNormal) {
    EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), tangents(four(".3 .4 .7 1")))), mappedLight({.3, .4, .7}, 1),
                2e-6);
    EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), tangents(four(".0003 -.0004 0 -1")))),
                mappedLight({3, -4, 0}, -1), 2e-6);
}

TEST(Tangents, OfTheTextureCoordinatesChangeNothing) {
    const std::string given = tangents(four("1 0 0 1"));
    const char* const around[] = {
        "Transform {{ children {} }}",
        "Transform {{ scale -1 1 1 children {} }}",  // mirrored, and its front turned about
        "Transform {{ scale 2 1 .5 rotation .6 0 .8 .7 children {} }}",
        "Transform {{ rotation 0 1 0 3 children {} }}",  // from behind
        "Transform {{ scale 1 -3 1 rotation 0 1 0 3 children {} }}",
    };
    for (const char* position : around)
        for (const Integrator integrator : {Integrator::whitted, Integrator::path})
            for (const char* material : {"Material { ambientIntensity 0", "PhysicalMaterial { roughness .6"}) {
                const auto scene = [&](const std::string& geometry) {
                    return lamp() + "DirectionalLight { direction -.2 -.3 .9 }" +
                           fmt::format(fmt::runtime(position), square(1, bumpyMaterial(material), geometry));
                };
                const double without = litBy(scene("solid FALSE"), integrator);
                EXPECT_GT(without, .004);
                EXPECT_NEAR(litBy(scene(given), integrator), without, 2e-5) << position << material;
                // Else this could not fail.
                EXPECT_GT(std::abs(litBy(scene(tangents(four("0 1 0 -1"))), integrator) - without), 1e-3) << position;
            }
}

TEST(Tangents, BelongToFacesWhereNormalsDo) {
    const std::string geometry = "normalPerVertex FALSE " + tangents("0 1 0 1, 1 0 0 -1");
    EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), geometry)), mappedLight({0, 1, 0}, 1), 2e-6)
        << "the second is of a face that there is not";
}

// In the middle between the left side and the right one.
TEST(Tangents, AreInterpolatedBetweenCorners) {
    EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), tangents("1 0 0 1, 0 1 0 1, 0 1 0 1, 1 0 0 1"))),
                mappedLight({1, 1, 0}, 1), 2e-6);
}

TEST(Tangents, OfSetsAndGridsOfHeights) {
    const auto shape = [](const std::string& geometry) {
        return lamp() + "Shape { appearance Appearance { " + bumpyMaterial() + " } geometry " + geometry + " }";
    };
    const std::string triangles =
        "IndexedTriangleSet { solid FALSE index [ 0 1 2 0 2 3 ] coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 "
        "1 0 ] } tangent Tangent { vector [ " +
        four("0 -1 0 1") + " ] } }";
    EXPECT_NEAR(litBy(shape(triangles)), mappedLight({0, -1, 0}, 1), 2e-6);
    // A grid lies in y = 0; turned up, z of the grid is -y here.
    const std::string grid =
        "ElevationGrid { solid FALSE xDimension 2 zDimension 2 height [ 0 0 0 0 ] tangent Tangent { vector [ " +
        four("0 0 1 1") + " ] } }";
    EXPECT_NEAR(litBy(lamp() +
                      "Transform { rotation 1 0 0 1.570796327 translation -.5 .5 0 children Shape { appearance "
                      "Appearance { " +
                      bumpyMaterial() + " } geometry " + grid + " } }"),
                mappedLight({0, -1, 0}, 1), 2e-6);
}

TEST(Tangents, WithoutDirectionLeaveItToTheTextureCoordinates) {
    EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), tangents(four("0 0 1 1")))), mappedLight({1, 0, 0}, 1), 2e-6);
}

TEST(Tangents, TooFewAreNamed) {
    LightScene s(lamp() + square(1, bumpyMaterial(), tangents("1 0 0 1, 1 0 0 1")));
    s.center();
    std::string said;
    const Diagnostics reported = s.world->diagnostics();
    for (const Diagnostic& d : reported.all()) said += d.text;
    EXPECT_NE(said.find("IndexedFaceSet: tangent refers to values that do not exist"), std::string::npos) << said;
}

TEST(Tangents, FollowTheSceneAndStayWithWhatDeforms) {
    LightScene s(lamp() + "Shape { appearance Appearance { " + bumpyMaterial() +
                     " } geometry DEF G IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] coord DEF C Coordinate { "
                     "point [-1 -1 0, 1 -1 0, 1 1 0, -1 1 0] } tangent DEF T Tangent { vector [ " +
                     four("1 0 0 1") + " ] } } }",
                 9, 9);
    EXPECT_NEAR(double{s.center().r}, mappedLight({1, 0, 0}, 1), 2e-6);
    for (const double to : {.5, -2.0, 1.0}) {
        ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Tangent::vector,
                                Array<Vec4f>{{1, to, 0, -1}, {1, to, 0, -1}, {1, to, 0, -1}, {1, to, 0, -1}}));
        s.scene.newFrame(s.scene.now() + 1);
        EXPECT_NEAR(double{s.center().r}, mappedLight({1, to, 0}, -1), 2e-6);
        const auto wide = static_cast<float>(1 + std::abs(to));
        ASSERT_TRUE(s.scene.set(s.node("C"), x3d::Coordinate::point,
                                Array<Vec3f>{{-wide, -1, 0}, {wide, -1, 0}, {wide, 1, 0}, {-wide, 1, 0}}));
        s.scene.newFrame(s.scene.now() + 1);
        EXPECT_NEAR(double{s.center().r}, mappedLight({1, to, 0}, -1), 2e-6);
    }
    ASSERT_TRUE(s.scene.set(s.node("G"), x3d::IndexedFaceSet::tangent, NodeId{}));
    s.scene.newFrame(s.scene.now() + 1);
    EXPECT_NEAR(double{s.center().r}, mappedLight({1, 0, 0}, 1), 2e-6);
}

// A map of texture coordinates, in double precision: s and t become s(x, y) and t(x, y) of the square's place.

using Plane = std::array<Vec3d, 2>;  // s and t as sums of x, y and 1

/// The brightness of the square in the middle, where (s, t) grow along `s` and `t`.
double mappedLight(const Plane& st) {
    const Vec3d &s = st[0], &t = st[1], n(0, 0, 1);
    const double determinant = s.x * t.y - s.y * t.x;
    const Vec3d along = glm::normalize(Vec3d(t.y, -t.x, 0) / determinant);  // where s grows and t does not
    const Vec3d across = glm::normalize(Vec3d(-s.y, s.x, 0) / determinant);
    const Vec3d mapped =
        (2 * kTexelRed / 255.0 - 1) * along + (2 * kTexelGreen / 255.0 - 1) * across + (2 * kTexelBlue / 255.0 - 1) * n;
    return .8 * std::max(0.0, glm::dot(glm::normalize(mapped), kTowardsLight));
}

/// A texture transform as 18.4.10 has it: Tc' = -C S R C T Tc.
struct CoordinateTransform {
    Vec2d center, scale, translation;
    double rotation = 0;
    explicit CoordinateTransform(std::mt19937& random) {
        std::uniform_real_distribution<double> any(-2, 2), size(.3, 3);
        const auto signedSize = [&] { return random() % 2 ? size(random) : -size(random); };
        center = {any(random), any(random)}, translation = {any(random), any(random)};
        scale = {signedSize(), signedSize()};
        rotation = 2 * any(random);
    }
    Vec2d operator()(Vec2d st) const {
        st += translation + center;
        const double c = std::cos(rotation), n = std::sin(rotation);
        st = {c * st.x - n * st.y, n * st.x + c * st.y};
        return st * scale - center;
    }
    Plane of(const Plane& from) const {
        const Vec2d origin = (*this)({from[0].z, from[1].z});
        const Vec2d x = (*this)({from[0].x + from[0].z, from[1].x + from[1].z}) - origin;
        const Vec2d y = (*this)({from[0].y + from[0].z, from[1].y + from[1].z}) - origin;
        return {Vec3d(x.x, y.x, origin.x), Vec3d(x.y, y.y, origin.y)};
    }
    std::string fields() const {
        return fmt::format("center {} {} rotation {} scale {} {} translation {} {}", center.x, center.y, rotation,
                           scale.x, scale.y, translation.x, translation.y);
    }
    std::string fields3d() const {
        return fmt::format("center {} {} 0 rotation 0 0 1 {} scale {} {} 1 translation {} {} 0", center.x, center.y,
                           rotation, scale.x, scale.y, translation.x, translation.y);
    }
    /// Rows as the field has them, of row vectors (s, t, r, 1).
    std::string matrix() const {
        const Vec2d origin = (*this)({0, 0}), s = (*this)({1, 0}) - origin, t = (*this)({0, 1}) - origin;
        return fmt::format("matrix {} {} 0 0 {} {} 0 0 0 0 1 0 {} {} 0 1", s.x, s.y, t.x, t.y, origin.x, origin.y);
    }
};

/// Coordinates of the square's corners.
std::string coordinates(const Plane& st, const std::string& mapping = {}) {
    std::string points;
    for (const Vec2d corner : {Vec2d(-1, -1), Vec2d(1, -1), Vec2d(1, 1), Vec2d(-1, 1)})
        points += fmt::format(" {} {}", glm::dot(st[0], Vec3d(corner, 1)), glm::dot(st[1], Vec3d(corner, 1)));
    return "solid FALSE texCoord TextureCoordinate { " + mapping + " point [" + points + " ] }";
}
Plane anyPlane(std::mt19937& random) {
    std::uniform_real_distribution<double> any(-1, 1);
    Plane st;
    do {
        for (Vec3d& row : st) row = {any(random), any(random), any(random)};
    } while (std::abs(st[0].x * st[1].y - st[0].y * st[1].x) < .2);
    return st;
}
std::string moved(const std::string& transform) {
    return bumpyMaterial() + " textureTransform " + transform;
}

TEST(NormalTextures, LieAsTheirTransformHasThem) {
    constexpr unsigned kSeed = 41;
    std::mt19937 random(kSeed);
    for (int i = 0; i < 12; ++i) {
        const Plane st = anyPlane(random);
        const CoordinateTransform by(random);
        SCOPED_TRACE(fmt::format("seed {} round {}: {}", kSeed, i, by.fields()));
        const double expected = mappedLight(by.of(st));
        EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), coordinates(by.of(st)))), expected, 1e-5);
        const auto lit = [&](const std::string& transform) {
            return litBy(lamp() + square(1, moved(transform), coordinates(st)));
        };
        EXPECT_NEAR(lit("TextureTransform { " + by.fields() + " }"), expected, 1e-5);
        EXPECT_NEAR(lit("TextureTransform3D { " + by.fields3d() + " }"), expected, 1e-5);
        EXPECT_NEAR(lit("TextureTransformMatrix3D { " + by.matrix() + " }"), expected, 1e-5);
    }
}

// From before and behind, mirrored, by both integrators and of both materials: as with coordinates moved by hand.
TEST(NormalTextures, AreMovedAsTheirCoordinatesAre) {
    constexpr unsigned kSeed = 42;
    std::mt19937 random(kSeed);
    const char* const around[] = {"Transform {{ scale -1 1 1 children {} }}",
                                  "Transform {{ scale 2 1 .5 rotation .6 0 .8 .7 children {} }}",
                                  "Transform {{ scale 1 -3 1 rotation 0 1 0 3 children {} }}"};
    for (const char* position : around)
        for (const Integrator integrator : {Integrator::whitted, Integrator::path})
            for (const char* material : {"Material { ambientIntensity 0", "PhysicalMaterial { roughness .6"}) {
                const Plane st = anyPlane(random);
                const CoordinateTransform by(random);
                SCOPED_TRACE(fmt::format("seed {}: {} {} {}", kSeed, position, material, by.fields()));
                const auto lit = [&](const std::string& more, const std::string& geometry) {
                    return litBy(
                        lamp() + "DirectionalLight { direction -.2 -.3 .9 }" +
                            fmt::format(fmt::runtime(position), square(1, bumpyMaterial(material) + more, geometry)),
                        integrator);
                };
                EXPECT_NEAR(lit(" textureTransform TextureTransform { " + by.fields() + " }", coordinates(st)),
                            lit("", coordinates(by.of(st))), 4e-5);
            }
}

TEST(NormalTextures, GoByTheTransformOfTheirMapping) {
    std::mt19937 random(43);
    const Plane st = anyPlane(random);
    const CoordinateTransform other(random), own(random);
    const std::string material = "Material { ambientIntensity 0 diffuseColor .8 .8 .8 normalTextureMapping \"bumps\"";
    EXPECT_NEAR(
        litBy(lamp() + square(1,
                              bumpyMaterial(material.c_str()) +
                                  " textureTransform MultiTextureTransform { textureTransform [ "
                                  "TextureTransform { mapping \"colours\" " +
                                  other.fields() + " } TextureTransform { mapping \"bumps\" " + own.fields() + " } ] }",
                              coordinates(st, "mapping \"bumps\""))),
        mappedLight(own.of(st)), 1e-5);
}

// A transform that divides: (s, t) / (1 + a s + b t).
TEST(NormalTextures, LieAsAProjectionHasThem) {
    std::mt19937 random(44);
    for (int i = 0; i < 4; ++i) {
        const Plane st = anyPlane(random);
        const double a = .3, b = -.25;
        const double q = 1 + a * st[0].z + b * st[1].z;  // in the middle
        Plane expected;
        for (int axis = 0; axis < 2; ++axis)
            for (int k = 0; k < 2; ++k)
                expected[axis][k] = (st[axis][k] * q - st[axis].z * (a * st[0][k] + b * st[1][k])) / (q * q);
        EXPECT_NEAR(
            litBy(lamp() + square(1,
                                  moved(fmt::format("TextureTransformMatrix3D {{ matrix 1 0 0 {} 0 1 0 {} 0 0 1 0 "
                                                    "0 0 0 1 }}",
                                                    a, b)),
                                  coordinates(st))),
            mappedLight(expected), 1e-5);
    }
}

// Tangents are those of the mesh's own coordinates, which the transform turns.
TEST(NormalTextures, MoveWithTheirTransformWhereTangentsAreGiven) {
    constexpr unsigned kSeed = 45;
    std::mt19937 random(kSeed);
    const Plane st = {Vec3d(.5, 0, .5), Vec3d(0, .5, .5)};
    for (int i = 0; i < 8; ++i) {
        const CoordinateTransform by(random);
        SCOPED_TRACE(fmt::format("seed {} round {}: {}", kSeed, i, by.fields()));
        EXPECT_NEAR(litBy(lamp() + square(1, moved("TextureTransform { " + by.fields() + " }"),
                                          tangents(four("1 0 0 1"), coordinates(st)))),
                    mappedLight(by.of(st)), 1e-5);
    }
}

TEST(NormalTextures, LieAsGeneratedCoordinatesHaveThem) {
    std::mt19937 random(46);
    const auto generated = [](const char* mode) {
        return fmt::format("solid FALSE texCoord TextureCoordinateGenerator {{ mode \"{}\" }}", mode);
    };
    // Normals that lean outwards, and inwards: s and t grow with x and y, and against them.
    const auto leaning = [](double by) {
        return fmt::format(" normal Normal {{ vector [ -{0} -{0} 1 {0} -{0} 1 {0} {0} 1 -{0} {0} 1 ] }}", by);
    };
    for (int i = 0; i < 4; ++i) {
        const CoordinateTransform by(random);
        const std::string appearance = moved("TextureTransform { " + by.fields() + " }");
        EXPECT_NEAR(litBy(lamp() + square(1, appearance, generated("CAMERASPACEPOSITION"))),
                    mappedLight(by.of({Vec3d(1, 0, 0), Vec3d(0, 1, 0)})), 1e-4);
        EXPECT_NEAR(litBy(lamp() + square(1, appearance, generated("SPHERE-LOCAL") + leaning(.3))),
                    mappedLight(by.of({Vec3d(1, 0, 0), Vec3d(0, 1, 0)})), 1e-4);
        EXPECT_NEAR(litBy(lamp() + square(1, appearance, generated("SPHERE") + leaning(.2))),
                    mappedLight(by.of({Vec3d(1, 0, 0), Vec3d(0, 1, 0)})), 1e-4);
    }
    // One texel for all of a face has no direction.
    EXPECT_NEAR(litBy(lamp() + square(1, bumpyMaterial(), generated("SPHERE-LOCAL"))), .8 * kTowardsLight.z, 1e-5);
}

}  // namespace
}  // namespace rtsg
