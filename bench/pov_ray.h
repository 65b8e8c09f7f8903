// POV-Ray, where it is installed: a scene under a white sky, in the same run.
//
// It stands beside a chart's curves and is asked for nothing else. Threading: one at a time.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <rtsg/renderers/picture.h>

namespace rtsg::bench {

struct PovRayPicture {
    std::string version;
    double seconds = 0;  // CPU time of the program, reading included
    Picture picture;     // linear
};

/// Whether there is a `povray` in PATH.
bool hasPovRay();

/// Traces the scene of UnderSky::writePov() with POV-Ray, with nine samples a pixel, and radiosity with so many rays at
/// a place, which spread their light over their surroundings: fast, and not quite accurate. It uses one thread. Nothing
/// if there was no picture.
std::optional<PovRayPicture> povRayScene(const std::filesystem::path& scene, int side, int count);

}  // namespace rtsg::bench
