// Joins edges of a mesh that continue each other straight between the same faces. So a wall that is cut into many
// pieces diffracts sound like one in one piece.
//
// Threading: pure functions.
#pragma once

#include <vector>

#include "wall_edges.h"

namespace rtsg {

/// Of one mesh; in the order of their ends, as edgesOf() has them.
void joinStraight(std::vector<MeshEdge>& edges);

/// Whether a mesh's corner comes before another one: by x, y and z.
bool isBefore(const Vec3f& a, const Vec3f& b);

}  // namespace rtsg
