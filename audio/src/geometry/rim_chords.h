// Round rims in many pieces, as a table's or a hole's, and round sides between them, as a cone's: what is round to the
// eye has more of them than sound needs.
//
// Twelve edges stand for a rim. They lie as far outside of it in their corners as they are inside in their middles, so
// that ways round them are as long as round the rim. Whether one sees a place on them is asked of the rim itself. From
// their corners twelve edges lead to those of another rim, or to an apex, where a round side of facets does: a frustum,
// a cone, a cylinder that is oval.
// Threading: pure functions.
#pragma once

#include <optional>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

#include "wall_edges.h"

namespace rtsg {

/// In the mesh's frame, of what one edge stands for: the corners of the pieces of a rim in its direction, or both ends
/// of an edge of a round side, how far from its middle the side reaches out beyond the edge's faces, and the corners of
/// the face to the next such edge.
struct MeshRim {
    std::vector<Vec3f> corners;
    std::optional<Vec3f> out;
    std::vector<Vec3f> facet;
};

/// `edges` of one mesh, told which are round; all of them go to `withChords`, those of round rims and sides as the few
/// that know their MeshRim, in the order of their ends. Where there is no such rim that stays empty.
///
/// A rim is closed, in a plane, convex (or is that of such a hole), and has 24 pieces or more, none of which turns by
/// more than 28 degrees or is more than three times as long as another one; nothing else ends at its corners but
/// facets of what is round, and edges of round sides, of which each turns as little, and from each corner one leads to
/// the same other rim, or to one place.
std::vector<MeshRim> rimsOf(const std::vector<MeshEdge>& edges, std::vector<MeshEdge>& withChords);

/// In the world; `edge` is what stands for it there.
WallRim placedRim(const MeshRim& rim, const WorldFromLocal& worldFromLocal, const WallEdge& edge);

}  // namespace rtsg
