// The scenes of `rtsg bench frames`: models of our own, as near to those that the paper measured as its description of
// them goes, and a city beyond what it tried.
//
// A file depends on the name and the scale alone. `scale` is the share of the triangles, roughly: fewer things, coarser
// ones. Threading: re-entrant. Source: paper section 6.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg::bench {

struct SceneInfo {
    const char* name;
    const char* about;
    double triangles;  // of the paper's scene, along all paths
    bool animated = false;
    double teapotScale = 0;  // a teapot can be added that turns; 0: not meant to
};

/// In the paper's order; the city last.
std::span<const SceneInfo> benchScenes();
/// Null if there is none; capitals do not matter.
const SceneInfo* findBenchScene(std::string_view name);

/// Writes NAME.x3dv, and textures if it has any, into `folder`. Returns the triangles along all paths. Errors: an
/// unknown name, a scale outside (0, 1], files that cannot be written.
Result<std::uint64_t> writeBenchScene(std::string_view name, double scale, bool teapot,
                                      const std::filesystem::path& folder);

}  // namespace rtsg::bench
