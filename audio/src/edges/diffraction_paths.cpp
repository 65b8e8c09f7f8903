// Finds the point on an edge with the shortest way, and checks what is visible around it.
#include "diffraction_paths.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtsg {
namespace {

/// The angle of a place about an edge, from its first face on, 0 to 2 pi.
double angleAbout(const WallEdge& edge, const glm::dvec3& across) {
    const double angle = std::atan2(glm::dot(glm::cross(edge.faceA, across), edge.axis), glm::dot(edge.faceA, across));
    return angle < 0 ? angle + 2 * std::numbers::pi : angle;
}

/// Metres; less than any place is off a sheet.
constexpr double kInSheet = 1e-30;

/// The radius of the circle about an edge on which air is looked for.
double openRadius(const glm::dvec3& by) {
    const glm::dvec3 size = glm::abs(by);
    return std::max(1e-3, 1e-5 * std::max({size.x, size.y, size.z}));
}

}  // namespace

bool isRim(const WallEdge& edge) {
    return glm::dot(edge.faceA, edge.faceB) > 1 - 1e-9;
}

glm::dvec3 sheetNormal(const WallEdge& rim) {
    // Few sheets lie along this.
    const glm::dvec3 side(0.4812, 0.7134, 0.5093), normal = glm::cross(rim.axis, rim.faceA);
    return glm::dot(normal, side) < 0 ? -normal : normal;
}

double aboveSheet(const WallEdge& rim, const glm::dvec3& position) {
    const double above = glm::dot(position - rim.from, sheetNormal(rim));
    const double rounding = 1e-12 + 2 * positionRounding(rim.from);
    return std::abs(above) > rounding ? above : kInSheet;
}

glm::dvec3 offSheet(const WallEdge& rim, const glm::dvec3& position) {
    constexpr double kMin = 5e-5;  // radians: five times what counts as on a boundary
    const double along = std::clamp(glm::dot(position - rim.from, rim.axis), 0.0, rim.length);
    const double above = aboveSheet(rim, position),
                 minimum = kMin * glm::distance(position, rim.from + rim.axis * along);
    if (std::abs(above) >= minimum) return position;
    return position + sheetNormal(rim) * (std::copysign(minimum, above) - above);
}

double positionRounding(const glm::dvec3& position) {
    const glm::dvec3 size = glm::abs(position);
    return 2.5e-7 * std::max({size.x, size.y, size.z});
}

BesideEdge::BesideEdge(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener)
    : acrossS(source - edge.from), acrossR(listener - edge.from) {
    zs = glm::dot(acrossS, edge.axis);
    zr = glm::dot(acrossR, edge.axis);
    acrossS -= edge.axis * zs;
    acrossR -= edge.axis * zr;
    s = glm::length(acrossS);
    r = glm::length(acrossR);
    z = s + r > 0 ? zs + (zr - zs) * s / (s + r) : zs;
}

bool pathRound(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener, RoundEdge& round) {
    return pathRound(edge, source, listener, BesideEdge(edge, source, listener), round);
}

bool pathRound(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener, const BesideEdge& beside,
               RoundEdge& round) {
    if (!(beside.s > 0) || !(beside.r > 0)) return false;
    WedgePath& path = round.path;
    path.sourceRadius = beside.s;
    path.receiverRadius = beside.r;
    path.along = beside.zr - beside.zs;
    path.from = -beside.z;
    path.to = edge.length - beside.z;
    round.by = edge.from + edge.axis * std::clamp(beside.z, 0.0, edge.length);
    const double between = isRim(edge) ? 2 * std::numbers::pi : angleAbout(edge, edge.faceB);
    const auto about = [&](const glm::dvec3& position, const glm::dvec3& across) {
        const double angle = angleAbout(edge, across);
        if (!isRim(edge) || std::abs(aboveSheet(edge, position)) > kInSheet) return angle;
        // In its plane, a nanometre off it on the side that is the same for all rims.
        const double off = 1e-9 / glm::length(across);
        const bool first = glm::dot(sheetNormal(edge), glm::cross(edge.axis, edge.faceA)) > 0;
        const double above = glm::dot(across, edge.faceA) > 0 ? off : std::numbers::pi - off;
        return first ? above : 2 * std::numbers::pi - above;
    };
    double s = about(source, beside.acrossS), r = about(listener, beside.acrossR);
    path.opening = between;
    if (s > between && r > between) {
        // The air on the other side of the first face.
        path.opening = 2 * std::numbers::pi - between;
        round.side = -1;
        s = 2 * std::numbers::pi - s;
        r = 2 * std::numbers::pi - r;
    } else if (s > between || r > between) {
        return false;
    }
    path.sourceAngle = s;
    path.receiverAngle = r;
    return path.opening > std::numbers::pi + 0.05;
}

double EdgeSide::shadow() const {
    return std::abs(out - in) - std::numbers::pi;
}

glm::dvec3 EdgeSide::offFace(const WallEdge& edge, bool along) const {
    const glm::dvec3 beside = glm::cross(edge.axis, edge.faceA) * side;
    const bool first = (along ? out : in) == 0;
    return first ? beside : std::sin(opening) * edge.faceA - std::cos(opening) * beside;
}

