// Moves sources and listeners off walls that they touch, and measures what surrounds a listener.
//
// A point on a wall is the limit of points in front of it, on the side from which it is seen, unless that side is
// inside a body. So it is moved off the wall by some roundings of its coordinates in single precision, as rays are
// (1e-5 m in a room of some metres). Threading: pure functions over const geometry.
#pragma once

#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

/// `point`, or where it touches walls a place just before them: on the side of `towards`, or if that is on the wall as
/// well, on the side that has something in front of it, or else on the one that the wall faces.
glm::dvec3 offWalls(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& towards);

/// The same for a source and its listener that both touch a closed mesh with one-sided faces (X3D `solid`): each is put
/// on the side that its face faces, outside of a body and inside of a room. A mesh with two-sided faces counts as a
/// room, because it cannot be distinguished from a body.
glm::dvec3 offSolids(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& other);

/// The same; but where that is sealed off from `towards`, as the inside of a body is whose face the place is on, on the
/// other side of one wall or all, if that is not; and where no way is found from behind a wall, before it, as over a
/// ground that has no thickness. What it moves to another side touches no wall there. Takes some thousand rays if the
/// wall is in the way.
glm::dvec3 outsideBodies(const AcousticGeometry& geometry, const glm::dvec3& point, const glm::dvec3& towards);

/// The size of a listener's surroundings, seen from there.
struct Surroundings {
    double volume = 0;   // m^3 of the visible space; in the open, as if walls were at `openDistance`
    double nearest = 0;  // m to the nearest surface
    bool closed = true;  // no direction leads out
};
Surroundings surroundings(const AcousticGeometry& geometry, const glm::dvec3& listener, double openDistance,
                          int directions = 512);

/// At most `count` places, spread evenly over the part of a ball around the listener that is seen from there; so are
/// any some of them that follow each other.
std::vector<glm::dvec3> pointsAround(const AcousticGeometry& geometry, const glm::dvec3& listener, double radius,
                                     std::size_t count);

/// Volume of the part of a ball around the listener that is seen from there, m^3.
double visibleVolume(const AcousticGeometry& geometry, const glm::dvec3& listener, double radius);

}  // namespace rtsg
