// Part of `rtsg bench runtime`: rigid bodies by the thousand.
#pragma once

#include "bench.h"

namespace rtsg::bench {

void rigidBodies(const Report& report, bool quick);

}  // namespace rtsg::bench
