// Finds the points on two edges with the shortest way, and unfolds edges that share a face.
#include "diffraction_pair_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rtsg {
namespace {

/// Ways past an end count as far as this share of the edge, at most a metre.
double reachPast(const WallEdge& edge) {
    return std::min(1.0, 0.5 * edge.length);
}

bool isOnePoint(const glm::dvec3& a, const glm::dvec3& b) {
    return glm::distance(a, b) <= 1e-6 * (1 + glm::length(a));
}

void setShared(PairPath& path) {
    const WallEdge* const edges[] = {path.first, path.second};
    for (std::size_t e = 0; e < 2; ++e) {
        const WallEdge &edge = *edges[e], &other = *edges[1 - e];
        const auto shared = [&](const glm::dvec3& end) {
            return isOnePoint(end, other.from) || isOnePoint(end, other.from + other.axis * other.length);
        };
        path.fractionsLow[e] = shared(edge.from);
        path.fractionsHigh[e] = shared(edge.from + edge.axis * edge.length);
    }
}

/// Follows the shortest path from a source over a first edge to a point on a second one.
class PathToPoint {
  public:
    PathToPoint(const glm::dvec3& source, const glm::dvec3& listener, const WallEdge& first, const WallEdge& second)
        : listener_(listener), first_(first), second_(second) {
        along_ = glm::dot(source - first.from, first.axis);
        radius_ = glm::length(source - first.from - first.axis * along_);
    }

    /// How the way's length grows with the place on the second edge, at most 2.
    double growthAt(double y) {
        bySecond = second_.from + second_.axis * y;
        const double along = glm::dot(bySecond - first_.from, first_.axis);
        const double radius = glm::length(bySecond - first_.from - first_.axis * along);
        if (!(radius_ + radius > 0)) return 0;
        x = along_ + (along - along_) * radius_ / (radius_ + radius);
        byFirst = first_.from + first_.axis * x;
        across = glm::distance(byFirst, bySecond);
        out = glm::distance(bySecond, listener_);
        if (!(across > 0 && out > 0)) return 0;
        return glm::dot(bySecond - byFirst, second_.axis) / across + glm::dot(bySecond - listener_, second_.axis) / out;
    }

    glm::dvec3 byFirst{0}, bySecond{0};
    double x = 0, across = 0, out = 0;

