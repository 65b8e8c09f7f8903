// The chart sources of rtsg chart that need the renderers; sync's are in bench_sync.h.
#pragma once

#include "bench/chart.h"

namespace rtsg::bench {

/// Work of one change against the size of the scene. False: something could not be measured.
bool chartScale(const ChartSink& sink, bool quick);
/// Speed of rays through deforming meshes against meshes built afresh.
bool chartDeform(const ChartSink& sink, bool quick);

}  // namespace rtsg::bench
