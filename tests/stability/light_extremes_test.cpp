// Where methods of light fail: each case with a stated outcome, against closed forms or double-precision code.
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/renderers/irradiance.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// A ball of radius 1 with smooth normals, cut into `rows` x `columns` quads, by its points and faces.
struct CoarseBall {
    std::vector<Vec3d> points;
    std::vector<std::vector<std::size_t>> faces;
    CoarseBall(int rows, int columns) {
        for (int row = 0; row <= rows; ++row)
            for (int column = 0; column < columns; ++column) {
                const double down = kPi * row / rows, around = 2 * kPi * column / columns;
                points.emplace_back(std::sin(down) * std::cos(around), std::cos(down),
                                    std::sin(down) * std::sin(around));
            }
        const auto at = [&](int row, int column) { return static_cast<std::size_t>(row * columns + column % columns); };
        for (int row = 0; row < rows; ++row)
            for (int column = 0; column < columns; ++column) {
                if (row > 0) faces.push_back({at(row, column), at(row, column + 1), at(row + 1, column)});
                if (row + 1 < rows)
                    faces.push_back({at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)});
            }
    }
    std::string node(const std::string& appearance) const {
        std::string text =
            fmt::format("Shape {{ appearance Appearance {{ {} }} geometry IndexedFaceSet {{ coordIndex [", appearance);
        for (const auto& face : faces) text += fmt::format("{} {} {} -1,", face[0], face[1], face[2]);
        text += "] coord Coordinate { point [";
        for (const Vec3d& p : points) text += fmt::format("{} {} {},", p.x, p.y, p.z);
        text += "] } normal Normal { vector [";
        for (const Vec3d& p : points) text += fmt::format("{} {} {},", p.x, p.y, p.z);
        return text + "] } } }\n";
    }
};

/// The hit of a ray along -z through (x, y), in double precision: the facet's and the smooth normal.
struct Met {
    bool hit = false;
    Vec3d facet{0}, smooth{0};
    double edge = 1;  // least barycentric coordinate
};
Met meets(const CoarseBall& ball, double x, double y) {
    Met met;
    double nearest = -2;
    for (const auto& face : ball.faces) {
        const Vec3d &a = ball.points[face[0]], &b = ball.points[face[1]], &c = ball.points[face[2]];
        const Vec3d n = glm::cross(b - a, c - a);
        if (!(n.z > 1e-12)) continue;
        const auto area = [&](const Vec3d& p, const Vec3d& q) {
            return ((p.x - x) * (q.y - y) - (q.x - x) * (p.y - y)) / n.z;
        };
        const double u = area(b, c), v = area(c, a), w = area(a, b);
        if (std::min({u, v, w}) < 0) continue;
        const double z = u * a.z + v * b.z + w * c.z;
        if (z < nearest) continue;
        nearest = z;
        met = {true, glm::normalize(n), glm::normalize(u * a + v * b + w * c), std::min({u, v, w})};
    }
    return met;
}

// The terminator: a coarse mesh with smooth normals is lit as the curve that it represents. A point whose smooth normal
// faces the light, on a facet that does not, shows the smooth normal's cosine like all others.
TEST(LightExtremes, CoarseMeshesAreSmoothlyLitAsTheCurveTheyStandFor) {
    constexpr int kSide = 64;
    const CoarseBall ball(10, 18);
    const Vec3d light = glm::normalize(Vec3d(1, .3, .1));
    LightScene s(fmt::format("OrthoViewpoint {{ position 0 0 5 fieldOfView [-1.1 -1.1 1.1 1.1] }} DirectionalLight {{ "
                             "direction {} {} {} shadows TRUE }}",
                             -light.x, -light.y, -light.z) +
                     ball.node(matte("1 1 1")),
                 kSide, kSide);
    s.options.settings.colorSpace = ColorSpace::linear;
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        s.options.settings.integrator = integrator;
        const Picture p = s.picture();
        int lit = 0, dark = 0;
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x) {
                const Met met = meets(ball, ((x + .5) / kSide - .5) * 2.2, (.5 - (y + .5) / kSide) * 2.2);
                if (!met.hit || met.edge < 1e-4) continue;
                const double cosine = std::max(0., glm::dot(met.smooth, light));
                const bool shadowed = glm::dot(met.facet, light) < 0;
                EXPECT_NEAR(p.at(x, y).r, cosine, 1e-4) << x << ' ' << y;
                lit += cosine > 0, dark += cosine > 0 && shadowed;
            }
        EXPECT_GT(dark, 30) << "of " << lit << ": otherwise this tests nothing";
    }
}

