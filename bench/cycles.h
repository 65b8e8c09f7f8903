// Cycles, Blender's path tracer, where it is installed: the same room, in the same run.
//
// It stands beside a bench's figure and is asked for nothing else. Threading: one at a time.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace rtsg::bench {

struct CyclesPicture {
    std::string version;  // Blender's
    double seconds = 0;   // CPU time of one picture, with what it builds for it, without the program's start
    double error = 0;     // relative standard error, as RenderStats::error
    double mean = 0;      // of the picture, linear
};

/// Whether there is a `blender` in PATH.
bool hasCycles();

/// The room lit by two panels of bench_paths.cpp, by one thread, with so many samples a pixel: no clamps, no denoising,
/// bounces as good as without end, all samples alike, lamps that are meshes, materials as near as Cycles has them.
/// Nothing if Blender did not make it.
std::optional<CyclesPicture> cyclesRoom(int side, int samples);

/// Likewise what UnderSky::write() wrote: matte, two-sided, in the light of an even white sky.
std::optional<CyclesPicture> cyclesScene(const std::filesystem::path& meshes, int side, int samples);

}  // namespace rtsg::bench
