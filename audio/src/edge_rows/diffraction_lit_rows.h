// Faces in a row, as the tops of walls, where source and listener are both above their plane: what all together do to
// direct sound beside what each does by itself.
//
// Each face, with its edges, leaves a share of direct sound. Of several the product of all is left, and somewhat more,
// because near the plane what gets past the one gets past the next one more easily. Pairs from the first edge of one
// face to the last one of another have what faces from the one to the other leave beside all shorter rows, so that all
// pairs together are the whole row. In the plane half of what is left is of direct sound, and half of the image in it;
// above it faces mirror their shares one beside the other. Threading: pure functions.
#pragma once

#include <array>
#include <complex>
#include <span>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

#include "diffraction_pair_way.h"
#include "edges/diffraction_small_bodies.h"
#include "response/edge_tones.h"

namespace rtsg {

/// Factors of what a pair bends along a face: of all, and of that part of it which is of the mirror image in the face.
struct LitRow {
    std::array<std::complex<double>, kEdgeTones> all, image;
};

/// Finds the factors of a pair along a face that hides neither source nor listener. False if its way has no gaps.
bool litRowOf(const PairWay& way, const glm::dvec3& source, const glm::dvec3& listener,
              std::span<const WallEdge* const> edges, const EdgeTones& tones, BodyWeights& bodies, LitRow& result);

}  // namespace rtsg
