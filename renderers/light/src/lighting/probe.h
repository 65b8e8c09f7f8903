// Probe: a small white surface that light falls on, without being in the scene.
//
// Threading: pathProbe() is re-entrant.
#pragma once

#include <algorithm>

#include <rtsg/renderers/ray_view.h>

#include "trace_scene.h"

namespace rtsg::trace {

struct Probe {
    Vec3f position{0};      // ray space
    Vec3f normal{0, 1, 0};  // unit

    /// The same, as far off as a surface that goes through the place may be by its roundings: of the place's own
    /// coordinates, and less of the largest of them, as what turns a surface mixes them.
    HitPoint point() const {
        constexpr float kOwn = 0x1p-22f, kLargest = 0x1p-24f;
        const Vec3f a = glm::abs(position), off = kOwn * a + kLargest * std::max({a.x, a.y, a.z, 1.0f});
        return {position, off, normal};
    }
};

/// Measures the probe by paths: a tile's pixels are as many groups of `settings.samplesPerPixel` samples, each group
/// apart from all others, those of other `tile`s too. Precondition: 0 <= tile < 2^26.
void pathProbe(const TraceScene& scene, const Probe& probe, const RenderSettings& settings, int tile,
               TileResult& result);

}  // namespace rtsg::trace
