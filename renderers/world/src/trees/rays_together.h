// Whether the rays of a packet are so close together that it pays to trace them by their common frustum, as Embree does
// with coherent rays: those from an eye, to a lamp, from a flat mirror.
//
// Threading: a function of its arguments.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <rtsg/renderers/ray.h>

#include "mesh/simd8.h"

namespace rtsg::bvh {

/// Whether the rays of the valid lanes run close together. `parallel` and `nearby` limit sums of squares over the axes:
/// of the ranges of unit directions, and of the ranges of origins.
inline bool runTogether(const RayPacket16& rays, const std::int32_t* valid, float parallel, float nearby) {
    using namespace simd;
    I8 lanes[2];
    std::memcpy(lanes, valid, sizeof lanes);
    const auto squareOfRange = [&lanes](F8 a, F8 b) {
        const F8 far = all(HUGE_VALF);
        const F8 low = min(select(lanes[0], a, far), select(lanes[1], b, far));
        const F8 high = max(select(lanes[0], a, -far), select(lanes[1], b, -far));
        float lowest = low[0], highest = high[0];
        for (int i = 1; i < 8; ++i) lowest = std::min(lowest, low[i]), highest = std::max(highest, high[i]);
        return (highest - lowest) * (highest - lowest);
    };
    F8 unit[3][2];
    for (int half = 0; half < 2; ++half) {
        const F8 x = load(rays.directionX + 8 * half), y = load(rays.directionY + 8 * half),
                 z = load(rays.directionZ + 8 * half), inverse = 1.0f / sqrt((x * x + y * y) + z * z);
        unit[0][half] = x * inverse, unit[1][half] = y * inverse, unit[2][half] = z * inverse;
    }
    const float turned = (squareOfRange(unit[0][0], unit[0][1]) + squareOfRange(unit[1][0], unit[1][1])) +
                         squareOfRange(unit[2][0], unit[2][1]);
    if (!(turned < parallel)) return false;
    const auto ofOrigins = [&](const float* values) { return squareOfRange(load(values), load(values + 8)); };
    return (ofOrigins(rays.originX) + ofOrigins(rays.originY)) + ofOrigins(rays.originZ) < nearby;
}

}  // namespace rtsg::bvh