bool rotationAt(const WallEdge& edge, const glm::dvec3& back, const glm::dvec3& on, EdgeSide& result,
                const glm::dvec3& side) {
    const double rounding = positionRounding(edge.from);
    const bool rim = isRim(edge);
    const double between = rim ? 2 * std::numbers::pi : angleAbout(edge, edge.faceB);
    const auto about = [&](const glm::dvec3& displacement, bool& face) {
        const glm::dvec3 across = displacement - edge.axis * glm::dot(displacement, edge.axis);
        const double angle = angleAbout(edge, across), onFace = std::min(0.01, 1e-5 + rounding / glm::length(across));
        const bool first = angle < onFace || angle > 2 * std::numbers::pi - onFace;
        face = first || std::abs(angle - between) < onFace;
        return first ? 0 : face ? between : angle;
    };
    double in = about(back, result.inOnFace), out = about(on, result.outOnFace);
    const bool onFaces = result.inOnFace && result.outOnFace;
    if ((result.inOnFace || result.outOnFace) && rim) {
        const double above = glm::dot(side, glm::cross(edge.axis, edge.faceA));
        if (onFaces || above == 0) return false;
        (result.inOnFace ? in : out) = above > 0 ? 0 : 2 * std::numbers::pi;
    }
    // From face to face, or back along one, it bends in the air of more than half a turn, if at all.
    const bool other = onFaces ? between < std::numbers::pi : !result.inOnFace ? in > between : out > between;
    result.side = other ? -1 : 1;
    result.opening = other ? 2 * std::numbers::pi - between : between;
    if (other) {
        // The first face stays at 0.
        in = in == 0 ? 0 : 2 * std::numbers::pi - in;
        out = out == 0 ? 0 : 2 * std::numbers::pi - out;
    }
    result.in = in;
    result.out = out;
    return in <= result.opening && out <= result.opening && result.opening > std::numbers::pi + 0.05;
}

bool isBehindFace(const AcousticGeometry& geometry, const WallEdge& edge, const EdgeSide& side, bool out,
                  const glm::dvec3& position) {
    constexpr double kBehind = 1e-3;  // m: contact, as of furniture at a wall
    AcousticHit hit;
    return (out ? side.outOnFace : side.inOnFace) &&
           geometry.closest(position, side.offFace(edge, out), kBehind, kNoPlane, hit);
}

glm::dvec3 aimAt(const WallEdge& edge, const glm::dvec3& position, const glm::dvec3& from) {
    // Radians above the face, or as far as what touches it is moved off; in its plane one may as well be beyond its far
    // end, where that hides the edge or not. Tolerances, of roundings in single precision.
    constexpr double kMin = 1e-6, kMax = 1e-2;
    const double between = glm::dot(edge.faceA, edge.faceB);
    if (isRim(edge)) {
        const double above = aboveSheet(edge, from), size = glm::distance(from, position);
        // In its plane others may lie between.
        if (!(std::abs(above) < kMin * size)) return position;
        return position + sheetNormal(edge) * std::copysign(0.1 * openRadius(position), above);
    }
    const glm::dvec3 away = -(edge.faceA + edge.faceB);
    const glm::dvec3 displacement = from - position,
                     across = displacement - edge.axis * glm::dot(displacement, edge.axis);
    const double size = glm::length(across), minimum = std::min(kMin * size, 1e-7 + 4 * positionRounding(from));
    const auto isAlong = [&](const glm::dvec3& face, const glm::dvec3& other) {
        const double above = -glm::dot(across, glm::normalize(other - face * between));
        return glm::dot(across, face) > 0 && above > minimum && above < kMax * size;
    };
    if (!isAlong(edge.faceA, edge.faceB) && !isAlong(edge.faceB, edge.faceA)) return position;
    return position + away * (0.1 * openRadius(position) / glm::length(away));
}

double seenRounding(double distance, const glm::dvec3& edge) {
    return 1e-5 * (1 + distance) + positionRounding(edge);
}

bool seen(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& edge) {
    const glm::dvec3 displacement = edge - from;
    const double distance = glm::length(displacement), rounding = seenRounding(distance, edge);
    AcousticHit hit;
    return !(distance > rounding) ||
           !geometry.closest(from, displacement / distance, distance - rounding, kNoPlane, hit);
}

glm::dvec3 offEnds(const WallEdge& edge, const glm::dvec3& by) {
    const double off = std::min(2 * openRadius(by), 0.25 * edge.length);
    return edge.from + edge.axis * std::clamp(glm::dot(by - edge.from, edge.axis), off, edge.length - off);
}

bool isOpen(const AcousticGeometry& geometry, const WallEdge& edge, const glm::dvec3& by) {
    const double between = isRim(edge) ? 2 * std::numbers::pi : angleAbout(edge, edge.faceB);
    const bool other = between < std::numbers::pi;
    return isOpen(geometry, edge, by, other ? 2 * std::numbers::pi - between : between, other ? -1 : 1);
}

bool isOpen(const AcousticGeometry& geometry, const WallEdge& edge, const glm::dvec3& by, double opening,
            double rotation) {
    // A bound of work; and radians from the faces, as much as a wedge must be off flat to bend (pathRound()).
    constexpr int kSteps = 8;
    constexpr double kOff = 0.05;
    const double radius = openRadius(by);
    const glm::dvec3 beside = glm::cross(edge.axis, edge.faceA) * rotation;
    const auto at = [&](int i) {
        const double angle = kOff + (opening - 2 * kOff) * i / kSteps;
        return by + radius * (std::cos(angle) * edge.faceA + std::sin(angle) * beside);
    };
    for (int i = 0; i < kSteps; ++i) {
        const glm::dvec3 from = at(i), displacement = at(i + 1) - from;
        const double length = glm::length(displacement);
        AcousticHit hit;
        if (geometry.closest(from, displacement / length, length, kNoPlane, hit)) return false;
    }
    return true;
}

}  // namespace rtsg
