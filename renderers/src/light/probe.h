// Probe: a small white surface that light falls on, without being in the scene.
//
// Threading: pathProbe() is re-entrant.
#pragma once

#include "trace_scene.h"

namespace rtsg::trace {

struct Probe {
    Vec3f place{0};         // ray space
    Vec3f normal{0, 1, 0};  // unit
};

/// What it shows, by paths: a tile's pixels are as many groups of `settings.samplesPerPixel` samples, each group apart
/// from all others, those of other `tile`s too. Precondition: 0 <= tile < 2^26.
void pathProbe(const TraceScene& scene, const Probe& probe, const RenderSettings& settings, int tile,
               TileResult& result);

}  // namespace rtsg::trace