  private:
    glm::dvec3 listener_;
    const WallEdge &first_, &second_;
    double along_ = 0, radius_ = 0;
};

/// The places on both edges by which the way is shortest. Its length is convex in both places, so that with the best
/// one on the first edge for each on the second it is so, too, and its growth has one zero, however near the edges come
/// to each other. False if that lies far beyond the edges' ends, or beyond a corner of both.
bool shortest(const glm::dvec3& source, const glm::dvec3& listener, PairPath& path) {
    const WallEdge &a = *path.first, &b = *path.second;
    PathToPoint to(source, listener, a, b);
    setShared(path);
    // A little off the ends: at a corner that both share there is no direction from one to the other.
    constexpr double kOff = 1e-9;  // of the length: a rounding of places in double precision
    double low = path.fractionsLow[1] ? kOff * b.length : -reachPast(b);
    double high = b.length + (path.fractionsHigh[1] ? -kOff * b.length : reachPast(b));
    double atLow = to.growthAt(low), atHigh = to.growthAt(high);
    if (!(atLow < 0 && atHigh > 0)) return false;
    // Regula falsi; an end that stays counts half, as in the Illinois method.
    for (int step = 0, stayed = 0; step < 100 && high - low > 1e-10 * b.length; ++step) {
        const double y = (low * atHigh - high * atLow) / (atHigh - atLow);
        const double growth = to.growthAt(y);
        if (std::abs(growth) < 1e-13) break;
        if (growth < 0) {
            low = y;
            atLow = growth;
            if (stayed == 1) atHigh *= 0.5;
            stayed = 1;
        } else {
            high = y;
            atHigh = growth;
            if (stayed == -1) atLow *= 0.5;
            stayed = -1;
        }
    }
    const double toFirst = glm::distance(source, to.byFirst);
    if (!(toFirst > 0 && to.across > 1e-9 * (toFirst + to.out))) return false;
    if (!(to.x >= (path.fractionsLow[0] ? 0 : -reachPast(a)) &&
          a.length - to.x >= (path.fractionsHigh[0] ? 0 : -reachPast(a))))
        return false;
    path.byFirst = to.byFirst;
    path.bySecond = to.bySecond;
    const glm::dvec3 in = (to.byFirst - source) / toFirst, out = (listener - to.bySecond) / to.out;
    const glm::dvec3 across = (to.bySecond - to.byFirst) / to.across;
    path.path.first.sine = glm::length(glm::cross(in, a.axis));
    path.path.second.sine = glm::length(glm::cross(out, b.axis));
    if (!(path.path.first.sine > 0 && path.path.second.sine > 0)) return false;
    const double between = glm::dot(a.axis, b.axis) - glm::dot(across, a.axis) * glm::dot(across, b.axis);
    setDistances(path.path, toFirst, to.across, to.out, between);
    const auto square = [](double x) { return x * x; };
    const auto squareSine = [&](const glm::dvec3& axis) { return 1 - square(glm::dot(across, axis)); };
    const double xx = square(path.path.first.sine) / toFirst + squareSine(a.axis) / to.across;
    const double yy = square(path.path.second.sine) / to.out + squareSine(b.axis) / to.across;
    const double xy = between / to.across;
    path.bend = {0.5 * std::max(0.0, xx - xy * xy / yy), 0.5 * std::max(0.0, yy - xy * xy / xx)};
    const double y = glm::dot(to.bySecond - b.from, b.axis);
    path.fromLow = {to.x, y};
    path.fromHigh = {a.length - to.x, b.length - y};
    path.past = 0;
    for (std::size_t e = 0; e < 2; ++e)
        path.past += path.bend[e] * square(std::min(0.0, std::min(path.fromLow[e], path.fromHigh[e])));
    return true;
}

/// The share of the wave that edges without ends would bend, without the phase of PairPath::past.
std::complex<double> endsFraction(const PairPath& path, double waveNumber) {
    using Complex = std::complex<double>;
    Complex fraction = std::polar(1.0, waveNumber * path.past);
    for (std::size_t e = 0; e < 2; ++e) {
        Complex one = 1;
        for (const auto& [within, shared] :
             {std::pair(path.fromLow[e], path.fractionsLow[e]), std::pair(path.fromHigh[e], path.fractionsHigh[e])}) {
            const double x = waveNumber * path.bend[e] * within * within;
            if (within >= 0 && x > 60) continue;
            Complex beyond = 0.5 * fresnelBeyond(x) * std::polar(1.0, -x);
            if (within < 0)
                // It fades towards where ways are not looked for any more.
                one *= beyond * (1 + within / reachPast(e == 0 ? *path.first : *path.second));
            else
                // Sound by the end is a later wave of its own; where both can be told apart it is not part of this one.
                one -= beyond * std::exp(-x / 8) * (shared ? 2.0 : 1.0);
        }
        fraction *= one;
    }
    return fraction;
}

/// The same along a common face of both edges, if there is one.
bool shortestOnFace(const glm::dvec3& source, const glm::dvec3& listener, PairPath& path) {
    const bool laid = path.flat.lay(*path.first, *path.second, source, listener);
    path.onFace = path.flat.shared;
    if (!laid) return false;
    path.byFirst = path.flat.byFirst;
    path.bySecond = path.flat.bySecond;
    const double in = glm::distance(source, path.byFirst), out = glm::distance(path.bySecond, listener);
    const double across = glm::distance(path.byFirst, path.bySecond);
    if (!(in > 0 && out > 0 && across > 1e-9 * (in + out))) return false;
    const glm::dvec3 along = (path.bySecond - path.byFirst) / across;
    const WallEdge &a = *path.first, &b = *path.second;
    path.path.first.sine = glm::length(glm::cross(along, a.axis));
    path.path.second.sine = glm::length(glm::cross(along, b.axis));
    if (!(path.path.first.sine > 1e-9 && path.path.second.sine > 1e-9)) return false;
    const double between = glm::dot(a.axis, b.axis) - glm::dot(along, a.axis) * glm::dot(along, b.axis);
    setDistances(path.path, in, across, out, between);
    return std::isfinite(path.path.spreading);
}

bool bends(const glm::dvec3& source, const glm::dvec3& listener, bool heardStraight, PairPath& path) {
    const glm::dvec3 across = path.bySecond - path.byFirst;
    if (!rotationAt(*path.first, source - path.byFirst, across, path.atFirst, path.side) ||
        !rotationAt(*path.second, -across, listener - path.bySecond, path.atSecond, path.side))
        return false;
    path.path.onOneFace = path.atFirst.outOnFace && path.atSecond.inOnFace;
    if (path.onFace && !path.path.onOneFace) return false;
    // Sound that neither hides is bent by both where it goes along a face; not that which is thrown
    // back by more than a right angle.
    constexpr double kBack = -0.5 * std::numbers::pi;
    const bool hidden = path.atFirst.shadow() > 0 || path.atSecond.shadow() > 0;
    if ((heardStraight || !hidden) && !path.path.onOneFace) return false;
    if (path.atFirst.shadow() < kBack || path.atSecond.shadow() < kBack) return false;
    path.path.first.opening = path.atFirst.opening;
    path.path.first.in = path.atFirst.in;
    path.path.first.out = path.atFirst.out;
    path.path.second.opening = path.atSecond.opening;
    path.path.second.in = path.atSecond.in;
    path.path.second.out = path.atSecond.out;
    return true;
}

}  // namespace

