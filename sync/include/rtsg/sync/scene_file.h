// Scene files: .rtsgb, a scene's snapshot as one record of the bytes that travel (PROTOCOL.md, "Scene files"). Files of
// before the catalogue, a head and a keyframe, are read as well.
//
// Invariant: what is written is read back as the same state, hash and all; a damaged file is refused, and a file of
// another build is read as far as its types are known here. Threading: the scene's thread.

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

/// The name of the file says nothing; callers use .rtsgb.
Result<> writeSceneFile(const Scene& scene, const std::filesystem::path& file, Existing existing = Existing::replace);

/// Into an empty scene. Errors: no such file, damage (with the byte where it is), a state that cannot be applied.
Result<> readSceneFile(Scene& scene, const std::filesystem::path& file);

/// By its first bytes, which logs have as well; false where there is no such file.
bool isSceneFile(const std::filesystem::path& file);

}  // namespace rtsg
