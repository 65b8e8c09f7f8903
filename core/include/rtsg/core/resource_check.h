// Looks whether what a scene names by url can be opened: pictures, sounds, scripts, shaders, documents.
//
// Opens each file as whoever plays the scene would, and reads none. Of a list of urls one is enough. What is not there
// is a warning, as it is when the scene is played; Inlines that a loader was asked to load have been reported by it.
// Threading: the scene's thread.
#pragma once

#include <filesystem>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

void checkResources(const Scene& scene, const Resources& resources, Diagnostics& diagnostics);

/// The files that urls of the scene open: what must not be written while the scene is played. Each url that names a
/// file that is there counts, not just the first of a list.
std::vector<std::filesystem::path> resourceFiles(const Scene& scene, const Resources& resources);

}  // namespace rtsg
