// Rays that pass the facets of round bodies.
#include "diffraction_round_air.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "edges/diffraction_paths.h"

namespace rtsg {
namespace {

constexpr double kAirPi = std::numbers::pi;
/// The most bodies that count, those nearest to the straight way: a bound of work.
constexpr std::size_t kMaxBodies = 16;
/// The distance of rays from the surface, as a share of the radius: more than the facets' distance from the circle
/// (round_shapes.cpp).
constexpr double kOutside = 1e-2, kLifted = 1e-3;

bool isSameBody(const RoundBody& a, const RoundBody& b) {
    constexpr double kSame = 1e-4;  // of the radius: corners in single precision are off by less
    return a.sphere == b.sphere && glm::distance(a.center, b.center) < kSame * a.radius &&
           std::abs(a.radius - b.radius) < kSame * a.radius &&
           (a.sphere ||
            (std::abs(glm::dot(a.axis, b.axis)) > 1 - kSame * kSame &&
             std::abs(a.halfLength - b.halfLength) < kSame * a.radius && std::abs(a.halfArc - b.halfArc) < kSame &&
             (a.halfArc >= kAirPi || glm::distance(a.middle, b.middle) < kSame)));
}

}  // namespace

RoundAir::RoundAir(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener)
    : geometry_(geometry) {
    std::vector<std::pair<double, PlacedBody>> sorted;
    geometry.visitRoundBodies([&](const RoundBody& body) {
        const PlacedBody placed(body, source, listener);
        if (placed.within()) return;
        const double detour = placed.detour();
        if (sorted.size() == kMaxBodies && !(detour < sorted.back().first)) return;
        if (sorted.size() == kMaxBodies) sorted.pop_back();
        sorted.emplace(std::ranges::upper_bound(sorted, detour, {}, [](const auto& one) { return one.first; }), detour,
                       placed);
    });
    // A body that is there twice is next to itself.
    for (const auto& [detour, placed] : sorted)
        if (bodies_.empty() || !isSameBody(placed.body(), bodies_.back().body())) bodies_.push_back(placed);
}

bool RoundAir::isOnBody(const glm::dvec3& position) const {
    for (const PlacedBody& one : bodies_) {
        const RoundBody& body = one.body();
        glm::dvec3 displacement = position - body.center;
        if (!body.sphere) {
            const double along = glm::dot(displacement, body.axis);
            if (std::abs(along) > body.halfLength + 1e-5) continue;
            displacement -= body.axis * along;
        }
        const double radius = glm::length(displacement), rounding = 1e-3 * body.radius + 1e-5;
        if (radius < body.radius + rounding && radius > body.radius - one.depth() - rounding && one.has(position))
            return true;
    }
    return false;
}

bool RoundAir::isClear(const glm::dvec3& from, const glm::dvec3& to) const {
    constexpr int kMaxFacets = 16;  // two of each body that counts would be twice as many: a bound of work
    const double distance = glm::distance(from, to), rounding = seenRounding(distance, to);
    if (!(distance > rounding)) return true;
    const glm::dvec3 displacement = (to - from) / distance;
    double done = 0;
    std::uint32_t except = kNoPlane;
    for (int i = 0; i < kMaxFacets; ++i) {
        AcousticHit hit;
        const double left = distance - rounding - done;
        if (!(left > 0) || !geometry_.closest(from + displacement * done, displacement, left, except, hit)) return true;
        if (!isOnBody(from + displacement * (done + hit.distance))) return false;
        done += hit.distance;
        except = hit.plane;
        if (except == kNoPlane) done += 1e-6 * (1 + distance);
    }
    return false;
}

bool RoundAir::isFreeAlong(const RoundSide& side, double offset) const {
    constexpr double kStep = kAirPi / 12;  // so a corner is off the surface by a hundredth of the radius
    const Detour& path = side.path();
    const double first = path.firstAngle(), last = path.lastAngle();
    const double from = path.firstAlong() + offset, to = path.lastAlong() + offset;
    const int steps = static_cast<int>(std::ceil((last - first) / kStep));
    if (steps == 0) return true;
    const PlacedBody& placed = side.placed();
    const glm::dvec3 begin = placed.at(first, side.far(), from, 1 + kOutside),
                     end = placed.at(last, side.far(), to, 1 + kOutside);
    // By the corners of a polygon round the body.
    const double each = (last - first) / steps, out = (1 + kOutside) / std::cos(0.5 * each);
    glm::dvec3 at = begin;
    for (int i = 0; i <= steps; ++i) {
        const double part = std::min(1.0, (i + 0.5) / steps);
        const glm::dvec3 next =
            i == steps ? end : placed.at(first + (last - first) * part, side.far(), from + (to - from) * part, out);
        const double length = glm::distance(at, next);
        AcousticHit hit;
        if (length > 0 && geometry_.closest(at, (next - at) / length, length, kNoPlane, hit)) return false;
        at = next;
    }
    return true;
}

bool RoundAir::isFree(const RoundSide& side, const glm::dvec3& from, const glm::dvec3& to, double offset) const {
    // From slightly off the surface, where a face may continue.
    const Detour& path = side.path();
    const PlacedBody& placed = side.placed();
    const glm::dvec3 first = placed.at(path.firstAngle(), side.far(), path.firstAlong() + offset, 1 + kLifted),
                     last = placed.at(path.lastAngle(), side.far(), path.lastAlong() + offset, 1 + kLifted);
    return isClear(from, first) && isClear(last, to) && isFreeAlong(side, offset);
}

bool RoundAir::isEnd(const RoundSide& side, std::size_t end) const {
    const PlacedBody& placed = side.placed();
    const double reach = std::min(0.05, 0.2 * placed.body().halfLength), outward = end == 0 ? -1 : 1;
    const double angle = 0.5 * (side.path().firstAngle() + side.path().lastAngle());
    const glm::dvec3 from = placed.at(angle, side.far(), placed.ends()[end] - outward * reach, 1.002);
    AcousticHit hit;
    return !geometry_.closest(from, outward * placed.axis(), 2 * reach, kNoPlane, hit);
}

}  // namespace rtsg
