// Asks the side of a body, or the uniform theory of diffraction by an edge.
#include "bending_link.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "edge_shares.h"
#include "two_shadows.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;

/// How much of what the faces of an edge mirror counts: all in the shadow, nothing where a mirror image ends.
double mirroredShare(const WedgePath& path) {
    if (!isLit(path)) return 1;
    if (isMirrored(path)) return 0;
    const double fromShadow = std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle);
    const double fromImage = imageAngle(path) - std::numbers::pi, sum = fromImage + fromShadow;
    return sum > 0 ? fromImage / sum : 0;
}

}  // namespace

std::optional<LinkWay> BendingLink::way(const glm::dvec3& from, const glm::dvec3& to) const {
    LinkWay way;
    if (edge_) {
        if (!pathRound(*edge_, from, to, way.round)) return {};
        way.lit = isLit(way.round.path);
        way.first = way.last = way.round.by;
        way.along = std::clamp(-way.round.path.from, 0.0, edge_->length);
        way.length = way.round.path.shortestWay();
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

Complex BendingLink::pressure(const LinkWay& way, double waveNumber, double mirrors) const {
    if (way.side) return way.side->pressure(false, waveNumber, 0);
    const WedgeField field = wedgeField(way.round.path, waveNumber);
    return (field.besideDirect + mirrors * mirroredShare(way.round.path) * field.besideMirrored) *
           std::polar(1.0, waveNumber * way.length);
}

double BendingLink::fromBoundary(const LinkWay& way) {
    if (way.side) return way.side->way().fromBoundary();
    const WedgePath& path = way.round.path;
    const double length = path.sourceRadius * path.receiverRadius / way.length;
    const double half = std::sin(0.5 * (std::abs(path.receiverAngle - path.sourceAngle) - std::numbers::pi));
    return length * 2 * half * half;
}

glm::dvec3 BendingLink::outward(const LinkWay& way, const glm::dvec3& along) const {
    if (edge_) {
        const glm::dvec3 across = glm::cross(edge_->axis, along);
        const double size = glm::length(across), towards = -glm::dot(across, edge_->faceA + edge_->faceB);
        return size > 0 ? across * (std::copysign(1.0, towards) / size) : glm::dvec3(0);
    }
    glm::dvec3 out = 0.5 * (way.first + way.last) - body_->center;
    if (!body_->sphere) out -= body_->axis * glm::dot(out, body_->axis);
    const double size = glm::length(out);
    return size > 0 ? out / size : glm::dvec3(0);
}

std::array<bool, 2> BendingLink::past(const LinkWay& way) const {
    if (way.side) return way.side->past();
    return {way.round.path.from > 0, way.round.path.to < 0};
}

double BendingLink::lengthByEnd(const LinkWay& way, std::size_t end) const {
    if (way.side) return way.side->lengthByEnd(end);
    return way.round.path.wayBy(end == 0 ? way.round.path.from : way.round.path.to);
}

Complex BendingLink::byEnd(const LinkWay& way, std::size_t end, double waveNumber) const {
    return (past(way)[end] ? 0.5 : -0.5) * fresnelBeyond(waveNumber * (lengthByEnd(way, end) - way.length));
}

}  // namespace rtsg
