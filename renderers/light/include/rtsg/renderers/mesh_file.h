// Mesh files: writes the visible shapes of a scene as STL, OBJ, PLY or GLB, for other programs.
//
// Invariant: the file has what the flattener gives: every shape at every place where it is visible, in triangles, in
// metres. STL, OBJ and PLY have the corners in world space. A GLB has one mesh for each geometry and material, shared
// by its places, with viewpoints, lights, and animations of Transforms by clocks and interpolators. Colours are those
// of the materials, in a GLB as light; script programs are not written. Threading: the scene's thread. Source: as for
// documents/src/import/import.h; glTF 2.0 (ISO/IEC 12113:2022).
#pragma once

#include <filesystem>

#include <rtsg/core/output_file.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg {

enum class MeshFormat : std::uint8_t { stl, obj, ply, glb };

/// Finds the format by a file's name: .stl, .obj, .ply or .glb. False for other names.
bool meshFormatFromName(const std::filesystem::path& file, MeshFormat& format);

struct MeshFileContent {
    std::size_t shapes = 0, triangles = 0;
};

/// Errors: the scene shows no triangles; the file cannot be written. `diagnostics` names geometry without triangles,
/// and what is left out of the file. `pictures`: what urls of textures may open, for a GLB, which has their bytes.
/// `flattener` makes the triangles: it may have mesh sources of its own.
Result<MeshFileContent> writeMeshFile(const Scene& scene, const std::filesystem::path& file, MeshFormat format,
                                      Diagnostics& diagnostics, Existing existing = Existing::replace,
                                      const Resources& pictures = {}, Flattener flattener = Flattener());

}  // namespace rtsg
