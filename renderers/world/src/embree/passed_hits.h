// PassedHits: the surfaces that sixteen shadow rays pass on their way, all found in one traversal.
//
// Embree reports hits in no order, and some twice: those on triangles that share the edge which a ray goes through.
// Threading: one thread's.
#pragma once

#include <cstdint>

#include "top.h"

namespace rtsg::bvh {

struct PassedHits {
    static constexpr std::uint32_t kMax = 32;  // of a ray
    using Passes = bool (*)(const void* asked, std::uint32_t slot);

    PassedHits(Passes p, const void* a) : passes(p), asked(a) {}

    const Passes passes;  // whether rays continue behind a hit on a slot
    const void* const asked;
    std::uint32_t many = 0;  // lanes that pass more, and were ended
    std::uint32_t count[16] = {};
    RawHit hits[16][kMax];  // the first `count` of each lane
};

}  // namespace rtsg::bvh
