// One function behind value, density and samples: chi-square tests, reciprocity, energy; in double where it integrates.
#include "texture/bsdf.h"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace rtsg::trace {
namespace {

constexpr double kPiOfBsdf = std::numbers::pi;

struct Case {
    const char* name;
    Bsdf bsdf;
    bool reciprocal;
};

std::vector<Case> cases() {
    std::vector<Case> result{
        {"matte", Bsdf::phong(Vec3f(0.9f, 0.5f, 0.1f), Vec3f(0), 0), true},
        {"shiny", Bsdf::phong(Vec3f(0.5f), energyLimited(Vec3f(0.5f), Vec3f(1), 25.6f), 25.6f), false},
        {"gloss alone", Bsdf::phong(Vec3f(0), Vec3f(0.4f, 0.3f, 0.2f), 6), false},
        {"wide gloss", Bsdf::phong(Vec3f(0.2f), Vec3f(0.4f), 0), false}};
    for (const float roughness : {0.3f, 0.6f, 1.0f})
        for (const float metallic : {0.0f, 0.5f, 1.0f})
            result.push_back({"physical", Bsdf::physical(Vec3f(0.9f, 0.6f, 0.3f), metallic, roughness), true});
    return result;
}

Vec3f direction(double cosine, double phi) {
    const double s = std::sqrt(std::max(1 - cosine * cosine, 0.0));
    return Vec3f(Vec3d(s * std::cos(phi), s * std::sin(phi), cosine));
}
Vec3f viewAt(double degrees) {
    return direction(std::cos(degrees * kPiOfBsdf / 180), 0.7);
}

/// Regularised upper incomplete gamma function Q(a, x): the chi-square distribution's tail.
double upperGamma(double a, double x) {
    if (x < a + 1) {
        double sum = 1 / a, term = sum;
        for (int n = 1; n < 10000 && term > sum * 1e-15; ++n) sum += term *= x / (a + n);
        return 1 - sum * std::exp(-x + a * std::log(x) - std::lgamma(a));
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int i = 1; i < 10000; ++i) {
        const double an = -i * (i - a);
        b += 2;
        d = 1 / (an * d + b), c = b + an / c;
        h *= d * c;
        if (std::abs(d * c - 1) < 1e-14) break;
    }
    return h * std::exp(-x + a * std::log(x) - std::lgamma(a));
}

constexpr int kRows = 16, kColumns = 24;

/// The density's integral over a cell of the sphere, by the midpoint rule.
double expectedFraction(const Bsdf& bsdf, const Vec3f& view, int row, int column) {
    constexpr int kFine = 24;
    double sum = 0;
    for (int i = 0; i < kFine; ++i)
        for (int j = 0; j < kFine; ++j)
            sum += bsdf.density(view, direction(-1 + 2 * (row + (i + 0.5) / kFine) / kRows,
                                                2 * kPiOfBsdf * (column + (j + 0.5) / kFine) / kColumns));
    return sum / (kFine * kFine) * (2.0 / kRows) * (2 * kPiOfBsdf / kColumns);
}

// Pearson's test of 40,000 samples against the density; cells that expect fewer than 5 are pooled.
TEST(Bsdf, SamplesFollowTheDensity) {
    const std::uint64_t seed = 20261120;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> unit(0, std::nextafter(1.0f, 0.0f));
    constexpr int kSamples = 40'000;
    int tests = 0;
    for (const Case& c : cases())
        for (const double degrees : {0.0, 45.0, 80.0}) {
            const Vec3f view = viewAt(degrees);
            std::vector<double> counted(kRows * kColumns);
            for (int i = 0; i < kSamples; ++i) {
                const Vec3f d = c.bsdf.sample(view, unit(random), unit(random), unit(random)).direction;
                ASSERT_NEAR(glm::length(d), 1, 1e-4);
                const int row = std::clamp(static_cast<int>((d.z + 1) / 2 * kRows), 0, kRows - 1);
                const double phi = std::atan2(d.y, d.x), angle = phi < 0 ? phi + 2 * kPiOfBsdf : phi;
                const int column = std::clamp(static_cast<int>(angle / (2 * kPiOfBsdf) * kColumns), 0, kColumns - 1);
                ++counted[static_cast<std::size_t>(row * kColumns + column)];
            }
            double statistic = 0, pooledSeen = 0, pooledExpected = 0, total = 0;
            int cells = 0;
            const auto count = [&](double seen, double expected) {
                statistic += (seen - expected) * (seen - expected) / expected;
                ++cells;
            };
            for (int row = 0; row < kRows; ++row)
                for (int column = 0; column < kColumns; ++column) {
                    const double expected = kSamples * expectedFraction(c.bsdf, view, row, column);
                    const double seen = counted[static_cast<std::size_t>(row * kColumns + column)];
                    total += expected;
                    if (expected < 5)
                        pooledSeen += seen, pooledExpected += expected;
                    else
                        count(seen, expected);
                }
            if (pooledExpected > 5) count(pooledSeen, pooledExpected);
            // The midpoint rule blurs the integrable poles of grazing lobes.
            EXPECT_NEAR(total / kSamples, 1, 0.015) << c.name << ' ' << degrees << ": the density's integral";
            // One chance in 10^4 over all tests together.
            EXPECT_GT(upperGamma((cells - 1) / 2.0, statistic / 2), 1e-4 / 39)
                << c.name << " at " << degrees << " degrees, seed " << seed << ": chi-square " << statistic << " of "
                << cells << " cells";
            ++tests;
        }
    EXPECT_EQ(tests, 39);
}

TEST(Bsdf, WeightIsValueOverDensity) {
    std::mt19937_64 random(7);
    std::uniform_real_distribution<float> unit(0, 0.999999f);
    for (const Case& c : cases())
        for (int i = 0; i < 200; ++i) {
            const Vec3f view = direction(0.05 + 0.95 * unit(random), 6 * unit(random));
            const BsdfSample s = c.bsdf.sample(view, unit(random), unit(random), unit(random));
            const Vec3f expected =
                c.bsdf.value(view, s.direction) / float(kPiOfBsdf) / c.bsdf.density(view, s.direction);
            for (int k = 0; k < 3; ++k) EXPECT_NEAR(s.weight[k], expected[k], 1e-5 * (1 + expected[k])) << c.name;
            if (s.direction.z <= 0) {
                EXPECT_EQ(s.weight, Vec3f(0)) << c.name;
            }
        }
}

// Helmholtz: the BRDF is the same with view and light exchanged. X3D's highlight is not.
TEST(Bsdf, PhysicalAndMatteAreReciprocal) {
    std::mt19937_64 random(8);
    std::uniform_real_distribution<double> unit(0, 1);
    double worstPhong = 0;
    for (const Case& c : cases())
        for (int i = 0; i < 300; ++i) {
            const Vec3f a = direction(0.05 + 0.95 * unit(random), 7 * unit(random)),
                        b = direction(0.05 + 0.95 * unit(random), 7 * unit(random));
            const float forth = c.bsdf.value(a, b).r / b.z, back = c.bsdf.value(b, a).r / a.z;
            if (c.reciprocal) {
                EXPECT_NEAR(forth, back, 1e-4 * (1 + forth)) << c.name;
            } else {
                worstPhong = std::max(worstPhong, double(std::abs(forth - back)));
            }
        }
    EXPECT_GT(worstPhong, 0.1) << "the test can tell";
}

/// 1 / pi times the integral of value() over all lights: what a white sky shows.
double albedo(const Bsdf& bsdf, const Vec3f& view, int steps = 500) {
    double sum = 0;
    for (int i = 0; i < steps; ++i)
        for (int j = 0; j < steps; ++j)
            sum += bsdf.value(view, direction((i + 0.5) / steps, 2 * kPiOfBsdf * (j + 0.5) / steps)).r;
    return sum / (double(steps) * steps) * 2;
}

TEST(Bsdf, NoneSendsOnMoreThanItGets) {
    for (const float roughness : {0.2f, 0.4f, 0.7f, 1.0f})
        for (const float metallic : {0.0f, 0.5f, 1.0f})
            for (const float color : {0.5f, 1.0f, 7.0f})
                for (const double degrees : {0.0, 30.0, 60.0, 80.0, 88.0}) {
                    const Vec3f view = viewAt(degrees),
                                limited = energyLimited(Vec3f(color), metallic, roughness, view.z);
                    EXPECT_LE(albedo(Bsdf::physical(limited, metallic, roughness), view), 1.01)
                        << color << ' ' << metallic << ' ' << roughness << ' ' << degrees;
                    if (color == 0.5f && degrees < 70) {
                        EXPECT_EQ(limited, Vec3f(color)) << "stays as it is";
                    }
                }
    std::vector<Case> all;
    for (const float exponent : {0.0f, 1.0f, 10.0f, 128.0f})
        all.push_back(
            {"white", Bsdf::phong(Vec3f(0.6f), energyLimited(Vec3f(0.6f), Vec3f(1), exponent), exponent), false});
    for (const Case& c : all)
        for (const double degrees : {0.0, 30.0, 60.0, 80.0, 88.0})
            EXPECT_LE(albedo(c.bsdf, viewAt(degrees)), 1.003) << c.name << ' ' << degrees;
}

TEST(Bsdf, HighlightAlbedoIsTheIntegral) {
    for (const float exponent : {0.0f, 1.0f, 25.6f, 128.0f}) {
        EXPECT_NEAR(albedo(Bsdf::phong(Vec3f(0), Vec3f(1), exponent), Vec3f(0, 0, 1), 1000), highlightAlbedo(exponent),
                    2e-3);
        EXPECT_EQ(energyLimited(Vec3f(0.2f), Vec3f(1e-3f), exponent), Vec3f(1e-3f)) << "what fits stays";
        EXPECT_EQ(energyLimited(Vec3f(1), Vec3f(0.5f), exponent), Vec3f(0));
    }
}

// The mean weight is the albedo, by samples.
TEST(Bsdf, SamplesCarryTheAlbedo) {
    const std::uint64_t seed = 99;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> unit(0, 0.9999999f);
    for (const Case& c : cases())
        for (const double degrees : {10.0, 70.0}) {
            const Vec3f view = viewAt(degrees);
            double sum = 0, squares = 0;
            const int n = 100'000;
            for (int i = 0; i < n; ++i) {
                const double w = c.bsdf.sample(view, unit(random), unit(random), unit(random)).weight.r;
                sum += w, squares += w * w;
            }
            const double mean = sum / n, error = std::sqrt(std::max(squares / n - mean * mean, 0.0) / n);
            EXPECT_NEAR(mean, albedo(c.bsdf, view), 4.5 * error + 1e-3)
                << c.name << ' ' << degrees << ", seed " << seed;
        }
}

/// The albedo of glTF's model in double, over half vectors as their distribution has them, so that polished ones are as
/// exact as rough ones; the diffuse part over lights.
double physicalAlbedo(double base, double metallic, double roughness, const Vec3d& view) {
    const double alpha = std::max(roughness * roughness, 1e-3), a2 = alpha * alpha,
                 f0 = 0.04 + (base - 0.04) * metallic;
    const auto fresnel = [&](double cosine) {
        const double left = 1 - cosine, squared = left * left;
        return f0 + (1 - f0) * squared * squared * left;
    };
    constexpr int steps = 600;
    std::array<Vec2d, steps> around;
    for (int j = 0; j < steps; ++j) {
        const double phi = 2 * kPiOfBsdf * (j + 0.5) / steps;
        around[static_cast<std::size_t>(j)] = Vec2d(std::cos(phi), std::sin(phi));
    }
    double specular = 0, diffuse = 0;
    for (int i = 0; i < steps; ++i) {
        const double u = (i + 0.5) / steps;
        const double hz = std::sqrt((1 - u) / (1 + (a2 - 1) * u)), hs = std::sqrt(1 - hz * hz);
        for (const Vec2d& direction : around) {
            const Vec3d h(hs * direction.x, hs * direction.y, hz);
            const double vh = glm::dot(view, h);
            if (const Vec3d l = 2 * vh * h - view; vh > 0 && l.z > 0) {
                const double masking =
                    l.z * std::sqrt(view.z * view.z * (1 - a2) + a2) + view.z * std::sqrt(l.z * l.z * (1 - a2) + a2);
                specular += fresnel(vh) * 0.5 / masking * l.z * 4 * vh / hz;
            }
            const Vec3d l(std::sqrt(u) * direction.x, std::sqrt(u) * direction.y, std::sqrt(1 - u));
            diffuse += (1 - fresnel(glm::dot(l, glm::normalize(l + view)))) * (1 - metallic) * base;
        }
    }
    return (specular + diffuse) / (double(steps) * steps);
}

/// The mean weight of samples at the points of a lattice (Roberts 2018: powers of the root of x^4 = x + 1).
double meanWeight(const Bsdf& bsdf, const Vec3f& view) {
    constexpr double kRoot = 1.2207440846057596;
    constexpr int kSamples = 1 << 19;
    const double steps[3] = {1 / kRoot, 1 / (kRoot * kRoot), 1 / (kRoot * kRoot * kRoot)};
    double numbers[3] = {0.5, 0.5, 0.5}, sum = 0;
    for (int i = 0; i < kSamples; ++i) {
        for (int k = 0; k < 3; ++k) {
            numbers[k] += steps[k];
            if (numbers[k] >= 1) numbers[k] -= 1;
        }
        const auto number = [&](int k) { return static_cast<float>(numbers[k] * (1 - 1e-7)); };
        sum += bsdf.sample(view, number(0), number(1), number(2)).weight.r;
    }
    return sum / kSamples;
}

// The furnace: under light from everywhere each shows its albedo, within a thousandth, at every roughness.
TEST(Bsdf, FurnaceOfEveryRoughness) {
    for (const double base : {0.5, 0.9, 0.99})
        for (const double metallic : {0.0, 1.0})
            for (const double roughness : {0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0})
                for (const double degrees : {0.0, 70.0}) {
                    const Vec3f view = viewAt(degrees);
                    const double expected = physicalAlbedo(base, metallic, roughness, Vec3d(view));
                    const Bsdf bsdf = Bsdf::physical(Vec3f(static_cast<float>(base)), static_cast<float>(metallic),
                                                     static_cast<float>(roughness));
                    EXPECT_NEAR(meanWeight(bsdf, view), expected, 1e-3 * expected)
                        << base << ' ' << metallic << ' ' << roughness << ' ' << degrees;
                }
    for (const float rho : {0.5f, 0.9f, 0.99f})
        for (const double degrees : {0.0, 45.0, 75.0})
            EXPECT_NEAR(meanWeight(Bsdf::phong(Vec3f(rho), Vec3f(0), 0), viewAt(degrees)), double{rho}, 1e-5);
    for (const float exponent : {0.0f, 1.0f, 25.6f, 128.0f}) {
        const double e = double{exponent};
        const double closed = 8 / (e + 2) * (1 - std::pow(2, -(e + 2) / 2));
        const Bsdf gloss = Bsdf::phong(Vec3f(0), Vec3f(0.3f), exponent);
        EXPECT_NEAR(meanWeight(gloss, Vec3f(0, 0, 1)), 0.3 * closed, 1e-3 * closed) << exponent;
    }
}

}  // namespace
}  // namespace rtsg::trace
