// Asks the side of a body, or the uniform theory of diffraction by one edge or two.
#include "bending_link.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "edges/edge_shares.h"
#include "edges/two_shadows.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;

/// How much of what the faces of an edge mirror counts: all in the shadow, nothing where a mirror image ends, and where
/// it is.
double mirroredShare(const WedgePath& path) {
    if (!isLit(path)) return 1;
    if (isMirrored(path)) return 0;
    const double fromShadow = std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle);
    const double fromImage = imageAngle(path) - std::numbers::pi, sum = fromImage + fromShadow;
    return sum > 0 ? fromImage / sum : 0;
}

/// All where no way leads there.
double mirroredShare(const WallEdge& edge, const glm::dvec3& from, const glm::dvec3& to) {
    RoundEdge round;
    return pathRound(edge, from, to, round) ? mirroredShare(round.path) : 1;
}

/// Whether an edge is one of the face that mirrors at another one.
bool isOfMirror(const WallEdge& other, const WallEdge& edge, const WedgePath& path) {
    const bool first = path.sourceAngle + path.receiverAngle < path.opening;
    const glm::dvec3 way = other.from + other.axis * (0.5 * other.length) - edge.from;
    const glm::dvec3 across = way - edge.axis * glm::dot(way, edge.axis);
    return glm::dot(across, first ? edge.faceA : edge.faceB) > (1 - 1e-6) * glm::length(across);
}

/// Half of the square of the angle, times m.
double fromBoundaryOf(const TwoWedgePath::Wedge& wedge) {
    const double angle = std::max(0.0, std::abs(wedge.out - wedge.in) - std::numbers::pi), half = std::sin(0.5 * angle);
    return wedge.whole * 2 * half * half;
}

}  // namespace

std::optional<LinkWay> BendingLink::wayByBoth(const glm::dvec3& from, const glm::dvec3& to) const {
    LinkWay way;
    PairWay& pair = way.pair.emplace();
    pair.first = &*edge_;
    pair.second = &*second_;
    if (!findWay(from, to, false, pair) || !pair.onFace) return {};
    way.first = pair.byFirst;
    way.last = pair.bySecond;
    way.length = pair.path.way;
    way.over = glm::distance(way.first, way.last);
    const double first = std::sqrt(fromBoundaryOf(pair.path.first)),
                 second = std::sqrt(fromBoundaryOf(pair.path.second));
    way.bySecond = first + second > 0 ? second / (first + second) : 0.5;
    way.mirrored = std::max(mirroredShare(*edge_, from, to), mirroredShare(*second_, from, to));
    return way;
}

std::optional<LinkWay> BendingLink::way(const glm::dvec3& from, const glm::dvec3& to) const {
    if (second_) return wayByBoth(from, to);
    LinkWay way;
    if (edge_) {
        if (!pathRound(*edge_, from, to, way.round)) return {};
        way.lit = isLit(way.round.path);
        way.first = way.last = way.round.by;
        way.length = way.round.path.shortestWay();
        // By a face that ends before the place that would mirror there is no image.
        way.mirrored = mirroredShare(way.round.path);
        for (const WallEdge& other : others_)
            if (way.mirrored < 1 && isOfMirror(other, *edge_, way.round.path))
                way.mirrored = std::max(way.mirrored, mirroredShare(other, from, to));
        return way;
    }
    const PlacedBody placed(*body_, from, to);
    if (placed.within()) return {};
    const bool far = body_->sphere ? backwards_ : (glm::dot(placed.axis(), body_->axis) < 0) != backwards_;
    way.side.emplace(placed, far);
    way.there = way.side->touches();
    way.lit = way.side->lit();
    way.first = way.side->first();
    way.last = way.side->last();
    way.length = way.side->way().length();
    return way;
}

std::array<double, 2> BendingLink::mirrors(const EdgeTones& tones, std::size_t band) const {
    const double first = tones.mirrors(body_ ? body_->material : edge_->material, band);
    return {first, second_ ? tones.mirrors(second_->material, band) : first};
}

