// Sizes of bodies beside a wave, and ways straight through those that are small.
#include "diffraction_small_bodies.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/diffraction_parts.h"

namespace rtsg {
namespace {

/// A plate's width counts as so much thickness. Fitted as those below.
constexpr double kPlate = 0.3;
/// Factors of volumes and of sections, fitted to boundary elements; see the header.
constexpr double kVolume = 8, kSection = 1.46;
/// A weight above this counts as 1: .01 dB.
constexpr double kWhole = 0.999;
/// Metres between surfaces that are in one plane. A tolerance of drawing.
constexpr double kContact = 1e-3;

double weight(std::array<double, 3> sides, double fill, double k) {
    std::ranges::sort(sides);
    const double section = fill * std::hypot(sides[0], kPlate * sides[1]) * sides[1], volume = section * sides[2];
    const double fraction = 1 / (1 + kVolume / (k * k * k * volume) + kSection / (k * k * k * k * section * section));
    return fraction > kWhole ? 1 : fraction;
}

/// Its box, `margin` metres wider.
bool holds(const WallBody& body, const glm::dvec3& position, double margin) {
    const glm::dvec3 at = glm::abs(body.boxFromWorld * (position - body.middle));
    for (int i = 0; i < 3; ++i)
        if (!((at[i] - 1) * glm::length(body.half[i]) <= margin)) return false;
    return true;
}

}  // namespace

BodyWeights::BodyWeights(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                         double speedOfSound)
    : geometry_(geometry.unnoted()), source_(source), listener_(listener), speedOfSound_(speedOfSound) {
    one_.fill(1);
}

const BodyWeights::Tones& BodyWeights::of(const WallBody* body) {
    if (!body || !diffractionParts().smallBodies) return one_;
    const auto [known, fresh] = known_.try_emplace(body, one_);
    const auto waveNumber = [&](std::size_t tone) {
        return 2 * std::numbers::pi * edgeToneHz(static_cast<double>(tone)) / speedOfSound_;
    };
    std::array<double, 3> sides{};
    for (std::size_t i = 0; i < 3; ++i) sides[i] = 2 * glm::length(body->half[static_cast<int>(i)]);
    if (!fresh || weight(sides, body->fill, waveNumber(0)) == 1 || holds(*body, source_, 0) ||
        holds(*body, listener_, 0))
        return known->second;
    // A body that stands on something is as large as together with its mirror image there, and one between walls has no
    // ends.
    constexpr double kNear = 0.05, kEndless = 1e6;  // of its size; m
    for (int i = 0; i < 3; ++i) {
        double& side = sides[static_cast<std::size_t>(i)];
        const bool low = touches(*body, i, -1, kContact + kNear * side);
        const bool high = touches(*body, i, 1, kContact + kNear * side);
        side *= low && high ? kEndless : low || high ? 2 : 1;
    }
    for (std::size_t t = 0; t < kEdgeTones; ++t) known->second[t] = weight(sides, body->fill, waveNumber(t));
    return known->second;
}

BodyWeights::Tones BodyWeights::of(const WallBody* first, const WallBody* second) {
    Tones weights = of(first);
    if (second == first) return weights;
    const Tones& other = of(second);
    for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= other[t];
    return weights;
}

/// The smallest one, as bodies are in the boxes of rooms.
const WallBody* BodyWeights::bodyAt(const glm::dvec3& position, double margin) const {
    const auto sizeOf = [](const WallBody& body) { return std::abs(glm::determinant(body.half)); };
    const WallBody* found = nullptr;
    for (const WallBody* body : noted_) {
        if (holds(*body, position, margin) && (!found || sizeOf(*body) < sizeOf(*found))) found = body;
    }
    return found;
}

/// Whether a surface is at a side of a body, no farther off than `reach`, that goes on beside it.
bool BodyWeights::touches(const WallBody& body, int axis, double side, double reach) const {
    constexpr double kBeside = 1.05;  // of half of its size
    const glm::dvec3 out = glm::normalize(body.half[axis] * side), at = body.middle + side * body.half[axis];
    for (const int across : {(axis + 1) % 3, (axis + 2) % 3})
        for (const double to : {-kBeside, kBeside}) {
            AcousticHit hit;
            if (geometry_.closest(at + to * body.half[across] - reach * out, out, 2 * reach, kNoPlane, hit))
                return true;
        }
    return false;
}

/// Whether the side of a body that a place is on is at a wall: of two surfaces in one plane a ray meets one.
bool BodyWeights::isAtWall(const WallBody& body, const glm::dvec3& position) const {
    for (int i = 0; i < 3; ++i) {
        const double at = (body.boxFromWorld * (position - body.middle))[i];
        if ((1 - std::abs(at)) * glm::length(body.half[i]) <= kContact && touches(body, i, at < 0 ? -1 : 1, kContact))
            return true;
    }
    return false;
}

bool BodyWeights::straightOn(const glm::dvec3& a, const glm::dvec3& b, Tones& fraction) {
    constexpr int kMaxSurfaces = 64;  // a bound of work
    fraction = one_;
    const double distance = glm::distance(a, b), margin = 1e-5 * (1 + distance);
    const glm::dvec3 direction = (b - a) / distance;
    std::vector<const WallBody*> passed;
    AcousticHit hit;
    double done = 0;
    for (int surface = 0; done < distance - margin; ++surface, done += hit.distance + margin) {
        if (!geometry_.closest(a + direction * done, direction, distance - margin - done, kNoPlane, hit)) return true;
        const glm::dvec3 position = a + direction * (done + hit.distance);
        const WallBody* const body = bodyAt(position, margin);
        if (!body || surface == kMaxSurfaces) return false;
        // Places beside the walls of a room are not asked about, since no path goes there.
        const Tones& weights = of(body);
        if (!(weights.front() < 1) || isAtWall(*body, position)) return false;
        if (std::ranges::find(passed, body) != passed.end()) continue;
        passed.push_back(body);
        for (std::size_t t = 0; t < kEdgeTones; ++t) fraction[t] *= 1 - weights[t];
    }
    return true;
}

}  // namespace rtsg
