// Sums the sound by one side: waves along the surface, the series of a sphere, and rods that hide nothing.
#include "diffraction_round_side.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "edges/diffraction_wedge.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kSidePi = std::numbers::pi;

}  // namespace

RoundSide::RoundSide(const PlacedBody& placed, bool far)
    : placed_(placed),
      far_(far),
      detour_(placed.pathBy(far)),
      first_(placed.at(detour_.firstAngle(), far, detour_.firstAlong())),
      last_(placed.at(detour_.lastAngle(), far, detour_.lastAlong())) {}

glm::dvec3 RoundSide::arriving(const glm::dvec3& last, const glm::dvec3& listener) const {
    constexpr double kBack = 0.01;  // radians: any small angle gives the direction
    const bool touches = glm::distance(last, listener) < 0.05 * placed_.body().radius;
    return glm::normalize(touches ? placed_.at(detour_.lastAngle() - kBack, far_, 0) -
                                        placed_.at(detour_.lastAngle(), far_, 0)
                                  : last - listener);
}

std::array<bool, 2> RoundSide::past() const {
    const std::array<double, 2> ends = placed_.ends();
    const bool endless = placed_.body().sphere;
    return {!endless && detour_.middleAlong() < ends[0], !endless && detour_.middleAlong() > ends[1]};
}

bool RoundSide::hides() const {
    const std::array<bool, 2> beyond = past();
    return !lit() && !beyond[0] && !beyond[1] && touches();
}

Complex RoundSide::pressure(bool beside, double k, double mirrors) const {
    const RoundPath& path = placed_.path();
    const double distance = path.distance();
    const Complex direct = std::polar(1 / distance, -k * (distance - detour_.length()));
    // If the paths by both sides of a sphere are nearly equal, they are no separate waves, but the series is short.
    // Between these numbers one formula fades into the other; the numbers are a choice.
    constexpr double kSeries = 2.5, kSides = 4;
    const double apart = k * path.radius * (kSidePi - path.angle);
    const double bySeries = path.sphere ? std::clamp((kSides - apart) / (kSides - kSeries), 0.0, 1.0) : 0.0;
    // Round a rod that is thin beside a wave sound goes as if it were not there.
    const double size = std::pow(k * path.radius / 0.15, 4), bends = path.sphere ? 1 : size / (1 + size);
    Complex sum = bySeries < 1 ? (1 - bySeries) * bends * detour_.pressure(k, mirrors) : 0;
    if (far_) return sum;
    if (bySeries > 0)
        sum += bySeries * (1 - (1 - mirrors) * detour_.light(k)) * rigidSphereField(path, k) *
               std::polar(1.0, k * detour_.length());
    const double straight = lit() ? 0 : bySeries + 1 - bends;
    return sum + (beside && !lit() ? straight - 1 : straight) * direct;
}

double RoundSide::lengthByEnd(std::size_t end) const {
    return detour_.lengthBy(placed_.ends()[end] - detour_.middleAlong());
}

Complex RoundSide::byEnd(std::size_t end, double waveNumber) const {
    return (past()[end] ? 0.5 : -0.5) * fresnelBeyond(waveNumber * (lengthByEnd(end) - detour_.length()));
}

}  // namespace rtsg
