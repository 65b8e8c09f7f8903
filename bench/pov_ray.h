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

/// What UnderSky::writePov() wrote, with nine samples a pixel and radiosity of so many rays a place, which spread their
/// light over their surroundings: quick, and not quite right. By one thread. Nothing if it did not make it.
std::optional<PovRayPicture> povRayScene(const std::filesystem::path& scene, int side, int count);

}  // namespace rtsg::bench
