// Moves places off the walls that they touch, and measures what is visible from a place.
#include "listening_positions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "walls/even_direction.h"

namespace rtsg {
namespace {

/// The relevant side of a wall that both points touch: the one with something in front of it.
double innerSide(const AcousticGeometry& geometry, const glm::dvec3& point, const NearSurface& wall, double off) {
    const auto shut = [&](double side) {
        AcousticHit hit;
        // Not straight away from the wall: symmetric rooms have edges there.
        const glm::dvec3 slant = glm::normalize(side * wall.normal + 0.1 * glm::dvec3(0.31, 0.53, 0.79));
        return geometry.closest(point + wall.normal * (side * off - wall.distance), slant, 1e9, kNoPlane, hit);
    };
    const bool front = shut(1), back = shut(-1);
    return back && !front ? -1 : 1;
}

double roundingOf(const glm::dvec3& point) {
    const glm::dvec3 size = glm::abs(point);
    return 0x1p-19 * (0x1p-3 + std::max({size.x, size.y, size.z}));
}

/// The walls that a place touches, and on which side of each it is meant to be.
struct TouchedWalls {
    std::vector<NearSurface> walls;
    std::vector<double> sides;
    /// A solid with the wall that it is part of, and the side of the wall on which its face is.
    struct Face {
        std::uint32_t solid;
        std::size_t wall;
        double side;
    };
    std::vector<Face> faces;
};

void findTouched(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& towards, double off,
                 TouchedWalls& touched) {
    touched.walls.clear();
    touched.sides.clear();
    touched.faces.clear();
    geometry.surfacesNear(point, off, [&](const NearSurface& surface) {
        std::size_t at = 0;
        while (at < touched.walls.size() && !(std::abs(glm::dot(touched.walls[at].normal, surface.normal)) > 1 - 1e-9))
            ++at;
        if (at == touched.walls.size()) touched.walls.push_back(surface);
        if (surface.solid != kNoSolid)
            touched.faces.push_back(
                {surface.solid, at, glm::dot(touched.walls[at].normal, surface.normal) < 0 ? -1.0 : 1.0});
    });
    for (const NearSurface& wall : touched.walls) {
        const double across = glm::dot(towards - point, wall.normal) + wall.distance;
        touched.sides.push_back(across > off ? 1 : across < -off ? -1 : innerSide(geometry, point, wall, off));
    }
}

/// Puts a place outside of a solid that the other place touches as well. Returns whether there is such a solid.
bool pushOutOfSolids(const AcousticGeometry& geometry, const glm::dvec3& other, TouchedWalls& touched) {
    if (touched.faces.empty()) return false;
    bool any = false;
    geometry.surfacesNear(other, roundingOf(other), [&](const NearSurface& surface) {
        for (const TouchedWalls::Face& face : touched.faces) {
            if (face.solid != surface.solid) continue;
            touched.sides[face.wall] = face.side;
            any = true;
        }
    });
    return any;
}

glm::dvec3 movedOff(const TouchedWalls& touched, const glm::dvec3& point, double off) {
    glm::dvec3 moved = point;
    // In a corner that is no right one, leaving one wall leads back to the other: the more acute it is, the more rounds
    // settle it.
    bool settled = false;
    for (int round = 0; round < 128 && !settled; ++round) {
        settled = true;
        for (std::size_t i = 0; i < touched.walls.size(); ++i) {
            const NearSurface& wall = touched.walls[i];
            const double now = touched.sides[i] * (wall.distance + glm::dot(moved - point, wall.normal));
            if (now < off) moved += wall.normal * (touched.sides[i] * (off - now));
            settled = settled && now > 0.99 * off;
        }
    }
    return moved;
}

}  // namespace

glm::dvec3 offWalls(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& towards) {
    const double off = roundingOf(point);
    thread_local TouchedWalls touched;  // direct sound asks in every block
    findTouched(geometry, point, towards, off, touched);
    return touched.walls.empty() ? point : movedOff(touched, point, off);
}

glm::dvec3 offSolids(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& other) {
    const double off = roundingOf(point);
    thread_local TouchedWalls touched;
    findTouched(geometry, point, other, off, touched);
    if (touched.walls.empty()) return point;
    pushOutOfSolids(geometry, other, touched);
    return movedOff(touched, point, off);
}

glm::dvec3 outsideBodies(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& towards) {
    const double off = roundingOf(point);
    TouchedWalls touched;
    findTouched(geometry, point, towards, off, touched);
    if (touched.walls.empty()) return point;
    // Far enough not to touch the wall any more, if this is asked again with a point that does not touch it either.
    if (pushOutOfSolids(geometry, towards, touched)) return movedOff(touched, point, 2 * off);
    const glm::dvec3 near = movedOff(touched, point, off);
    const double distance = glm::distance(near, towards);
    AcousticHit hit;
    if (!(distance > 0) || !geometry.closest(near, (towards - near) / distance, distance * (1 - 1e-6), kNoPlane, hit))
        return near;
    const Passage known = geometry.passage(near, towards);
    if (known == Passage::found) return near;
    // Far enough not to touch the wall any more.
    glm::dvec3 position(0);
    const auto isBetter = [&](const TouchedWalls& turned) {
        position = movedOff(turned, point, 2 * off);
        return geometry.passage(position, towards) != Passage::none;
    };
    TouchedWalls turned = touched;
    if (known == Passage::unknown) {
        // Both in the open, as over and under a ground that has no thickness: before the wall.
        bool behind = false;
        for (double& side : turned.sides) {
            behind = behind || side < 0;
            side = 1;
        }
        return behind && isBetter(turned) ? position : near;
    }
    for (double& side : turned.sides) side = -side;
    if (isBetter(turned)) return position;
    for (std::size_t i = 0; i < touched.sides.size() && touched.sides.size() > 1; ++i) {
        turned = touched;
        turned.sides[i] = -turned.sides[i];
        if (isBetter(turned)) return position;
    }
    return near;
}

Surroundings surroundings(const AcousticGeometry& geometry, const glm::dvec3& listener, double openDistance,
                          int directions) {
    Surroundings result;
    for (int first = 0; first < directions; first += AcousticRays::kMax) {
        AcousticRays rays;
        for (int i = first; i < std::min(directions, first + AcousticRays::kMax); ++i)
            rays.add(listener, glm::dvec3(0), evenDirection(i, directions), 1e6, kNoPlane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        for (int i = 0; i < rays.count; ++i) {
            const bool shut = (met >> i & 1) != 0;
            const double distance = shut ? hits[static_cast<std::size_t>(i)].distance : openDistance;
            result.closed = result.closed && shut;
            result.volume += 4 * std::numbers::pi / 3 * distance * distance * distance / directions;
        }
    }
    result.nearest = geometry.distanceToSurface(listener);
    return result;
}

std::vector<glm::dvec3> pointsAround(const AcousticGeometry& geometry, const glm::dvec3& listener, double radius,
                                     std::size_t count) {
    // Roberts' sequence: steps by powers of the root of x^4 = x + 1.
    constexpr double kRoot = 1.22074408460575947536;
    constexpr glm::dvec3 kStep{1 / kRoot, 1 / (kRoot * kRoot), 1 / (kRoot * kRoot * kRoot)};
    std::vector<glm::dvec3> positions;
    for (std::size_t i = 0; i < count; ++i) {
        const glm::dvec3 at = glm::fract(0.5 + static_cast<double>(i + 1) * kStep);
        const double z = 1 - 2 * at.x, across = std::sqrt(1 - z * z), angle = 2 * std::numbers::pi * at.y;
        const glm::dvec3 direction{across * std::cos(angle), across * std::sin(angle), z};
        const double distance = radius * std::cbrt(at.z);
        AcousticHit hit;
        if (!geometry.closest(listener, direction, distance, kNoPlane, hit))
            positions.push_back(listener + distance * direction);
    }
    return positions;
}

double visibleVolume(const AcousticGeometry& geometry, const glm::dvec3& listener, double radius) {
    constexpr int kDirections = 4096;
    double volume = 0;
    for (int first = 0; first < kDirections; first += AcousticRays::kMax) {
        AcousticRays rays;
        for (int i = first; i < std::min(kDirections, first + AcousticRays::kMax); ++i)
            rays.add(listener, glm::dvec3(0), evenDirection(i, kDirections), radius, kNoPlane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        for (int i = 0; i < rays.count; ++i) {
            const double distance = (met >> i & 1) != 0 ? hits[static_cast<std::size_t>(i)].distance : radius;
            volume += 4 * std::numbers::pi / 3 * distance * distance * distance / kDirections;
        }
    }
    return volume;
}

}  // namespace rtsg
