// Frames: what a scene costs from file to picture and from frame to frame, in the three mappings of RayWorld, by full
// traversal, and at the least that Embree alone takes; all in one run, in turn.
//
// Source: paper section 6 (scenes, tables 1 and 2, cost of the traversal).
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/ray_world.h>

#include "bench.h"

namespace rtsg::bench {

struct FrameOptions {
    std::vector<std::string> scenes = {};  // names of benchScenes(), or with "+teapot" behind; none: all of them
    double scale = 1;                      // share of the triangles
    int width = 1280, height = 720;
    double budget = 4;  // CPU seconds for frames of one scene, about
    /// Where there are more triangles than that, neither a flat scene nor the mapping `merged` is made.
    std::size_t flatTriangles = 20'000'000;
};

inline constexpr std::array kMappings = {RayWorld::Mapping::hybrid, RayWorld::Mapping::merged,
                                         RayWorld::Mapping::perShape};
inline constexpr std::array kMappingNames = {"hybrid", "merged", "perShape"};

/// Seconds of CPU time, medians (for a frame: of the scene's thread, background work not counted); bytes. Figures that
/// were not measured are 0.
struct FrameFigures {
    std::string scene;
    std::uint64_t triangles = 0, uniqueTriangles = 0, nodes = 0, instances = 0, moved = 0, deformed = 0;
    std::size_t errors = 0;  // diagnostics of loading
    double fileBytes = 0, load = 0, loadLimit = 0, firstPicture = 0, flatBuild = 0;
    double sceneWork = 0, flatten = 0, fullTraversal = 0, fullUpdate = 0, smallestUpdate = 0;
    std::array<double, 3> update{}, trace{},
        differing{};  // by kMappings; share of rays that hit otherwise than in flat
    double flatTrace = 0, picture = 0;
    double wholeFrame = 0;     // wall clock, all cores: from newFrame() to the picture
    double wholeFrameCpu = 0;  // the same as CPU time, over the cores
    double bareFrame = 0;      // its rays through bare Embree, all cores at work all the time
    std::array<RayWorld::Memory, 3> memory{};
    double flatBytes = 0, rssLoaded = 0, rssPicture = 0;
};

/// Writes the scene into a folder of its own, measures, and removes it. Errors: an unknown name; a file that cannot be
/// written or read.
Result<FrameFigures> measureFrames(const std::string& scene, const FrameOptions& options);
/// The scenes asked for, as JSON lines. False if one failed, or if mappings see different things.
bool frames(const FrameOptions& options, const Report& report);

}  // namespace rtsg::bench
