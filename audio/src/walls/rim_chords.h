// Round rims in many pieces, as a table's or a hole's: what is round to the eye has more of them than sound needs.
//
// Twelve edges stand for a rim. They lie as far outside of it in their corners as they are inside in their middles, so
// that ways round them are as long as round the rim. Whether one sees a place on them is asked of the rim itself.
// Threading: pure functions.
#pragma once

#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

#include "wall_edges.h"

namespace rtsg {

/// The corners of the pieces that one edge stands for, in its direction, in the mesh's frame.
struct MeshRim {
    std::vector<Vec3f> corners;
};

/// `edges` of one mesh, told which are round; all of them go to `withChords`, those of round rims as chords that know
/// their MeshRim, in the order of their ends. Where there is no such rim that stays empty.
///
/// A rim is closed, in a plane, convex (or is that of such a hole), and has 24 pieces or more, none of which turns by
/// more than 15.5 degrees or is more than three times as long as another one; nothing else ends at its corners but
/// facets of what is round.
std::vector<MeshRim> rimsOf(const std::vector<MeshEdge>& edges, std::vector<MeshEdge>& withChords);

/// In the world; `edge` is what stands for it there.
WallRim placedRim(const MeshRim& rim, const WorldFromLocal& worldFromLocal, const WallEdge& edge);

}  // namespace rtsg
