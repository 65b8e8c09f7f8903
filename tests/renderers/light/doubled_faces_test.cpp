// Faces that a file has twice, once for each side, as solids: which of two that coincide a ray meets is a matter of
// roundings, and the back of a solid is not there; what is seen is the front of the other, against areas and colours.
#include <glm/gtc/quaternion.hpp>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

const char* const kSquareEye = "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } ";
// Its triangles are others the other way round.
const char* const kPentagon = "coord Coordinate { point [-1 -1 0, 1 -1 0, 1.3 .2 0, 1 1 0, -1 1 0] }";
constexpr double kPentagonArea = 4 + .3;

std::string leaning(const glm::dquat& q, const std::string& children) {
    return fmt::format("Transform {{ translation .05 .1 -3 rotation {} {} {} {} children [ {} ] }}\n", glm::axis(q).x,
                       glm::axis(q).y, glm::axis(q).z, glm::angle(q), children);
}
/// Red in front, green behind.
std::string oneShape() {
    return fmt::format(
        "Shape {{ appearance Appearance {{ {} }} geometry IndexedFaceSet {{ coordIndex [0 1 2 3 4 -1 4 3 2 1 0 -1] {} "
        "colorPerVertex FALSE color Color {{ color [1 0 0, 0 1 0] }} }} }}",
        unlit("1 1 1"), kPentagon);
}
std::string twoShapes() {
    const auto shape = [](const char* color, const char* order) {
        return fmt::format(
            "Shape {{ appearance Appearance {{ {} }} geometry IndexedFaceSet {{ coordIndex [{} -1] {} }} }}",
            unlit(color), order, kPentagon);
    };
    return shape("1 0 0", "0 1 2 3 4") + shape("0 1 0", "2 1 0 4 3");
}

TEST(DoubledFaces, ShowTheSideThatIsTurnedToTheEye) {
    constexpr int kSize = 120;
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const std::string& shapes : {oneShape(), twoShapes()})
            for (int i = 0; i < 12; ++i) {
                const glm::dquat q = glm::angleAxis(.4 + .47 * i, glm::normalize(Vec3d(1, .3 * i - 1, .2)));
                LightScene s(kSquareEye + leaning(q, shapes), kSize, kSize);
                s.options.settings.integrator = integrator;
                s.options.settings.samplesPerPixel = 4;
                const double facing = (q * Vec3d(0, 0, 1)).z;
                const Picture p = s.picture();
                Vec3d sum(0);
                for (const Vec4f& pixel : p.pixels) sum += Vec3d(pixel) / double(kSize * kSize);
                SCOPED_TRACE(fmt::format("{} {}", i, facing));
                EXPECT_NEAR(sum[facing > 0 ? 0 : 1], kPentagonArea * std::abs(facing) / 16, .003);
                EXPECT_EQ(sum[facing > 0 ? 1 : 0], 0) << "the other side";
            }
}

TEST(DoubledFaces, ShowThemselvesAmongManyOthers) {
    std::string behind;
    for (int i = 0; i < 16; ++i)
        behind += fmt::format(
            "Transform {{ translation {} {} -.3 children Shape {{ appearance Appearance {{ {} }} geometry Sphere {{ "
            "radius .2 }} }} }}",
            -.7 + .45 * (i % 4), -.7 + .45 * (i / 4), unlit("0 0 1"));
    const glm::dquat q = glm::angleAxis(.1, glm::normalize(Vec3d(1, 2, .5)));
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        LightScene s(kSquareEye + leaning(q, oneShape() + behind), 120, 120);
        s.options.settings.integrator = integrator;
        s.options.settings.samplesPerPixel = 4;
        const Picture p = s.picture();
        Vec3d sum(0);
        for (const Vec4f& pixel : p.pixels) sum += Vec3d(pixel) / (120.0 * 120);
        EXPECT_NEAR(sum.r, kPentagonArea * (q * Vec3d(0, 0, 1)).z / 16, .003);
        EXPECT_EQ(sum.g, 0);
        EXPECT_EQ(sum.b, 0);
    }
}

/// All six sides of a box twice, as an author's program writes them.
std::string doubledRoom(const std::string& appearance) {
    return fmt::format(
        "Shape {{ appearance Appearance {{ {} }} geometry IndexedFaceSet {{ coordIndex [0 1 2 3 -1 3 2 1 0 -1 "
        "4 5 6 7 -1 7 6 5 4 -1 0 1 5 4 -1 4 5 1 0 -1 1 2 6 5 -1 5 6 2 1 -1 2 3 7 6 -1 6 7 3 2 -1 3 0 4 7 -1 7 4 0 3 "
        "-1] coord Coordinate {{ point [-3.1 -2.2 -4, 3 -2.2 -4, 3 2.3 -4, -3.1 2.3 -4, -3.1 -2.2 17, 3 -2.2 17, "
        "3 2.3 17, -3.1 2.3 17] }} }} }}",
        appearance);
}

TEST(DoubledFaces, LetNoSkyInByBounces) {
    LightScene s("Viewpoint { } Background { skyColor 1 1 1 } " +
                     leaning(glm::angleAxis(.1, glm::normalize(Vec3d(1, 2, 3))), doubledRoom(matte(".5 .5 .5"))),
                 24, 24);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 16;
    const Picture p = s.picture();
    for (const Vec4f& pixel : p.pixels) ASSERT_EQ(pixel, Vec4f(0, 0, 0, 1));
}

TEST(DoubledFaces, HideTheSkyBehindClearPanes) {
    const std::string pane = "Transform { translation 0 0 2 children " +
                             square(9, "material UnlitMaterial { emissiveColor 0 0 0 transparency .5 }") + "}";
    LightScene s(kSquareEye + std::string("Background { skyColor 1 1 1 } ") + pane +
                     leaning(glm::angleAxis(.2, glm::normalize(Vec3d(1, 1, 0))), oneShape()),
                 32, 32);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 64;
    EXPECT_EQ(s.picture().at(16, 16).a, 1);
}

TEST(DoubledFaces, ThatShineLightBothSides) {
    const auto seen = [](const std::string& lamp) {
        LightScene s("Viewpoint { position 0 0 8 } Transform { translation 0 0 -1 children " +
                         square(3, matte("1 1 1")) +
                         "} Transform { translation 0 -1.4 0 rotation 1 0 0 1.2 scale .5 .5 .5 children " + lamp + "}",
                     33, 33);
        s.options.settings.integrator = Integrator::path;
        s.options.settings.samplesPerPixel = 1024;
        const Picture p = s.picture();
        double sum = 0;
        for (int y = 10; y < 17; ++y)
            for (int x = 10; x < 23; ++x) sum += p.at(x, y).r / (7.0 * 13);
        return sum;
    };
    const auto lamp = [](const char* order, const char* more) {
        return fmt::format(
            "Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 emissiveColor 1 1 1 }} }} "
            "geometry IndexedFaceSet {{ {} coordIndex [{}] {} }} }}",
            more, order, kPentagon);
    };
    const double single = seen(lamp("0 1 2 3 4 -1", "solid FALSE"));
    EXPECT_GT(single, .01);
    EXPECT_NEAR(seen(lamp("0 1 2 3 4 -1 4 3 2 1 0 -1", "")) / single, 1, .02);
}

}  // namespace
}  // namespace rtsg
