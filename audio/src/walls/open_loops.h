// Finds the boundary of a surface: the edges of a mesh that belong to one triangle only, as loops.
//
// Corners at one place are one corner. Threading: a pure function.
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/renderers/mesh.h>

namespace rtsg {

/// In larger meshes no loops are looked for.
constexpr std::uint32_t kMaxTrianglesWithLoops = 1'000'000;

/// Each closed and in the mesh's own frame, without corners at which it goes straight on.
std::vector<std::vector<Vec3f>> openLoopsOf(const Mesh& mesh);

}  // namespace rtsg
