// Finds the parts of an edge that are visible from both points; other parts may be hidden.
//
// Threading: pure functions over const geometry.
#pragma once

#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

/// Metres from the edge's beginning on.
struct EdgePart {
    double from = 0, to = 0;
};

/// In order along the edge; looked for at some places, most of them near to `by`, and between these more closely where
/// one is seen and the next one is not. What hides less than lies between two of them may be missed.
std::vector<EdgePart> partsSeen(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                                const WallEdge& edge, const glm::dvec3& by);

}  // namespace rtsg
