// Rays that surfaces send on, lane by lane, against the formulas of light in double precision.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "surface/surface_branches.h"

namespace rtsg::trace {
namespace {

Vec3d mirroredAt(const Vec3d& direction, const Vec3d& normal) {
    return direction - 2 * glm::dot(direction, normal) * normal;
}
/// Snell's law by angles; false: all of it is mirrored.
bool bentAt(const Vec3d& direction, const Vec3d& normal, double eta, Vec3d& out) {
    const double cosine = -glm::dot(direction, normal), sine = std::sqrt(1 - cosine * cosine) / eta;
    if (sine >= 1) return false;
    const Vec3d along = glm::normalize(direction + cosine * normal);
    out = sine * along - std::sqrt(1 - sine * sine) * normal;
    return true;
}
/// Fresnel's equations for both polarisations.
double mirroredFraction(double cosine, double eta) {
    const double sine = std::sqrt(1 - cosine * cosine) / eta;
    if (sine >= 1) return 1;
    const double inside = std::sqrt(1 - sine * sine);
    const double s = (cosine - eta * inside) / (cosine + eta * inside),
                 p = (eta * cosine - inside) / (eta * cosine + inside);
    return (s * s + p * p) / 2;
}

class Packet {
  public:
    Packet() {
        materials[0].reflectivity = {.2f, .5f, .7f};
        materials[1].refractiveIndex = 1.5f;
        materials[2].refractiveIndex = 1.3f, materials[2].reflectivity = {.1f, .2f, .3f};
        materials[3].model = ShadingModel::physical, materials[3].reflectivity = {.1f, 0, .4f};
    }
    Vec3f unit() {
        std::normal_distribution<float> n;
        return glm::normalize(Vec3f(n(random), n(random), n(random)));
    }
    float fraction() { return std::uniform_real_distribution<float>(0, 1)(random); }
    void fill(bool one) {
        s.back = s.physical = 0;
        for (int lane = 0; lane < 16; ++lane) {
            const int which = one ? 1 : static_cast<int>(random() % 4);
            s.material[lane] = &materials[which];
            if (which == 3) s.physical |= 1u << lane;
            const Vec3f outside = unit(), view = unit();
            const bool back = glm::dot(outside, view) < 0;
            s.back |= static_cast<std::uint32_t>(back) << lane;
            s.hits.normalX[lane] = outside.x, s.hits.normalY[lane] = outside.y, s.hits.normalZ[lane] = outside.z;
            const Vec3f facing = back ? -outside : outside;
            const Vec3f leaning = glm::normalize(facing + .3f * unit());
            s.normal.set(lane, glm::dot(leaning, view) > .02f ? leaning : facing);
            s.view.set(lane, view);
            const float index = materials[which].refractiveIndex;
            s.eta[lane] = back ? 1 / index : index;
            s.base.set(lane, {fraction(), fraction(), fraction()});
            s.metallic[lane] = fraction(), s.roughness[lane] = fraction(), s.opacity[lane] = fraction();
            s.exact.set(lane, 9.0f * unit()), s.error.set(lane, Vec3f(1e-5f));
        }
    }
    std::mt19937 random{5};
    Material materials[4];
    SurfacePacket s{};
};

void expectWithin(const Vec3f& found, const Vec3d& expected, double margin, const char* what) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[k], expected[k], margin) << what << ' ' << k;
}

