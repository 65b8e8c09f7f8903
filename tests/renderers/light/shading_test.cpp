// Lighting against the equations of ISO/IEC 19775-1 V4.0, clause 17.
#include <rtsg/renderers/shading.h>

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "mesh/simd8.h"

namespace rtsg {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double radians(double degrees) {
    return degrees * kPi / 180;
}

// Born & Wolf's sine and tangent forms, in double: another road to the same numbers.
void fresnelBySines(double incident, double n, double& s, double& p) {
    const double transmitted = std::asin(std::sin(incident) / n);
    s = std::pow(std::sin(incident - transmitted) / std::sin(incident + transmitted), 2);
    p = std::pow(std::tan(incident - transmitted) / std::tan(incident + transmitted), 2);
}

TEST(Fresnel, KnownValuesForGlass) {
    const auto at = [](double degrees) {
        return fresnelDielectric(static_cast<float>(std::cos(radians(degrees))), 1.5f);
    };
    EXPECT_NEAR(at(0).mean(), 0.04, 1e-6);
    EXPECT_NEAR(at(45).s, 0.092013, 1e-6);
    EXPECT_NEAR(at(45).p, 0.008466, 1e-6);
    EXPECT_NEAR(at(60).mean(), 0.089187, 1e-6);
    EXPECT_NEAR(at(85).mean(), 0.6128, 5e-5);
    EXPECT_NEAR(at(56.309932).p, 0, 1e-9) << "Brewster's angle";
    EXPECT_NEAR(at(90).mean(), 1, 1e-6);
}

TEST(Fresnel, AgreesWithTheSineForms) {
    for (double degrees = 1; degrees < 90; degrees += 1)
        for (const double n : {1.1, 1.333, 1.5, 2.4}) {
            double s, p;
            fresnelBySines(radians(degrees), n, s, p);
            const Reflectance r =
                fresnelDielectric(static_cast<float>(std::cos(radians(degrees))), static_cast<float>(n));
            EXPECT_NEAR(r.s, s, 2e-6) << degrees << ' ' << n;
            EXPECT_NEAR(r.p, p, 2e-6) << degrees << ' ' << n;
        }
}

TEST(Fresnel, ReversedLightMeetsTheSameReflectance) {
    for (double degrees = 1; degrees < 41; degrees += 1) {
        const double outside = std::asin(1.5 * std::sin(radians(degrees)));
        const auto in = fresnelDielectric(static_cast<float>(std::cos(outside)), 1.5f);
        const auto out = fresnelDielectric(static_cast<float>(std::cos(radians(degrees))), 1 / 1.5f);
        EXPECT_NEAR(in.mean(), out.mean(), 1e-4);
    }
}

TEST(Fresnel, TotalReflectionStartsAtTheCriticalAngle) {
    const float inside = 1 / 1.5f;
    EXPECT_LT(fresnelDielectric(static_cast<float>(std::cos(radians(41.80))), inside).mean(), 1);
    EXPECT_EQ(fresnelDielectric(static_cast<float>(std::cos(radians(41.82))), inside).mean(), 1);
    const Vec3f down(static_cast<float>(std::sin(radians(41.82))), -static_cast<float>(std::cos(radians(41.82))), 0);
    EXPECT_FALSE(refractDirection(down, {0, 1, 0}, inside));
}

TEST(Refraction, FollowsSnell) {
    const std::uint64_t seed = 7;
    std::mt19937_64 random(seed);
    std::normal_distribution<float> gauss;
    for (int i = 0; i < 1000; ++i) {
        const Vec3f normal = glm::normalize(Vec3f(gauss(random), gauss(random), gauss(random)));
        Vec3f in = glm::normalize(Vec3f(gauss(random), gauss(random), gauss(random)));
        if (glm::dot(in, normal) > 0) in = -in;
        const float eta = i % 2 ? 1.5f : 1 / 1.5f;
        const auto out = refractDirection(in, normal, eta);
        const double sinIn = glm::length(glm::cross(Vec3d(in), Vec3d(normal)));
        if (!out) {
            EXPECT_GE(sinIn / eta, 0.9999) << "seed " << seed;
            continue;
        }
        const double sinOut = glm::length(glm::cross(Vec3d(*out), Vec3d(normal)));
        EXPECT_NEAR(sinIn, sinOut * eta, 1e-5);
        EXPECT_LE(glm::dot(*out, normal), 1e-6f);
        EXPECT_NEAR(glm::dot(glm::cross(in, normal), *out), 0, 1e-5) << "in the plane of incidence";
    }
}

// A slab of index 1.5, one thick, at 45 degrees: the ray leaves parallel to itself, .329142 aside.
TEST(Refraction, SlabDisplacesTheRay) {
    const Vec3f in(std::sqrt(0.5f), -std::sqrt(0.5f), 0), normal(0, 1, 0);
    const Vec3f within = *refractDirection(in, normal, 1.5f);
    const Vec3f leaves = Vec3f(0) + within * (1 / -within.y);
    const Vec3f out = *refractDirection(within, normal, 1 / 1.5f);
    EXPECT_NEAR(glm::distance(out, in), 0, 1e-6);
    EXPECT_NEAR(glm::length(glm::cross(leaves, in)), 0.329142, 1e-6);
}

// A marginally off-axis ray through a ball of radius 1 crosses the axis n / (2 (n - 1)) from its centre.
TEST(Refraction, BallLensFocuses) {
    const double n = 1.5, h = 1e-3;
    Vec3f at(static_cast<float>(h), 0, static_cast<float>(std::sqrt(1 - h * h)));
    const Vec3f within = *refractDirection({0, 0, -1}, at, static_cast<float>(n));
    const Vec3f exit = at - 2 * glm::dot(at, within) * within;
    const Vec3f out = *refractDirection(within, -exit, static_cast<float>(1 / n));
    const double crossing = double{exit.z} - double{exit.x} * out.z / out.x;
    EXPECT_NEAR(-crossing, 1.5, 2e-3);
}

TEST(Lights, SpotRampIsLinearInTheAngle) {
    EXPECT_EQ(spotFactor(0.1f, 0.2f, 0.6f), 1);
    EXPECT_EQ(spotFactor(0.2f, 0.2f, 0.6f), 1);
    EXPECT_NEAR(spotFactor(0.3f, 0.2f, 0.6f), 0.75, 1e-6);
    EXPECT_NEAR(spotFactor(0.5f, 0.2f, 0.6f), 0.25, 1e-6);
    EXPECT_EQ(spotFactor(0.6f, 0.2f, 0.6f), 0);
    EXPECT_EQ(spotFactor(0.7f, 1.0f, 0.6f), 0) << "beamWidth beyond cutOffAngle";
    EXPECT_EQ(spotFactor(0.5f, 1.0f, 0.6f), 1);
}

TEST(Lights, AttenuationNeverBrightens) {
    EXPECT_FLOAT_EQ(attenuationAt({1, 0, 0}, 50), 1);
    EXPECT_FLOAT_EQ(attenuationAt({0, 0, 1}, 2), 0.25f);
    EXPECT_FLOAT_EQ(attenuationAt({0, 0, 1}, 0.5f), 1);
    EXPECT_FLOAT_EQ(attenuationAt({1, 2, 3}, 2), 1 / 17.0f);
    EXPECT_FLOAT_EQ(attenuationAt({0, 0, 0}, 2), 1);
}

TEST(Lights, Fog) {
    EXPECT_FLOAT_EQ(fogFactor(FogType::linear, 20, 5), 0.75f);
    EXPECT_FLOAT_EQ(fogFactor(FogType::linear, 20, 25), 0);
    EXPECT_NEAR(fogFactor(FogType::exponential, 20, 10), std::exp(-1.0), 1e-6);
    EXPECT_FLOAT_EQ(fogFactor(FogType::exponential, 20, 20), 0);
    EXPECT_FLOAT_EQ(fogFactor(FogType::linear, 0, 5), 1) << "no range, no fog";
    EXPECT_FLOAT_EQ(fogFactor(FogType::none, 20, 5), 1);
}

// The specular lobe of GGX with masking, integrated over the hemisphere of lights, must not exceed what Fresnel gives.
TEST(Physical, WhiteMetalReflectsNoMoreThanAll) {
    for (const float roughness : {0.2f, 0.5f, 1.0f})
        for (const float cosView : {0.2f, 0.7f, 1.0f}) {
            const Vec3d v(std::sqrt(1 - cosView * cosView), 0, cosView);
            double sum = 0;
            const int steps = 400;
            for (int i = 0; i < steps; ++i)
                for (int j = 0; j < steps; ++j) {
                    const double cosLight = (i + 0.5) / steps, phi = 2 * kPi * (j + 0.5) / steps;
                    const double sinLight = std::sqrt(1 - cosLight * cosLight);
                    const Vec3d l(sinLight * std::cos(phi), sinLight * std::sin(phi), cosLight),
                        h = glm::normalize(l + v);
                    sum += metallicRoughness(Vec3f(1), 1, roughness, float(cosLight), cosView, float(h.z),
                                             float(glm::dot(l, h)))
                               .r *
                           cosLight / kPi * (2 * kPi) / (double(steps) * steps);
                }
            EXPECT_LE(sum, 1.01) << roughness << ' ' << cosView;
            EXPECT_GT(sum, roughness > 0.9f ? 0.28 : 0.8) << roughness << ' ' << cosView;
        }
}

TEST(Physical, RoughDielectricIsNearlyLambert) {
    const Vec3f value = metallicRoughness(Vec3f(0.5f), 0, 1, 1, 1, 1, 1);
    EXPECT_NEAR(value.r, 0.5 * 0.96 + 0.04 * 0.25, 1e-6) << "diffuse after Fresnel, and the lobe's 1/4";
}

TEST(Simd, FunctionsAreAccurate) {
    using namespace simd;
    const std::uint64_t seed = 99;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> unit(0, 1);
    for (int i = 0; i < 20000; ++i) {
        F8 x, e;
        for (int k = 0; k < 8; ++k) x[k] = unit(random), e[k] = unit(random) * 128;
        const F8 p = power(x, e), l = log2Of(x), a = acosOf(2 * x - 1.0f), q = exp2Of(-e), r = simd::sqrt(x);
        F8 sine, cosine;
        sinCosRevolutions(x, sine, cosine);
        for (int k = 0; k < 8; ++k) {
            const double exact = std::pow(double{x[k]}, double{e[k]});
            ASSERT_NEAR(p[k], exact, 2e-5 * exact + 1e-7) << x[k] << '^' << e[k] << " seed " << seed;
            ASSERT_NEAR(l[k], std::log2(double{x[k]}), 1e-6 + 3e-7 * std::abs(std::log2(x[k])));
            const float argument = 2 * x[k] - 1;
            ASSERT_NEAR(a[k], std::acos(double{argument}), 1e-6);
            ASSERT_NEAR(q[k], std::exp2(-double{e[k]}), 1e-6 * std::exp2(-double{e[k]}) + 1e-37);
            ASSERT_NEAR(r[k], std::sqrt(double{x[k]}), 1e-7);
            const double angle = 2 * std::numbers::pi * double{x[k]};
            ASSERT_NEAR(sine[k], std::sin(angle), 3e-7) << x[k];
            ASSERT_NEAR(cosine[k], std::cos(angle), 3e-7) << x[k];
        }
    }
    const F8 zero = power(F8{0, 0, 1, 1, 0.5f, 0, 1, 0}, F8{0, 5, 0, 128, 0, 128, 64, 1});
    const float expected[8] = {1, 0, 1, 1, 1, 0, 1, 0};
    for (int k = 0; k < 8; ++k) EXPECT_NEAR(zero[k], expected[k], 1e-6) << k;
}

}  // namespace
}  // namespace rtsg
