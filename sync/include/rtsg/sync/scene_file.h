// Scene files: a .rtsgb file is a scene's snapshot as one record in the bytes of the wire (PROTOCOL.md, "Scene files").
// Older files, which are a head and a keyframe, are read as well.
//
// Invariant: a written scene is read back as the same state with the same hash. A damaged file is refused. A file of
// another build is read as far as this program knows its types.
// Threading: the scene's thread.

// Example:
//     #include <rtsg/documents/loader.h>
//     #include <rtsg/sync/scene_file.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics("hall.x3dv");
//     rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     if (const auto ok = rtsg::writeSceneFile(scene, "hall.rtsgb"); !ok) std::cerr << ok.error().format() << '\n';
#pragma once

#include <filesystem>

#include <rtsg/core/output_file.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// Any file name will do; callers use .rtsgb.
Result<> writeSceneFile(const Scene& scene, const std::filesystem::path& file, Existing existing = Existing::replace);

/// Reads into an empty scene. Errors: no such file, damage (with the byte where it is), a state that cannot be applied.
Result<> readSceneFile(Scene& scene, const std::filesystem::path& file);

/// Looks at the first bytes. True for logs as well, false if there is no such file.
bool isSceneFile(const std::filesystem::path& file);

}  // namespace rtsg
