// Faces in a row, such as the tops of walls, with source and listener above their plane: the joint effect on direct
// sound, in addition to the effects of single faces.
//
// Each face, with its edges, leaves a share of direct sound. Several faces leave the product of their shares, and
// somewhat more, because near the plane sound that has passed one face passes the next one more easily. A pair from the
// first edge of one face to the last edge of another has the effect of the faces between them beyond that of all
// shorter rows, so that all pairs together make up the row. In the plane, half of the remaining share belongs to direct
// sound and half to its mirror image; above the plane the faces reflect their shares separately. Threading: pure
// functions.
#pragma once

#include <array>
#include <complex>
#include <span>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

#include "diffraction_pair_path.h"
#include "edges/diffraction_small_bodies.h"
#include "response/edge_tones.h"

namespace rtsg {

/// Factors for the waves of a pair along a face: for all of it, and for the part that belongs to the mirror image in
/// the face.
struct LitRow {
    std::array<std::complex<double>, kEdgeTones> all, image;
};

/// Finds the factors of a pair along a face that hides neither source nor listener. False if its way has no gaps.
bool litRowOf(const PairPath& path, const glm::dvec3& source, const glm::dvec3& listener,
              std::span<const WallEdge* const> edges, const EdgeTones& tones, BodyWeights& bodies, LitRow& result);

}  // namespace rtsg
