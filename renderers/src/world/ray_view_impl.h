// What a RayView traces: the top of a RayWorld as it is, or as it was.
//
// Threading: const, but for the counter.
#pragma once

#include <atomic>
#include <cstdint>

#include <rtsg/renderers/ray_view.h>

#include "embree/strokes.h"
#include "embree/top.h"

namespace rtsg {

struct RayView::Tables {
    bvh::TopView top;
    bvh::StrokeView strokes;
    mutable std::atomic<std::uint64_t> badRays{0};
};

}  // namespace rtsg
