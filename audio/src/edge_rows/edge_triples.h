// A third bend: what two edges of a body bend along its next face, where a third one of that face begins to hide it, or
// hides it. With it what a pair brings has no step in the plane of that face, beyond its corners.
//
// The listener laid flat into the last face, the first two edges bend as a pair as far as the ways lead by the third
// one, which lets a share of it through: half of it in the face's plane. The same the other way round for the source
// and the first edge; of both that counts which is nearer to its boundary. Threading: pure functions over const
// geometry.
#pragma once

#include <vector>

#include "edge_pair_way.h"

namespace rtsg {

struct TripleField {
    const WallEdge *first = nullptr, *second = nullptr, *third = nullptr;
    bool firstHides = false, thirdHides = false;
    glm::dvec3 byFirst{0}, bySecond{0}, byThird{0};
    double way = 0;
    /// Re the phase of its way; and by ends, of which the last place is that on the third edge.
    PairField field;
};

/// Of the edges of which `first` and `second` may be one after the other along a face, ways by three of them.
std::vector<TripleField> triplesOf(const AcousticGeometry& geometry, const glm::dvec3& source,
                                   const glm::dvec3& listener, bool heardStraight,
                                   const std::vector<const WallEdge*>& edges, double longest, const EdgeTones& tones);

}  // namespace rtsg
