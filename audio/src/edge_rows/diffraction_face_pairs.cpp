// Lays the places on either side of a face flat into it, and cuts each edge to what is seen across the other one.
#include "diffraction_face_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "edges/diffraction_ends.h"
#include "edges/diffraction_paths.h"

namespace rtsg {
namespace {

/// Places stay by this share of a part within it, since at a corner of both edges there is no way from one to the
/// other. It is ten roundings of single precision.
constexpr double kOffEnd = 1e-6;

glm::dvec3 farEnd(const WallEdge& edge) {
    return edge.from + edge.axis * edge.length;
}

/// The face of an edge in which another one lies.
bool sharedFace(const WallEdge& a, const WallEdge& b, glm::dvec3& inward) {
    const glm::dvec3 displacement = b.from - a.from;
    const double position = positionRounding(a.from),
                 rounding = 1e-5 * (glm::length(displacement) + b.length) + 2 * position;
    for (const glm::dvec3& face : {a.faceA, a.faceB}) {
        const glm::dvec3 normal = glm::cross(a.axis, face);
        if (std::abs(glm::dot(displacement, normal)) < rounding &&
            std::abs(glm::dot(b.axis, normal)) < 1e-5 + 2 * position / b.length) {
            inward = face;
            return true;
        }
    }
    return false;
}

/// A place turned about an edge into its face's plane, on the side where the face is not.
glm::dvec3 laidFlat(const WallEdge& edge, const glm::dvec3& inward, const glm::dvec3& position) {
    const glm::dvec3 displacement = position - edge.from, foot = edge.axis * glm::dot(displacement, edge.axis);
    return edge.from + foot - inward * glm::length(displacement - foot);
}

}  // namespace

FacePair::Side FacePair::layOne(const WallEdge& edge, const glm::dvec3& inward, const WallEdge& other,
                                const glm::dvec3& otherInward, const glm::dvec3& near, const glm::dvec3& beyond) {
    Side side;
    side.edge = edge;
    side.position = near;
    side.flat = laidFlat(other, otherInward, beyond);
    const glm::dvec3 toNear = near - edge.from, toFlat = side.flat - edge.from;
    side.along = glm::dot(toNear, edge.axis);
    side.radius = glm::length(toNear - edge.axis * side.along);
    side.alongFlat = glm::dot(toFlat, edge.axis);
    side.radiusFlat = glm::dot(toFlat, inward);
    if (!(side.radius > 0 && side.radiusFlat > 0)) return side;
    side.shortest = side.along + (side.alongFlat - side.along) * side.radius / (side.radius + side.radiusFlat);
    // The other edge's ends, seen from there.
    double seen[2];
    for (int i = 0; i < 2; ++i) {
        const glm::dvec3 displacement = (i == 0 ? other.from : farEnd(other)) - edge.from;
        const double off = glm::dot(displacement, edge.axis) - side.alongFlat,
                     left = side.radiusFlat - glm::dot(displacement, inward);
        seen[i] = left > 1e-9 * side.radiusFlat ? side.alongFlat + off * side.radiusFlat / left
                                                : std::copysign(std::numeric_limits<double>::infinity(), off);
    }
    side.low = std::max(0.0, std::min(seen[0], seen[1]));
    side.high = std::min(edge.length, std::max(seen[0], seen[1]));
    if (side.high - side.low < 1e-6 * edge.length) side.high = side.low;
    return side;
}

glm::dvec3 FacePair::crossing(const glm::dvec3& from, const glm::dvec3& flat, const WallEdge& edge) {
    const glm::dvec3 displacement = flat - from, square = displacement - edge.axis * glm::dot(displacement, edge.axis);
    const double part = glm::dot(edge.from - from, square) / glm::dot(square, square);
    const double position = glm::dot(from + displacement * part - edge.from, edge.axis);
    return edge.from + edge.axis * std::clamp(position, 0.0, edge.length);
}

double FacePair::strength(const TwoWedgePath& path) const {
    constexpr double kWaveNumber = 2.3;  // 1 / m, of 125 Hz in air of 343 m/s
    // The share that is there of the zone in which waves are about in phase; less where the way leads past ends.
    double fraction = 0;
    for (const Side& side : sides_) {
        const double toEdge = std::hypot(side.radius, side.shortest - side.along);
        const double fromEdge = std::hypot(side.radiusFlat, side.alongFlat - side.shortest);
        const double zone = std::sqrt(std::numbers::pi / kWaveNumber * toEdge * fromEdge / (toEdge + fromEdge));
        const double past = std::max({0.0, side.low - side.shortest, side.shortest - side.high});
        if (side.any()) fraction = std::max(fraction, std::min(1.0, (side.high - side.low) / zone) / (1 + past / zone));
    }
    return fraction * std::abs(twoWedgeField(path, kWaveNumber)) * path.pathLength;
}

bool FacePair::shareFace(const WallEdge& a, const WallEdge& b) {
    glm::dvec3 inward;
    return sharedFace(a, b, inward) && sharedFace(b, a, inward);
}

bool FacePair::lay(const WallEdge& first, const WallEdge& second, const glm::dvec3& source,
                   const glm::dvec3& listener) {
    glm::dvec3 firstInward, secondInward;
    if (!sharedFace(first, second, firstInward) || !sharedFace(second, first, secondInward)) return false;
    shared = true;
    sides_ = {layOne(first, firstInward, second, secondInward, source, listener),
              layOne(second, secondInward, first, firstInward, listener, source)};
    const std::size_t by = sides_[0].any() ? 0 : 1;
    const Side& side = sides_[by];
    if (!side.any()) return false;
    within = side.shortest >= side.low && side.shortest <= side.high;
    const double off = kOffEnd * (side.high - side.low);
    const double along = std::clamp(side.shortest, side.low + off, side.high - off);
    byFirst = side.edge.from + side.edge.axis * along;
    bySecond = crossing(byFirst, side.flat, by == 0 ? second : first);
    if (by == 1) std::swap(byFirst, bySecond);
    return true;
}

void FacePair::addEnds(const Side& side, const TwoWedgePath& path, double fraction, const EdgeTones& tones,
                       double speedOfSound, std::vector<End>& ends) const {
    if (!side.any() || !(fraction > 1e-6)) return;
    const bool isFirst = &side == &sides_[0];
    const TwoWedgePath::Wedge& wedge = isFirst ? path.first : path.second;
    WedgePath single;
    single.opening = wedge.opening;
    single.sourceAngle = isFirst ? wedge.in : wedge.out;
    single.receiverAngle = isFirst ? wedge.out : wedge.in;
    single.sourceRadius = side.radius;
    single.receiverRadius = side.radiusFlat;
    single.along = side.alongFlat - side.along;
    // The same by the places of `path`, of which it is known what both edges bend.
    WedgePath there = single;
    const double toEdge = glm::distance(side.position, isFirst ? byFirst : bySecond), sine = wedge.sine;
    there.sourceRadius = toEdge * sine;
    there.receiverRadius = (path.pathLength - toEdge) * sine;
    there.along = path.pathLength * std::sqrt(std::max(0.0, 1 - sine * sine));
    std::vector<End> both;
    std::vector<EdgeEnd> beyond;
    for (const double along : {side.low, side.high}) {
        EdgeEnd one;
        const double offset = along - side.shortest;
        one.pathLength = single.pathLengthBy(offset);
        one.fraction = along == side.low ? (offset > 0 ? 1 : -1) : (offset < 0 ? 1 : -1);
        setBeyond(single, speedOfSound, one);
        End end;
        end.pathLength = one.pathLength;
        end.first = side.edge.from + side.edge.axis * along;
        end.second = crossing(end.first, side.flat, sides_[isFirst ? 1 : 0].edge);
        if (!isFirst) std::swap(end.first, end.second);
        both.push_back(end);
        beyond.push_back(one);
    }
    const WedgeBend bend(there);
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double first = tones.mirrors(sides_[0].edge.material, b);
        const double second = tones.mirrors(sides_[1].edge.material, b), own = isFirst ? first : second;
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const auto [direct, mirrored] = bend.at(waveNumber);
            const std::complex<double> alone =
                std::polar(1.0, -waveNumber * path.pathLength) * (direct + own * mirrored);
            if (!(std::norm(alone) > 0)) return;
            const std::complex<double> through = fraction * twoWedgeField(path, waveNumber, first, second) / alone;
            for (std::size_t e = 0; e < 2; ++e)
                both[e].pressure[tone] = through * beyond[e].fraction *
                                         (beyond[e].besideDirect[tone] + own * beyond[e].besideMirrored[tone]);
        });
    }
    ends.insert(ends.end(), both.begin(), both.end());
}

std::vector<FacePair::End> FacePair::endsOf(const TwoWedgePath& path, const EdgeTones& tones,
                                            double speedOfSound) const {
    std::vector<End> ends;
    const double first = nearerToSecond(path);
    addEnds(sides_[0], path, first, tones, speedOfSound, ends);
    addEnds(sides_[1], path, 1 - first, tones, speedOfSound, ends);
    return ends;
}

}  // namespace rtsg
