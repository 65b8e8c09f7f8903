// Eight surfaces at a time: the numbers of one at a time, and samples whose weights are what their values say.
#include "texture/bsdf8.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace rtsg::trace {
namespace {

using namespace simd;

/// Eight surfaces, half of them physical, and what each is by itself.
struct Surfaces8 {
    alignas(32) float base[3][8], specular[3][8], exponent[8], metallic[8], roughness[8];
    alignas(32) float view[3][8], light[3][8], choice[8], u[8], v[8];
    std::uint32_t physical;
    Bsdf alone[8];

    /// `which`: bits of those that are physical.
    Surfaces8(std::mt19937_64& random, std::uint32_t which) : physical(which) {
        std::uniform_real_distribution<float> unit(0, std::nextafter(1.0f, 0.0f));
        for (int i = 0; i < 8; ++i) {
            const bool isPhysical = which >> i & 1u;
            for (int c = 0; c < 3; ++c) base[c][i] = unit(random), specular[c][i] = isPhysical ? 0 : unit(random);
            exponent[i] = isPhysical ? 0 : 128 * unit(random);
            metallic[i] = isPhysical ? unit(random) : 0, roughness[i] = isPhysical ? unit(random) : 0;
            choice[i] = unit(random), u[i] = unit(random), v[i] = unit(random);
            set(view, i, std::max(unit(random), 1e-3f), unit(random));
            set(light, i, 2 * unit(random) - 1, unit(random));
            const Vec3f color(base[0][i], base[1][i], base[2][i]);
            alone[i] = isPhysical ? Bsdf::physical(color, metallic[i], roughness[i])
                                  : Bsdf::phong(color, {specular[0][i], specular[1][i], specular[2][i]}, exponent[i]);
        }
    }
    static void set(float (&to)[3][8], int i, float cosine, float rotations) {
        const float sine = std::sqrt(1 - cosine * cosine), phi = 2 * std::numbers::pi_v<float> * rotations;
        to[0][i] = sine * std::cos(phi), to[1][i] = sine * std::sin(phi), to[2][i] = cosine;
    }
    static V8 vectors(const float (&from)[3][8]) { return {load(from[0]), load(from[1]), load(from[2])}; }
    static Vec3f vector(const V8& from, int i) { return {from.x[i], from.y[i], from.z[i]}; }
    Bsdf8 together() const {
        I8 mask;
        for (int i = 0; i < 8; ++i) mask[i] = physical >> i & 1u ? -1 : 0;
        return {mask, vectors(base), vectors(specular), load(exponent), load(metallic), load(roughness), load(view[2])};
    }
};

void expectClose(const Vec3f& a, const Vec3f& b, float relative) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], relative * std::abs(b[c]) + 1e-6f);
}

constexpr std::uint64_t kBsdf8Seed = 20261123;
constexpr std::uint32_t kMixes[] = {0x00, 0xFF, 0x5A};
constexpr int kRounds = 2000;

TEST(Bsdf8, ShowsWhatBsdfShows) {
    std::mt19937_64 random(kBsdf8Seed);
    for (int round = 0; round < kRounds; ++round)
        for (const std::uint32_t mix : kMixes) {
            const Surfaces8 s(random, mix);
            const V8 view = Surfaces8::vectors(s.view), light = Surfaces8::vectors(s.light);
            const auto [value, density] = s.together().evaluate(view, light);
            for (int i = 0; i < 8; ++i) {
                const Vec3f from = Surfaces8::vector(view, i), to = Surfaces8::vector(light, i);
                SCOPED_TRACE(testing::Message() << "seed " << kBsdf8Seed << " round " << round << " lane " << i);
                // A sharp highlight multiplies the roundings of the angle from its middle.
                const float alpha = std::max(s.roughness[i] * s.roughness[i], 1e-3f);
                const float close = 1e-4f + (s.physical >> i & 1u ? 1e-6f / (alpha * alpha) : 0);
                expectClose(Surfaces8::vector(value, i), s.alone[i].value(from, to), close);
                const float likely = to.z > 0 ? s.alone[i].density(from, to) : 0;
                EXPECT_NEAR(density[i], likely, close * likely + 1e-6f);
                if (HasFailure()) return;
            }
        }
}

TEST(Bsdf8, SendsPathsWhereBsdfSendsThem) {
    std::mt19937_64 random(kBsdf8Seed + 1);
    int off = 0;
    for (int round = 0; round < kRounds; ++round)
        for (const std::uint32_t mix : kMixes) {
            const Surfaces8 s(random, mix);
            const V8 view = Surfaces8::vectors(s.view);
            const V8 distance = s.together().sample(view, load(s.choice), load(s.u), load(s.v));
            for (int i = 0; i < 8; ++i) {
                const Vec3f out = Surfaces8::vector(distance, i), from = Surfaces8::vector(view, i);
                const Vec3f expected = s.alone[i].sample(from, s.choice[i], s.u[i], s.v[i]).direction;
                EXPECT_NEAR(glm::length(out), 1, 1e-5);
                // Which lobe it is is decided by a comparison, and near its poles a root takes half of the digits.
                off += glm::length(out - expected) > 2e-3f;
            }
        }
    EXPECT_LE(off, 8 * kRounds * 3 / 10'000) << "seed " << kBsdf8Seed + 1;
}

TEST(Bsdf8, LimitsEnergyAsForOneToTheLastBit) {
    std::mt19937_64 random(kBsdf8Seed + 2);
    std::uniform_real_distribution<float> unit(0, 1.2f);
    int changed = 0;
    for (int round = 0; round < kRounds; ++round) {
        alignas(32) float base[3][8], metallic[8], roughness[8], cosine[8];
        for (int i = 0; i < 8; ++i) {
            for (auto& channel : base) channel[i] = unit(random);
            metallic[i] = round % 2 ? 0 : std::min(unit(random), 1.0f), roughness[i] = unit(random) - .1f;
            cosine[i] = unit(random) - .1f;
        }
        const V8 limited = energyLimited(Surfaces8::vectors(base), load(metallic), load(roughness), load(cosine));
        for (int i = 0; i < 8; ++i) {
            const Vec3f color(base[0][i], base[1][i], base[2][i]);
            const Vec3f alone = energyLimited(color, metallic[i], roughness[i], cosine[i]);
            EXPECT_EQ(Surfaces8::vector(limited, i), alone) << "seed " << kBsdf8Seed + 2 << " round " << round;
            changed += alone != glm::min(color, Vec3f(1));
        }
    }
    EXPECT_GT(changed, kRounds) << "some are limited";
}

TEST(Bsdf8, KnowsWhoSendsNothing) {
    const F8 half = all(.5f);
    const I8 some{-1, -1, -1, -1, 0, 0, 0, 0};
    const F8 metallic = select(some, all(1), all(0));
    const V8 black{all(0), all(0), all(0)}, grey{half, half, half};
    EXPECT_EQ(laneBits(Bsdf8(some, black, black, half, metallic, half, all(1)).sends()), 0u);
    EXPECT_EQ(laneBits(Bsdf8(some, black, grey, half, all(0), half, all(1)).sends()), 0xFFu);
    EXPECT_EQ(laneBits(Bsdf8(some, grey, black, half, metallic, half, all(1)).sends()), 0xFFu);
}

}  // namespace
}  // namespace rtsg::trace
