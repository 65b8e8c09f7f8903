// Tangents of X3D 4.1 in pictures: normal textures lie where they say, against an evaluation of its own in double
// precision, and where they say what the texture coordinates say, as without them.
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

/// What the light makes of the square that faces +z, by glTF's meaning: bitangent = w (normal x tangent).
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

// Of any length, and taken into the plane across the normal.
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
    for (const char* place : around)
        for (const Integrator integrator : {Integrator::whitted, Integrator::path})
            for (const char* material : {"Material { ambientIntensity 0", "PhysicalMaterial { roughness .6"}) {
                const auto scene = [&](const std::string& geometry) {
                    return lamp() + "DirectionalLight { direction -.2 -.3 .9 }" +
                           fmt::format(fmt::runtime(place), square(1, bumpyMaterial(material), geometry));
                };
                const double without = litBy(scene("solid FALSE"), integrator);
                EXPECT_GT(without, .004);
                EXPECT_NEAR(litBy(scene(given), integrator), without, 2e-5) << place << material;
                // Else this could not fail.
                EXPECT_GT(std::abs(litBy(scene(tangents(four("0 1 0 -1"))), integrator) - without), 1e-3) << place;
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
    const Diagnostics told = s.world->diagnostics();
    for (const Diagnostic& d : told.all()) said += d.text;
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

}  // namespace
}  // namespace rtsg
