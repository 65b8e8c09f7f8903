// Mesh files: what a scene shows at this moment as STL, OBJ, PLY or GLB, for other programs.
//
// Invariant: what is written is what the flattener gives: every shape at every place where it is seen, in triangles,
// one unit a metre. STL, OBJ and PLY have the corners in world space; a GLB has a mesh for each geometry and material,
// shared by its places, with viewpoints, lights, and what clocks move by interpolators of Transforms. Colours are the
// materials' own; texts of scripts stay behind. Threading: the scene's thread. Source: as
// documents/src/import/import.h; glTF 2.0 (ISO/IEC 12113:2022).
#pragma once

#include <filesystem>

#include <rtsg/core/output_file.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg {

enum class MeshFormat : std::uint8_t { stl, obj, ply, glb };

/// Finds the format in a file's name: .stl, .obj, .ply or .glb. False if the name has none of these.
bool meshFormatFromName(const std::filesystem::path& file, MeshFormat& format);

struct MeshFileContent {
    std::size_t shapes = 0, triangles = 0;
};

/// Errors: a scene that shows no triangles, a file that cannot be written. `diagnostics` hears of geometry that has
/// none, and of what moves and is none of glTF's here. `flattener` makes the triangles: one that has mesh sources, say.
Result<MeshFileContent> writeMeshFile(const Scene& scene, const std::filesystem::path& file, MeshFormat format,
                                      Diagnostics& diagnostics, Existing existing = Existing::replace,
                                      Flattener flattener = Flattener());

}  // namespace rtsg