// Normals that are not there or have no length are the facet's own. Those that point away from the eye are believed:
// nothing lights that side.
TEST(LightExtremes, NormalsThatAreAbsentOrOfNoUse) {
    const auto seen = [](const std::string& geometry, const std::string& normals, Integrator integrator) {
        LightScene s(fmt::format("DirectionalLight {{ direction {} 0 {} }} Viewpoint {{ position 0 0 5 }} Shape {{ "
                                 "appearance Appearance {{ {} }} geometry {} {} coord Coordinate {{ point [-9 -9 0, 9 "
                                 "-9 0, 9 9 0, -9 9 0] }} }} }}",
                                 -std::sin(1.), -std::cos(1.), matte("1 1 1"), geometry, normals),
                     9, 9);
        s.options.settings.integrator = integrator;
        return s.center().r;
    };
    const auto four = [](const char* normal) {
        return fmt::format("normal Normal {{ vector [{0}, {0}, {0}, {0}] }}", normal);
    };
    for (const char* geometry :
         {"TriangleFanSet { fanCount 4", "IndexedTriangleFanSet { index [0 1 2 3 -1]",
          "IndexedFaceSet { coordIndex [0 1 2 3 -1]", "IndexedFaceSet { normalPerVertex FALSE coordIndex [0 1 2 3 -1]"})
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            SCOPED_TRACE(geometry);
            EXPECT_NEAR(seen(geometry, "", integrator), std::cos(1.), 1e-6);
            EXPECT_NEAR(seen(geometry, four("0 0 0"), integrator), std::cos(1.), 1e-6);
            EXPECT_NEAR(seen(geometry, four("1 0 0"), integrator), std::sin(1.), 1e-6);
            EXPECT_EQ(seen(geometry, four("0 0 -1"), integrator), 0);
        }
}

// A plane that is seen and lit along itself, down to a hundred-thousandth of a radian: no shadow of its own falls on
// it.
TEST(LightExtremes, GrazingEyesAndLights) {
    for (const double up : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5})
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            const double cosine = std::cos(up), sine = std::sin(up);
            LightScene s(fmt::format("OrthoViewpoint {{ position {0} 0 {1} orientation 0 1 0 {2} fieldOfView [-{3} "
                                     "-{3} {3} {3}] }} DirectionalLight {{ direction {4} 0 -{5} shadows TRUE }} {6}",
                                     200 * cosine, 200 * sine, kPi / 2 - up, 50 * sine, cosine, sine,
                                     square(100, matte("1 1 1"))),
                         15, 15);
            s.options.settings.integrator = integrator;
            for (const Vec4f& pixel : s.picture().pixels) EXPECT_NEAR(pixel.r / sine, 1, 1e-6) << up;
        }
}

/// Faces down from a height, with radiance 1.
std::string lampAbove(double height, const std::string& geometry) {
    return fmt::format(
        "Transform {{ translation 0 {} 0 rotation 1 0 0 1.5707963267948966 children Shape {{ appearance Appearance {{ "
        "material UnlitMaterial {{ emissiveColor 1 1 1 }} }} geometry {} }} }}\n",
        height, geometry);
}
Irradiance below(const std::string& lamp) {
    LightScene s(lamp);
    LightTracer tracer;
    s.world->add(tracer);
    IrradianceSettings settings;
    settings.error = .005;
    auto found = measureIrradiance(*tracer.latest(), s.world->rays(), {0, 0, 0}, {0, 1, 0}, settings);
    EXPECT_TRUE(found);
    return found.value_or(Irradiance());
}

