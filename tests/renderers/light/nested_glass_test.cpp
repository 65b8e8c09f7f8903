// Bodies of glass and water in, beside and across each other, against the closed forms of stacks of slabs and of balls
// in double precision.
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// Fresnel's mean reflectance between two media, of rays that come out of air at an angle whose sine is this.
double mirroredBetween(double a, double b, double sine) {
    const double in = std::sqrt(1 - std::pow(sine / a, 2)), out = std::sqrt(1 - std::pow(sine / b, 2));
    const double s = (a * in - b * out) / (a * in + b * out), p = (b * in - a * out) / (b * in + a * out);
    return (s * s + p * p) / 2;
}

/// The light that a stack of media between air and air transmits, with all internal reflections (no interference).
double throughStack(std::vector<double> indices, double angle = 0) {
    indices.insert(indices.begin(), 1.0), indices.push_back(1.0);
    double passes = 1, mirrors = 0;  // of all interfaces so far, the latter from the far side
    for (std::size_t i = 0; i + 1 < indices.size(); ++i) {
        const double r = mirroredBetween(indices[i], indices[i + 1], std::sin(angle));
        passes *= (1 - r) / (1 - mirrors * r);
        mirrors = r + (1 - r) * (1 - r) * mirrors / (1 - mirrors * r);
    }
    return passes;
}

/// A block of glass from z = `from` to z = `to`.
std::string block(double index, double from, double to, double side = 8, const char* more = "") {
    return fmt::format(
        "Transform {{ translation 0 0 {} children Shape {{ appearance Appearance {{ {} }} geometry "
        "Box {{ size {} {} {} }} }} }}\n",
        (from + to) / 2, glass(index, more), side, side, to - from);
}
std::string white() {
    return "Transform { translation 0 0 -2 children " + square(100, unlit("1 1 1")) + "}";
}

/// The middle of the picture, by both integrators.
void expectThrough(const std::string& body, double expected, const char* what) {
    LightScene s("Viewpoint { fieldOfView .02 }" + body + white(), 9, 9);
    s.options.settings.cutoff = 1e-7f;
    s.options.settings.colorSpace = ColorSpace::linear;
    EXPECT_NEAR(s.center().r, expected, 3e-5) << what << ", whitted";
    EXPECT_EQ(s.stats.missing, 0);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 4096;
    const Picture p = s.picture();
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel.r / static_cast<double>(p.pixels.size());
    EXPECT_NEAR(sum, expected, 1.5e-3) << what << ", path";
}

// A slab of glass in water reflects as glass and water do; water that it takes the place of is not there. In the files
// the bodies come in either order, and rays run along either direction.
TEST(NestedGlass, SlabInWater) {
    const double expected = throughStack({1.33, 1.5, 1.33});
    EXPECT_NEAR(expected, .9546, 1e-3);
    expectThrough(block(1.33, 0, 3, 9) + block(1.5, 1, 2), expected, "water first");
    expectThrough(block(1.5, 1, 2) + block(1.33, 0, 3, 9), expected, "glass first");
}

TEST(NestedGlass, BlocksThatShareAFace) {
    const double expected = throughStack({1.33, 1.5});
    EXPECT_NEAR(expected, .9379, 1e-3);
    expectThrough(block(1.33, 0, 1) + block(1.5, 1, 2), expected, "water behind");
    expectThrough(block(1.5, 0, 1) + block(1.33, 1, 2), expected, "glass behind");
    // Faces that roundings put apart, and of other sizes.
    expectThrough("Transform { rotation 0 1 0 .3 center 0 0 1.7 children [" + block(1.33, .37, 1.71) +
                      block(1.33, 1.71, 2.9, 5) + "] }",
                  throughStack({1.33}, .3), "the same on both sides");
    const double alike = throughStack({1.4});
    expectThrough(block(1.4, 0, .1) + block(1.4, .1, .7, 3) + block(1.4, .7, 1.3), alike, "three as one");
}

TEST(NestedGlass, BlocksThatOverlapByAMillimetre) {
    const double expected = throughStack({1.33, 1.5});
    expectThrough(block(1.33, 0, 1.001) + block(1.5, 1, 2), expected, "water behind");
    expectThrough(block(1.5, 0, 1) + block(1.33, .999, 2), expected, "glass behind");
}

TEST(NestedGlass, BubblesAndShellsInGlass) {
    expectThrough(block(1.5, 0, 3, 9) + block(1, 1, 2), throughStack({1.5, 1, 1.5}), "a bubble is air");
    expectThrough(block(1.33, -1, 4, 9) + block(1.5, 0, 3, 8.5) + block(1, 1, 2),
                  throughStack({1.33, 1.5, 1, 1.5, 1.33}), "a bubble in glass in water");
}

// The author says what is there where bodies overlap.
TEST(NestedGlass, PriorityDecides) {
    const char* const first = "MetadataFloat { name \"priority\" value 2 }";
    expectThrough(block(1.33, 0, 3, 9, first) + block(1.5, 1, 2), throughStack({1.33}), "the larger one alone");
    expectThrough(block(1.33, 0, 1.5, 8, first) + block(1.5, 1, 3), throughStack({1.33, 1.5}), "one over the other");
}