void checkDirections(const SurfacePacket& s, const SurfaceBranches& found, int lane) {
    const Material& material = *s.material[lane];
    const bool back = s.back >> lane & 1u;
    const Vec3d direction(-s.view.get(lane)), normal(s.normal.get(lane)),
        facing(back ? -s.outside(lane) : s.outside(lane));
    Vec3d mirrored = mirroredAt(direction, normal);
    if (std::abs(glm::dot(mirrored, facing)) > 1e-5) {
        if (glm::dot(mirrored, facing) < 0) mirrored = mirroredAt(direction, facing);
        expectWithin(found.mirrored.get(lane), mirrored, 1e-6, "mirrored");
    }
    // Starts clear the box of the error, on the side that the ray goes to.
    const Vec3d exact(s.exact.get(lane));
    const double clear = .9e-5 * (std::abs(facing.x) + std::abs(facing.y) + std::abs(facing.z));
    EXPECT_GT(glm::dot(Vec3d(found.before.get(lane)) - exact, facing), clear);
    EXPECT_LT(glm::dot(Vec3d(found.behind.get(lane)) - exact, facing), -clear);
    const bool glass = material.refractiveIndex > 0;
    EXPECT_EQ(found.glass >> lane & 1u, glass);
    if (!glass) return;
    const double index = material.refractiveIndex, eta = back ? 1 / index : index;
    Vec3d bent, other;
    const bool bends = bentAt(direction, normal, eta, bent);
    const double sine = std::sqrt(1 - std::pow(glm::dot(direction, normal), 2)) / eta;
    if (std::abs(sine - 1) < 1e-4) return;  // rounding decides
    EXPECT_EQ(found.refracts >> lane & 1u, bends);
    if (!bends || std::abs(glm::dot(bent, facing)) < 1e-3) return;
    if (glm::dot(bent, facing) > 0) bent = bentAt(direction, facing, eta, other) ? other : direction;
    expectWithin(found.bent.get(lane), bent, 2e-4, "bent");
}

void checkFractions(const SurfacePacket& s, const SurfaceBranches& found, int lane) {
    const Material& material = *s.material[lane];
    const bool back = s.back >> lane & 1u;
    const double cosine = glm::dot(Vec3d(s.normal.get(lane)), Vec3d(s.view.get(lane))), opacity = s.opacity[lane];
    const Vec3d mirror(material.reflectivity), rest = 1.0 - mirror;
    if (material.refractiveIndex > 0) {
        const double index = material.refractiveIndex, fraction = mirroredFraction(cosine, back ? 1 / index : index);
        const double margin = fraction < 1 && fraction > .9 ? 1e-2 : 1e-5;  // steep where it becomes total
        expectWithin(found.mirror.get(lane), mirror + rest * fraction, margin, "mirror of glass");
        for (const Lanes3* left : {&found.body, &found.passing, &found.covering})
            expectWithin(left->get(lane), rest * (1 - fraction), margin, "left by glass");
        expectWithin(found.whole.get(lane), Vec3d(1), 0, "whole");
        return;
    }
    Vec3d gloss(0);
    if (material.model == ShadingModel::physical) {
        const Vec3d f0 = .04 * (1.0 - s.metallic[lane]) + Vec3d(s.base.get(lane)) * double{s.metallic[lane]};
        gloss = (f0 + (1.0 - f0) * std::pow(1 - cosine, 5)) * std::pow(1.0 - s.roughness[lane], 2);
    }
    expectWithin(found.mirror.get(lane), mirror + rest * gloss * opacity, 1e-6, "mirror");
    expectWithin(found.body.get(lane), rest, 1e-6, "body");
    expectWithin(found.passing.get(lane), rest, 1e-6, "passing");
    expectWithin(found.covering.get(lane), rest * (1.0 - gloss), 1e-6, "covering");
    expectWithin(found.whole.get(lane), opacity + (1 - opacity) * mirror, 1e-6, "whole");
}

TEST(SurfaceBranches, AreThoseOfFresnelAndSnell) {
    Packet packet;
    SurfaceBranches found{};
    for (int round = 0; round < 200; ++round) {
        SCOPED_TRACE(round);
        packet.fill(round % 4 == 0);
        const std::uint32_t lanes = round % 2 ? 0xFFFF : static_cast<std::uint32_t>(packet.random() % 0xFFFF + 1);
        found.find(packet.s, lanes);
        for (int lane = 0; lane < 16; ++lane) {
            if (!(lanes >> lane & 1u)) continue;
            checkDirections(packet.s, found, lane);
            checkFractions(packet.s, found, lane);
        }
    }
}

}  // namespace
}  // namespace rtsg::trace
