// Recognises cylinders, parts of cylinders, and spheres in a mesh by rows of edges with small angles.
//
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

#include "wall_edges.h"

namespace rtsg {

/// Radians; what turns less is a plane to them: corners in single precision tell no more.
constexpr double kFlatFacet = 0.0025;
/// In meshes of more edges than this nothing round is looked for: a bound of work, as for landscapes that change.
constexpr std::size_t kMaxEdgesOfRounds = 8192;
/// Facets that turn by more make an edge of their own: a prism of eleven sides has edges, one of twelve is round.
constexpr double kMaxRoundRotation = 0.55;

/// In the mesh's frame.
struct MeshRound {
    RoundBody body;
};

/// `edges` of one mesh, with straight ones joined; edges between the facets of a round shape get its number.
std::vector<MeshRound> roundsOf(std::vector<MeshEdge>& edges);

/// In the world; false where a transform has made it oval.
bool placedRound(const MeshRound& round, const WorldFromLocal& worldFromLocal, RoundBody& result);

}  // namespace rtsg
