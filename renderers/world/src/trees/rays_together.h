// Whether the rays of a packet are so close together that it pays to trace them by their common frustum, as Embree does
// with coherent rays: those from an eye, to a lamp, from a flat mirror.
//
// Threading: a function of its arguments.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <rtsg/renderers/ray.h>

namespace rtsg::bvh {

/// Whether the rays of the valid lanes run close together. `parallel` and `nearby` limit sums of squares over the axes:
/// of the ranges of unit directions, and of the ranges of origins. avx512::runTogether() gives the same answers, bit
/// for bit.
inline bool runTogether(const RayPacket16& rays, const std::int32_t* valid, float parallel, float nearby) {
    const auto squareOfRange = [valid](const float* values) {
        float low = HUGE_VALF, high = -HUGE_VALF;
        for (int i = 0; i < 16; ++i) {
            low = valid[i] ? std::min(low, values[i]) : low;
            high = valid[i] ? std::max(high, values[i]) : high;
        }
        return (high - low) * (high - low);
    };
    float unit[3][16];
    for (int i = 0; i < 16; ++i) {
        const float x = rays.directionX[i], y = rays.directionY[i], z = rays.directionZ[i];
        const float inverse = 1 / std::sqrt((x * x + y * y) + z * z);
        unit[0][i] = x * inverse, unit[1][i] = y * inverse, unit[2][i] = z * inverse;
    }
    const float turned = (squareOfRange(unit[0]) + squareOfRange(unit[1])) + squareOfRange(unit[2]);
    if (!(turned < parallel)) return false;
    return (squareOfRange(rays.originX) + squareOfRange(rays.originY)) + squareOfRange(rays.originZ) < nearby;
}

}  // namespace rtsg::bvh
