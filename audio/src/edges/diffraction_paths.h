// Paths of sound over edges: where they are shortest, their angles, and whether they are free.
//
// Threading: pure functions over const geometry.
#pragma once

#include <cmath>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include "diffraction_wedge.h"

namespace rtsg {

/// Metres that single precision may have shifted a corner by, twice over.
double positionRounding(const glm::dvec3& position);

/// A path round an edge, the place on it, and which way angles count from its first face on.
struct RoundEdge {
    WedgePath path;
    glm::dvec3 by{0};  // the end that is nearer, where the shortest way leads past the edge
    double side = 1;

    bool past() const { return path.from > 0 || path.to < 0; }
};

/// Source and listener beside the line that an edge is on.
struct BesideEdge {
    glm::dvec3 acrossS{0}, acrossR{0};  // from the line, square to it
    double zs = 0, zr = 0;              // m along it, from where the edge begins
    double s = 0, r = 0;                // m off it
    double z = 0;                       // where the shortest way by it meets it

    BesideEdge(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener);

    /// Metres from one to the other by a place on the line.
    double pathLengthBy(double position) const {
        return std::sqrt(s * s + (position - zs) * (position - zs)) +
               std::sqrt(r * r + (zr - position) * (zr - position));
    }
};

/// Finds the path of sound round an edge from source to listener; false if there is none.
bool pathRound(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener, RoundEdge& round);
bool pathRound(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener, const BesideEdge& beside,
               RoundEdge& round);

/// How a way bends at an edge; angles count from its first face on, in the air.
struct EdgeSide {
    double opening = 0, in = 0, out = 0;
    double side = 1;
    bool inOnFace = false, outOnFace = false;

    /// Radians by which it bends into the shadow; negative in the light.
    double shadow() const;
    /// Unit, from a face that the way goes out along, or comes in along, into the air.
    glm::dvec3 offFace(const WallEdge& edge, bool out) const;
};
/// For ways from the edge back to where sound comes from, and on to where it goes to; either may lie on a face, of a
/// rim only with `side`, unit, on which side of the sheet. False where there is no air for it, or nothing to bend
/// about.
bool rotationAt(const WallEdge& edge, const glm::dvec3& back, const glm::dvec3& on, EdgeSide& result,
                const glm::dvec3& side = glm::dvec3(0));
/// Whether it is the rim of a sheet, whose two faces are one.
bool isRim(const WallEdge& edge);
/// How far a place is above the sheet of a rim, metres, on the side that is the same for all its rims; for one in its
/// plane, as well as single precision tells, the least that is on that side.
double aboveSheet(const WallEdge& rim, const glm::dvec3& position);
/// A place in that plane, or by less than 5e-5 radians beside it, so far off it: to pairs of rims it is on no boundary.
glm::dvec3 offSheet(const WallEdge& rim, const glm::dvec3& position);
/// Unit, from the sheet of a rim to that side.
glm::dvec3 sheetNormal(const WallEdge& rim);

/// Whether a place that the way goes along a face to, if `out`, or comes from is at the back of that face: on a wall,
/// within a room, of which the edge is outside.
bool isBehindFace(const AcousticGeometry& geometry, const WallEdge& edge, const EdgeSide& side, bool out,
                  const glm::dvec3& position);

/// The place to look at in order to see a place on an edge of less than half a turn. For those who look along one of
/// its faces it lies in the air beside the edge, since rounding may have put the edge itself behind that face.
glm::dvec3 aimAt(const WallEdge& edge, const glm::dvec3& position, const glm::dvec3& from);

/// Metres before a place on an edge from which on nothing counts that lies between.
double seenRounding(double distance, const glm::dvec3& edge);
/// Whether nothing lies between a place and one on an edge, but what meets there.
bool seen(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& edge);

/// A point near `by` on the edge for later tests, slightly off the edge's ends, where other walls may begin.
glm::dvec3 offEnds(const WallEdge& edge, const glm::dvec3& by);

/// Whether there is air all round the edge: it may be the seam of two walls.
bool isOpen(const AcousticGeometry& geometry, const WallEdge& edge, const glm::dvec3& by, double opening, double side);
/// The same on the side where there is more of it.
bool isOpen(const AcousticGeometry& geometry, const WallEdge& edge, const glm::dvec3& by);

}  // namespace rtsg
