// rtsg bench view: the window, while somebody walks. It is like those of bench.h, but in real time.
#pragma once

#include "bench.h"

namespace rtsg::bench {

/// Reads examples/demo/hall.x3dv from the working folder. False if it is not there, or no window can be had.
bool view(const Report& report, bool quick);

}  // namespace rtsg::bench