bool findPath(const glm::dvec3& source, const glm::dvec3& listener, bool heardStraight, PairPath& path) {
    return (shortestOnFace(source, listener, path) ||
            (!path.onFace && !heardStraight && shortest(source, listener, path))) &&
           bends(source, listener, heardStraight, path) &&
           (!path.onFace || path.flat.strength(path.path) > minOnFace(heardStraight));
}

bool isFreeAlong(const AcousticGeometry& geometry, const PairPath& path) {
    const glm::dvec3 first = offEnds(*path.first, path.byFirst), second = offEnds(*path.second, path.bySecond);
    glm::dvec3 off(0);
    if (path.atFirst.outOnFace)
        off = path.atFirst.offFace(*path.first, true);
    else if (path.atSecond.inOnFace)
        off = path.atSecond.offFace(*path.second, false);
    const glm::dvec3 size = glm::max(glm::abs(first), glm::abs(second));
    off *= std::max(1e-3, 1e-5 * std::max({size.x, size.y, size.z}));
    const glm::dvec3 across = second - first;
    const double length = glm::length(across), rounding = std::min(0.25 * length, 1e-5 * (1 + length));
    AcousticHit hit;
    if (geometry.closest(first + off + across * (rounding / length), across / length, length - 2 * rounding, kNoPlane,
                         hit))
        return false;
    return isOpen(geometry, *path.first, first, path.atFirst.opening, path.atFirst.side) &&
           isOpen(geometry, *path.second, second, path.atSecond.opening, path.atSecond.side);
}

namespace {

/// Between edges of no common face that are near to each other beside a wave less goes through than the product of what
/// both bend, as through a slit. Fitted to boundary elements, of a door that leaves one of 2 cm.
double distanceFraction(const PairPath& path, double waveNumber) {
    const double apart = waveNumber * glm::distance(path.byFirst, path.bySecond);
    return -std::expm1(-apart * apart);
}

}  // namespace

PairField fieldOf(const PairPath& path, const EdgeTones& tones, double speedOfSound) {
    PairField field;
    if (path.onFace) field.ends = path.flat.endsOf(path.path, tones, speedOfSound);
    if (path.onFace && !path.flat.within) return field;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double first = tones.mirrors(path.first->material, b), second = tones.mirrors(path.second->material, b);
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            field.wave[tone] =
                twoWedgeField(path.path, waveNumber, first, second) *
                std::polar(1.0, waveNumber * path.path.pathLength) *
                (path.onFace ? 1.0 : endsFraction(path, waveNumber) * distanceFraction(path, waveNumber));
        });
    }
    return field;
}

}  // namespace rtsg
