// Sizes of bodies beside a wave, and what touches them.
#include "body_weights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace rtsg {
namespace {

/// A plate's width counts as so much thickness.
constexpr double kPlate = 0.3;
/// Of volumes and of sections, see above.
constexpr double kVolume = 8, kSection = 1.46;
/// More than this is all.
constexpr double kWhole = 0.999;
/// The size of what has no end, metres.
constexpr double kEndless = 1e6;

bool isIn(const WallBody& body, const glm::dvec3& place, double margin) {
    for (int i = 0; i < 3; ++i)
        if (!(std::abs(glm::dot(place - body.center, body.axes[i])) <= 0.5 * body.size[i] + margin)) return false;
    return true;
}

}  // namespace

BodyWeights::BodyWeights(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                         double speedOfSound)
    : geometry_(geometry.unnoted()), source_(source), listener_(listener), speedOfSound_(speedOfSound) {
    one_.fill(1);
}

const BodyWeights::Tones& BodyWeights::of(const WallBody* body) {
    if (!body) return one_;
    const auto [known, fresh] = known_.try_emplace(body, one_);
    if (fresh) known->second = tonesOf(*body);
    return known->second;
}

BodyWeights::Tones BodyWeights::of(const WallBody* first, const WallBody* second) {
    Tones weights = of(first);
    if (second == first) return weights;
    const Tones& other = of(second);
    for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= other[t];
    return weights;
}

double BodyWeights::weight(const glm::dvec3& size, double fill, double waveNumber) const {
    std::array<double, 3> sides{size.x, size.y, size.z};
    std::ranges::sort(sides);
    const double section = fill * std::hypot(sides[0], kPlate * sides[1]) * sides[1];
    const double k = waveNumber, volume = section * sides[2];
    return 1 / (1 + kVolume / (k * k * k * volume) + kSection / (k * k * k * k * section * section));
}

BodyWeights::Tones BodyWeights::tonesOf(const WallBody& body) const {
    const auto waveNumber = [&](std::size_t tone) {
        return 2 * std::numbers::pi * edgeToneHz(static_cast<double>(tone)) / speedOfSound_;
    };
    const double fill = body.volume / (body.size.x * body.size.y * body.size.z);
    if (weight(body.size, fill, waveNumber(0)) > kWhole || isIn(body, source_, 0) || isIn(body, listener_, 0))
        return one_;
    const glm::dvec3 size = sizeWith(body);
    Tones weights;
    for (std::size_t t = 0; t < kEdgeTones; ++t) {
        weights[t] = weight(size, fill, waveNumber(t));
        if (weights[t] > kWhole) weights[t] = 1;
    }
    return weights;
}

glm::dvec3 BodyWeights::sizeWith(const WallBody& body) const {
    glm::dvec3 size = body.size;
    for (int i = 0; i < 3; ++i) {
        const bool low = touches(body, i, -1), high = touches(body, i, 1);
        size[i] *= low && high ? kEndless : low || high ? 2 : 1;
    }
    return size;
}

/// Whether a surface is there that goes on beyond the body: just beside the middles of a side's longer edges.
bool BodyWeights::touches(const WallBody& body, int axis, double side) const {
    constexpr double kBeside = 1.05, kNear = 0.05;
    const double reach = 1e-3 + kNear * body.size[axis];
    const glm::dvec3 out = side * body.axes[axis];
    int across = (axis + 1) % 3;
    if (body.size[(axis + 2) % 3] < body.size[across]) across = (axis + 2) % 3;
    return std::ranges::any_of(std::array{-1.0, 1.0}, [&](double to) {
        const glm::dvec3 at = body.center + 0.5 * body.size[axis] * out +
                              to * (0.5 * kBeside * body.size[across] + 1e-3) * body.axes[across];
        AcousticHit hit;
        return geometry_.closest(at - reach * out, out, 2 * reach, kNoPlane, hit);
    });
}

const WallBody* BodyWeights::bodyAt(const glm::dvec3& place, double margin) const {
    for (const Noted& one : noted_) {
        const glm::dvec3 off = place - one.center;
        if (glm::dot(off, off) <= 1.01 * one.squared + margin && isIn(*one.body, place, margin)) return one.body;
    }
    return nullptr;
}

bool BodyWeights::straightOn(const glm::dvec3& a, const glm::dvec3& b, Tones& share) {
    share = one_;
    const double distance = glm::distance(a, b), margin = 1e-5 * (1 + distance);
    if (!(distance > 2 * margin)) return true;
    const glm::dvec3 direction = (b - a) / distance;
    std::vector<const WallBody*> passed;
    glm::dvec3 from = a;
    double left = distance - margin;
    std::uint32_t plane = kNoPlane;
    AcousticHit hit;
    while (geometry_.closest(from, direction, left, plane, hit)) {
        from += direction * hit.distance;
        left -= hit.distance;
        plane = hit.plane;
        const WallBody* const met = bodyAt(from, margin);
        if (!met) return false;
        if (std::ranges::find(passed, met) != passed.end()) continue;
        const Tones& weights = of(met);
        if (!(weights.front() < 1)) return false;
        passed.push_back(met);
        for (std::size_t t = 0; t < kEdgeTones; ++t) share[t] *= 1 - weights[t];
    }
    return true;
}

}  // namespace rtsg
