// Options that tests of the tracer share.
#pragma once

#include <cstdint>

#include "rays/acoustic_tracer.h"

namespace rtsg::test {

/// Two seconds in 16 batches; the air takes nothing.
inline TraceOptions shortTrace(std::uint64_t rays, std::uint64_t seed, int imageOrder) {
    TraceOptions options;
    options.rays = rays;
    options.imageOrder = imageOrder;
    options.batches = 16;
    options.maxSeconds = 2;
    options.seed = seed;
    options.air.absorbs = false;
    return options;
}

}  // namespace rtsg::test