// Lamps of a micrometre to a million kilometres, as form factors have them.
TEST(LightExtremes, TinyAndHugeLamps) {
    for (const double half : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1., 1e2, 1e4, 1e6, 1e9}) {
        const double slant = half / std::hypot(1, half), expected = 4 * slant * std::atan(slant);
        const Irradiance found = below(lampAbove(1, fmt::format("Rectangle2D {{ size {0} {0} }}", 2 * half)));
        EXPECT_TRUE(found.reached);
        EXPECT_NEAR(found.luminous, expected, 2.6 * found.luminousInterval + 1e-6 * expected) << half;
    }
    constexpr double kOfCut = .004;  // a Sphere's chords
    for (const double radius : {1e-6, 1e-4, 1e-2}) {
        const double expected = kPi * radius * radius / 4;
        const Irradiance found = below(lampAbove(2, fmt::format("Sphere {{ radius {} }}", radius)));
        EXPECT_TRUE(found.reached);
        EXPECT_NEAR(found.luminous, expected, 2.6 * found.luminousInterval + kOfCut * expected) << radius;
    }
    for (const double radius : {1e-2, 1., 1e2, 1e4, 1e6, 1e7}) {
        const Irradiance found = below(lampAbove(2 * radius, fmt::format("Sphere {{ radius {} }}", radius)));
        EXPECT_TRUE(found.reached);
        EXPECT_NEAR(found.luminous, kPi / 4, 2.6 * found.luminousInterval + kOfCut * kPi / 4) << radius;
    }
    for (const double intensity : {1e-30, 1e-10, 1e10, 1e30}) {
        LightScene s(fmt::format("DirectionalLight {{ direction {} 0 {} intensity {} }} {}", -std::sin(1.),
                                 -std::cos(1.), intensity, square(9, matte("1 1 1"))),
                     3, 3);
        s.options.settings.colorSpace = ColorSpace::linear;
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            s.options.settings.integrator = integrator;
            EXPECT_NEAR(s.center().r / intensity, std::cos(1.), 1e-6) << intensity;
        }
    }
}

/// A room with a block under a square lamp of radiance 1, which the eye does not see: its mean, and its brightest one
/// of 9,216 samples.
struct Brightest {
    double mean = 0, maximum = 0;
    Brightest(double lamp, const std::string& block, const char* solid) {
        LightScene s(
            fmt::format(
                "Viewpoint {{ position 0 0 1.9 fieldOfView 1 }} Shape {{ appearance Appearance {{ material Material {{ "
                "diffuseColor .8 .8 .8 }} }} geometry Box {{ size 4 3 4 solid FALSE }} }} Transform {{ translation 0 "
                "1.49 0 rotation 1 0 0 1.5707963 children Shape {{ appearance Appearance {{ material UnlitMaterial {{ "
                "emissiveColor 1 1 1 }} }} geometry Rectangle2D {{ size {0} {0} solid {2} }} }} }} Transform {{ "
                "translation -.6 -1 -.5 children Shape {{ appearance Appearance {{ {1} }} geometry Box {{ size .8 1 .8 "
                "}} }} }}",
                lamp, block, solid),
            48, 48);
        s.options.settings.integrator = Integrator::path;
        s.options.settings.samplesPerPixel = 1;
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
            s.options.settings.seed = seed;
            const Picture p = s.picture();
            for (const Vec4f& pixel : p.pixels)
                maximum = std::max(maximum, double{pixel.r}), mean += double{pixel.r} / (4. * double(p.pixels.size()));
        }
    }
};

// Fireflies: nothing is clamped, and no sample is brighter than the lamp itself, whatever it has come by. Where the
// lamp is asked from every surface that it shines on, none is far above the mean. (Glass lets light through by bounces
// alone; a lamp that shines on the ceiling a centimetre behind it makes a second lamp, which only bounces find.)
TEST(LightExtremes, NoSampleOutshinesTheLamp) {
    const std::string matteBlock = matte(".8 .3 .2"),
                      metal = "material PhysicalMaterial { metallic 1 roughness .3 baseColor .9 .9 .9 }",
                      polished = "material PhysicalMaterial { metallic 1 roughness .05 baseColor .9 .9 .9 }",
                      highlight = "material Material { diffuseColor .2 .2 .2 specularColor .7 .7 .7 shininess .9 }";
    for (const double lamp : {1., .1, .01})
        for (const std::string& block : {matteBlock, metal, polished, highlight, glass(1.5)}) {
            SCOPED_TRACE(fmt::format("{} {}", lamp, block));
            const Brightest down(lamp, block, "TRUE"), both(lamp, block, "FALSE");
            EXPECT_LE(down.maximum, 1);
            EXPECT_LE(both.maximum, 1);
            EXPECT_GT(down.mean, .014 * lamp * lamp);
            if (block == matteBlock) {
                EXPECT_LT(down.maximum, 4 * down.mean);
            }
        }
}

}  // namespace
}  // namespace rtsg
