// Two edges of a face that is narrow beside a wave: together they bend as one edge between both of their outer faces.
//
// What two edges bend one after the other is known for waves that are shorter than the face is wide, and for edges that
// are longer than a wave. The rim of a table is neither at low tones, but there it is nearly one of a sheet, of which
// also short pieces are exact. Threading: pure functions.
#pragma once

#include <glm/glm.hpp>

#include "edge_pair_way.h"
#include "response/edge_tones.h"

namespace rtsg {

/// Of a pair along a face, whose edges both hide it, what is so of a narrow one, with its ends, in the place of as much
/// of `field`. Nothing where the edges are not side by side.
void blendThinFace(const PairWay& way, const glm::dvec3& source, const glm::dvec3& listener, const EdgeTones& tones,
                   PairField& field);

}  // namespace rtsg