// The body that counts is the one that absorbs.
TEST(NestedGlass, AbsorptionIsThatOfTheBodyThatIsThere) {
    const std::string dim = "MetadataFloat { name \"absorption\" value .5 }";
    for (const bool path : {false, true}) {
        LightScene s(block(1.0001, 0, 3, 9, dim.c_str()) + block(1.0001, 1, 2) + white(), 9, 9);
        if (path) s.options.settings.integrator = Integrator::path, s.options.settings.samplesPerPixel = 256;
        s.options.settings.colorSpace = ColorSpace::linear;
        EXPECT_NEAR(s.center().r, std::exp(-1.0), 2e-3) << path;
    }
}

// An eye in the water sees a slab in it, and what lies outside through its surface.
TEST(NestedGlass, TheEyeIsInTheWater) {
    const double mirrored = mirroredBetween(1.33, 1.5, 0), slab = (1 - mirrored) / (1 + mirrored);
    LightScene in("Viewpoint { position 0 0 5 }" + block(1.33, -1, 9, 30) + block(1.5, 1, 2) +
                      "Transform { translation 0 0 .5 children " + square(8, unlit("1 1 1")) + "}",
                  9, 9);
    in.options.settings.colorSpace = ColorSpace::linear;
    in.options.settings.cutoff = 1e-7f;
    EXPECT_NEAR(in.center().r, slab, 2e-3);
    // The first body that the ray enters absorbs.
    LightScene dim("Viewpoint { position 0 0 5 }" +
                       block(1.0001, 0, 9, 30, "MetadataFloat { name \"absorption\" value .2 }") + white(),
                   9, 9);
    dim.options.settings.colorSpace = ColorSpace::linear;
    EXPECT_NEAR(dim.center().r, std::exp(-1.0), 1e-3);
    dim.options.settings.integrator = Integrator::path, dim.options.settings.samplesPerPixel = 64;
    EXPECT_NEAR(dim.center().r, std::exp(-1.0), 1e-3);
}

// A ball of nearly the same index as the water around it bends little, and throws nearly no shadow.
TEST(NestedGlass, ABallInWaterIsNearlyUnseen) {
    const std::string water = "Shape { appearance Appearance { " + glass(1.33) + " } geometry Box { size 6 6 3 } }";
    const std::string ball = "Shape { appearance Appearance { " + glass(1.3301) + " } geometry Sphere { } }";
    const std::string stripes =
        "DirectionalLight { direction 0 0 -1 intensity .5 } Transform { translation 0 0 -3 children " +
        square(20, "material Material { diffuseColor 1 1 1 }") + "}";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        Picture seen[2];
        for (const bool with : {false, true}) {
            LightScene s(stripes + water + (with ? ball : ""), 24, 24);
            s.options.settings.integrator = integrator;
            s.options.settings.colorSpace = ColorSpace::linear;
            s.options.settings.samplesPerPixel = integrator == Integrator::path ? 256 : 1;
            seen[with] = s.picture();
        }
        double maximum = 0;
        for (std::size_t i = 0; i < seen[0].pixels.size(); ++i)
            maximum = std::max(maximum, std::abs(double{seen[0].pixels[i].r} - seen[1].pixels[i].r));
        EXPECT_LT(maximum, integrator == Integrator::path ? .1 : .05) << static_cast<int>(integrator);
        EXPECT_GT(seen[0].at(12, 12).r, .3);
    }
}

// Shadow rays lose at each surface what lies between what it separates: a slab in water, as seen by a wall in it.
TEST(NestedGlass, ShadowsLoseWhatInterfacesMirror) {
    const double expected = (1 - mirroredBetween(1, 1.33, 0)) * std::pow(1 - mirroredBetween(1.33, 1.5, 0), 2);
    const auto lit = [&](const std::string& water, const std::string& slab) {
        LightScene s("Viewpoint { position 0 0 .9 } DirectionalLight { direction 0 0 -1 }" + water + slab +
                         "Transform { translation 0 0 .5 children " + square(8, matte("1 1 1")) + "}",
                     9, 9);
        s.options.settings.colorSpace = ColorSpace::linear;
        return s.center().r;
    };
    EXPECT_NEAR(lit(block(1.33, -1, 9, 30), block(1.5, 1, 2, 28)), expected, 2e-3);
    EXPECT_NEAR(lit(block(1.33, -1, 9, 30), block(1.5, 1, 1.5, 28) + block(1.5, 1.5, 2, 28)), expected, 2e-3)
        << "two blocks that share a face";
}

// One mesh of two boxes that overlap is one body.
TEST(NestedGlass, AMeshThatOverlapsItself) {
    const auto box = [](double from, double to, int first) {
        std::string index;
        for (const char* face : {"0 3 2 1", "4 5 6 7", "0 1 5 4", "1 2 6 5", "2 3 7 6", "3 0 4 7"}) {
            for (const char* c = face; *c; ++c)
                if (*c != ' ') index += fmt::format("{} ", first + (*c - '0'));
            index += "-1 ";
        }
        return std::pair(index, fmt::format("-4 -4 {0}, 4 -4 {0}, 4 4 {0}, -4 4 {0}, -4 -4 {1}, 4 -4 {1}, 4 4 {1}, "
                                            "-4 4 {1},",
                                            from, to));
    };
    const auto [a, ofA] = box(0, 1.2, 0);
    const auto [b, ofB] = box(.9, 2, 8);
    expectThrough("Shape { appearance Appearance { " + glass(1.5) + " } geometry IndexedFaceSet { coordIndex [" + a +
                      b + "] coord Coordinate { point [" + ofA + ofB + "] } } }",
                  throughStack({1.5}), "one block");
}

}  // namespace
}  // namespace rtsg
