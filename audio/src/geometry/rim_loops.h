// Closed lines of a mesh's edges that go on in each other, a little turned each, and what else ends at their corners.
//
// Threading: pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "wall_edges.h"

namespace rtsg {

/// Radians from a piece of a round rim to the next at most, and from a facet beside it to the next.
constexpr double kMostRimTurn = 0.5;

/// An end of an edge of a mesh: twice its number, and 1 for its `to`.
using EdgeEndNumber = std::uint32_t;

/// Pieces that go on in each other, and come back to the first one.
struct RimLoop {
    std::vector<std::uint32_t> pieces;
    std::vector<glm::dvec3> corners;                // where each piece begins
    std::vector<std::vector<EdgeEndNumber>> sides;  // of edges between facets that end there
};

/// Of edges between facets of what is round (MeshEdge::round) nothing is told.
std::vector<RimLoop> rimLoopsOf(const std::vector<MeshEdge>& edges);

const Vec3f& cornerOf(const std::vector<MeshEdge>& edges, EdgeEndNumber end);

}  // namespace rtsg
