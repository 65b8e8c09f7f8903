// Faces in one plane with gaps between them, such as the tops of walls one behind the other: shares of paths along the
// plane.
//
// A pair of edges diffracts as if one face led from one edge to the other. At a gap, half of the sound along the face
// goes down, and half of that comes up again onto the next face: F = 1/2 + asin(rho) / pi is left, with rho^2 = a b /
// ((a + g) (b + g)). Here g is the width of the gap, and a and b are the distances before and after it to the nearest
// point in the plane: the source, or in its deep shadow the first edge. This is the integral over the air above both
// edges of the gap for waves that travel nearly along the plane; nothing is lost when the gap closes. A pair that
// leaves the plane at a gap has 2 - 2 F. So the sum of all paths is continuous where sound comes up over a row: 1 - (1
// - F) - F / 2 above the plane, F / 2 below. Source: the double knife edge, Millington, Hewitt and Immirzi, Proc. IEE
// 109C (1962), 419-429. Threading: pure functions.
#pragma once

#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "diffraction_pair_path.h"
#include "edges/diffraction_small_bodies.h"

namespace rtsg {

/// A face on a straight way in its plane: metres on from where that begins, and the edges there; null: not known.
struct RowFace {
    double from = 0, to = 0;
    const WallEdge *begin = nullptr, *end = nullptr;
};
/// The faces on a way along a face of both edges, from the first edge to the second one; `edges`: among them are those
/// that it passes.
std::vector<RowFace> facesBetween(const PairPath& path, std::span<const WallEdge* const> edges);

/// F of the above, of a gap and the ways before and after it, metres.
double leftBeyond(double before, double gap, double after);

/// Shares of the pressure of a pair, by tone. Of a way along a face of both edges; `edges`: among them are those that
/// it passes. An edge hides the source, or the listener, if that is below the plane: then faces beyond the edge are
/// what hides it.
BodyWeights::Tones rowFractionOf(const PairPath& path, const glm::dvec3& source, bool firstHides,
                                 const glm::dvec3& listener, bool secondHides, std::span<const WallEdge* const> edges,
                                 double speedOfSound);

}  // namespace rtsg
