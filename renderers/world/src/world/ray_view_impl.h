// The tables that a RayView traces: the present or an earlier top of a RayWorld.
//
// Threading: const, but for the counter.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <rtsg/renderers/ray_view.h>

#include "embree/top.h"
#include "trees/strokes.h"

namespace rtsg {

struct RayView::Tables {
    bvh::TopView top;
    bvh::StrokeView strokes;
    std::vector<std::uint32_t> volumes;  // slots of boxes that no ray meets, and pointers do
    std::vector<std::uint32_t> proxies;  // of what no ray meets, and avatars do
    mutable std::atomic<std::uint64_t> badRays{0};
};

/// The kinds of rays that meet an instance, a bit each.
std::uint32_t kindsOf(const Instance& info);

}  // namespace rtsg