Complex BendingLink::pressure(const LinkWay& way, double waveNumber, const std::array<double, 2>& mirrors) const {
    if (way.pair)
        // Half of it comes as from an image in the face.
        return (1 + 0.5 * way.mirrored * (mirrors[0] + mirrors[1])) / (1 + 0.5 * (mirrors[0] + mirrors[1])) *
               twoWedgeField(way.pair->path, waveNumber, mirrors[0], mirrors[1]) *
               std::polar(1.0, waveNumber * way.length);
    if (way.side) return way.side->pressure(false, waveNumber, 0);
    const auto [direct, mirrored] = WedgeBend(way.round.path).at(waveNumber);
    return direct + mirrors[0] * way.mirrored * mirrored;
}

double BendingLink::fromBoundary(const LinkWay& way) {
    if (way.side) return way.side->way().fromBoundary();
    if (way.pair) {
        // As of one edge where both are at one place, or where it is on the boundary of one of them.
        const double sum =
            std::sqrt(fromBoundaryOf(way.pair->path.first)) + std::sqrt(fromBoundaryOf(way.pair->path.second));
        return sum * sum;
    }
    const WedgePath& path = way.round.path;
    const double length = path.sourceRadius * path.receiverRadius / way.length;
    const double half = std::sin(0.5 * (std::abs(path.receiverAngle - path.sourceAngle) - std::numbers::pi));
    return length * 2 * half * half;
}

glm::dvec3 BendingLink::outward(const WallEdge& edge, const glm::dvec3& along) {
    const glm::dvec3 across = glm::cross(edge.axis, along);
    const double size = glm::length(across), towards = -glm::dot(across, edge.faceA + edge.faceB);
    return size > 0 ? across * (std::copysign(1.0, towards) / size) : glm::dvec3(0);
}

glm::dvec3 BendingLink::outward(const LinkWay& way, const glm::dvec3& along) const {
    if (second_) {
        const glm::dvec3 both = glm::mix(outward(*edge_, along), outward(*second_, along), way.bySecond);
        const double size = glm::length(both);
        return size > 0 ? both / size : both;
    }
    if (edge_) return outward(*edge_, along);
    glm::dvec3 out = 0.5 * (way.first + way.last) - body_->center;
    if (!body_->sphere) out -= body_->axis * glm::dot(out, body_->axis);
    const double size = glm::length(out);
    return size > 0 ? out / size : glm::dvec3(0);
}

std::array<bool, 2> BendingLink::past(const LinkWay& way) const {
    if (way.side) return way.side->past();
    if (way.pair) return {!way.pair->flat.within, false};
    return {way.round.path.from > 0, way.round.path.to < 0};
}

double BendingLink::lengthByEnd(const LinkWay& way, std::size_t end) const {
    if (way.side) return way.side->lengthByEnd(end);
    return way.round.path.wayBy(end == 0 ? way.round.path.from : way.round.path.to);
}

Complex BendingLink::byEnd(const LinkWay& way, std::size_t end, double waveNumber) const {
    return (past(way)[end] ? 0.5 : -0.5) * fresnelBeyond(waveNumber * (lengthByEnd(way, end) - way.length));
}

std::vector<BendingLink::PairEnd> BendingLink::pairEnds(const LinkWay& way, const EdgeTones& tones) const {
    std::vector<PairEnd> result;
    if (!way.pair) return result;
    for (const FacePair::End& end : way.pair->flat.endsOf(way.pair->path, tones, tones.speedOfSound())) {
        PairEnd& one = result.emplace_back();
        one.length = end.way;
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones.each(b, [&](std::size_t tone, double k) {
                const Complex whole = pressure(way, k, mirrors(tones, b));
                one.share[tone] = std::norm(whole) > 0 ? end.pressure[tone] / whole : 0;
            });
    }
    return result;
}

}  // namespace rtsg
