// Sizes of bodies beside a wave, and what touches them.
#include "diffraction_small_bodies.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "geometry/diffraction_parts.h"

namespace rtsg {
namespace {

/// A plate's width counts as so much thickness. Fitted as those below.
constexpr double kPlate = 0.3;
/// Of volumes and of sections: fitted to boundary elements, see the header.
constexpr double kVolume = 8, kSection = 1.46;
/// More than this is all: .01 dB.
constexpr double kWhole = 0.999;
/// The size of what has no end, metres: any that waves of 31 Hz are small to.
constexpr double kEndless = 1e6;
/// Of its size, from a surface: it is at it. A tolerance of drawing, as of a chair above its floor.
constexpr double kNear = 0.05;
/// Metres between surfaces that are in one plane. A tolerance of drawing.
constexpr double kContact = 1e-3;

/// In the box around it.
bool isIn(const WallBody& body, const glm::dvec3& place, double margin) {
    const glm::dvec3 at = body.boxFromWorld * (place - body.middle);
    const glm::dmat3 rows = glm::transpose(body.boxFromWorld);
    for (int i = 0; i < 3; ++i)
        if (!(std::abs(at[i]) <= 1 + margin * glm::length(rows[i]))) return false;
    return true;
}

bool fillsItsBox(const WallBody& body) {
    return body.volume * std::abs(glm::determinant(body.boxFromWorld)) > 8 * (1 - 1e-3);
}

/// The surfaces of bodies on a straight way, place by place: so that what is in the box around a body is told from it.
class WayThrough {
  public:
    WayThrough(const glm::dvec3& from, const glm::dvec3& to, double margin) : from_(from), to_(to), margin_(margin) {}

    /// Whether this surface has been met at this place: along an edge two are met in turn for ever.
    bool meetsAgain(const AcousticHit& hit) {
        if (hit.distance > margin_) here_.clear();
        return std::ranges::find(here_, hit.plane, &AcousticHit::plane) != here_.end();
    }
    void add(const AcousticHit& hit, const WallBody& body) {
        auto known = std::ranges::find(passed_, &body, &Passed::body);
        if (known == passed_.end())
            known = passed_.insert(
                known, {&body, 0, fillsItsBox(body) || isIn(body, from_, margin_) || isIn(body, to_, margin_)});
        first_ = known->surfaces == 0;
        // At an edge the way may go in, out, or beside the body.
        if (!here_.empty()) known->mayEndIn = true;
        ++known->surfaces;
        here_.push_back(hit);
    }
    /// Whether what was added last is the first of its body.
    bool isFirst() const { return first_; }
    /// Whether it has left each body that it went into: else what it met last was something else's.
    bool ends() const {
        return std::ranges::all_of(passed_, [](const Passed& one) { return one.mayEndIn || one.surfaces % 2 == 0; });
    }

  private:
    struct Passed {
        const WallBody* body;
        int surfaces;
        bool mayEndIn;
    };
    glm::dvec3 from_, to_;
    double margin_;
    bool first_ = false;
    std::vector<AcousticHit> here_;  // at the place of the last one
    std::vector<Passed> passed_;
};

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
    const auto has = [&](const glm::dvec3& place) {
        return isIn(body, place, 0) || isIn(body, geometry_.onceMore(place), 0);
    };
    if (!diffractionParts().smallBodies || weight(body.size, fill, waveNumber(0)) > kWhole || has(source_) ||
        has(listener_))
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
        const double near = 1e-3 + kNear * body.size[i];
        const bool low = touches(body, i, -1, near), high = touches(body, i, 1, near);
        size[i] *= low && high ? kEndless : low || high ? 2 : 1;
    }
    return size;
}

/// Whether a surface is there, no farther than `reach`, that goes on beyond the body: just beside the middles of a
/// side's longer edges.
bool BodyWeights::touches(const WallBody& body, int axis, double side, double reach) const {
    constexpr double kBeside = 1.05;  // of half of its size: beyond what counts as at it
    const glm::dvec3 out = side * body.axes[axis];
    int across = (axis + 1) % 3;
    if (body.size[(axis + 2) % 3] < body.size[across]) across = (axis + 2) % 3;
    return std::ranges::any_of(std::array{-1.0, 1.0}, [&](double to) {
        const glm::dvec3 at = body.center + 0.5 * body.size[axis] * out +
                              to * (0.5 * kBeside * body.size[across] + 1e-3) * body.axes[across];
        AcousticHit hit;
        return geometry_.closestAsBuilt(body.center, at - reach * out, out, 2 * reach, hit);
    });
}

/// The smallest one, as bodies are in the boxes of rooms.
const WallBody* BodyWeights::bodyAt(const glm::dvec3& place, double margin) const {
    const WallBody* found = nullptr;
    for (const Noted& one : noted_) {
        if (found && !(one.body->volume < found->volume)) continue;
        const glm::dvec3 off = place - one.middle;
        if (glm::dot(off, off) <= 1.01 * one.squared + margin && isIn(*one.body, place, margin)) found = one.body;
    }
    return found;
}

/// Whether the side of a body that a place is on is at a wall: of two surfaces in one plane a ray meets one.
bool BodyWeights::isAtWall(const WallBody& body, const glm::dvec3& place, double margin) const {
    for (int i = 0; i < 3; ++i) {
        const double along = glm::dot(place - body.center, body.axes[i]);
        if (std::abs(along) >= 0.5 * body.size[i] - margin && touches(body, i, along < 0 ? -1 : 1, kContact))
            return true;
    }
    return false;
}

bool BodyWeights::straightOn(const glm::dvec3& a, const glm::dvec3& b, Tones& share) {
    share = one_;
    const double distance = glm::distance(a, b), margin = 1e-5 * (1 + distance);
    if (!(distance > 2 * margin)) return true;
    WayThrough way(a, b, margin);
    const glm::dvec3 direction = (b - a) / distance;
    glm::dvec3 from = a;
    double left = distance - margin;
    std::uint32_t plane = kNoPlane;
    AcousticHit hit;
    while (left > 0 && geometry_.closest(from, direction, left, plane, hit)) {
        const double step = way.meetsAgain(hit) ? hit.distance + margin : hit.distance;
        from += direction * step;
        left -= step;
        plane = hit.plane;
        if (step > hit.distance) continue;
        const WallBody* const met = bodyAt(from, margin);
        if (!met || isAtWall(*met, from, margin)) return false;
        way.add(hit, *met);
        if (!way.isFirst()) continue;
        const Tones& weights = of(met);
        if (!(weights.front() < 1)) return false;
        for (std::size_t t = 0; t < kEdgeTones; ++t) share[t] *= 1 - weights[t];
    }
    return way.ends();
}

}  // namespace rtsg
