// The chart sources of rtsg chart that need the renderers; sync's are in bench_sync.h.
#pragma once

#include "chart.h"

namespace rtsg::bench {

/// Frames of the paper's scenes in each mapping: following, rays, both, memory.
bool chartFrames(const ChartSink& sink, bool quick);
/// Error of path-traced pictures against time.
bool chartRays(const ChartSink& sink, bool quick);
/// Error of a room's picture against time, with and without an error to reach, beside Cycles where it is installed.
bool chartLight(const ChartSink& sink, bool quick);
/// A part of chartLight(): the benefit of each part of the path tracer, by pictures with and without it.
void chartLightParts(const ChartSink& sink, bool quick);
/// Error of a room's figures against time, by each method; moving sources against the time of a frame. False: a room
/// cannot be made.
bool chartSound(const ChartSink& sink, bool quick);
/// Error of what is heard in five rooms against CPU time, by quality. False: a room cannot be made or heard.
bool chartHeard(const ChartSink& sink, bool quick);
/// Levels behind things with and without each mechanism of diffraction, beside boundary elements.
bool chartSoundParts(const ChartSink& sink, bool quick);
/// Work of one change against the size of the scene. False: something could not be measured.
bool chartScale(const ChartSink& sink, bool quick);
/// The largest stiffness of a surface that does not ring, and the error of forces, against the rate of the touch.
bool chartTouch(const ChartSink& sink, bool quick);
/// Error of pictures of the demo's hall against time, by resolution and by samples. False: the hall is not below this
/// folder.
bool chartView(const ChartSink& sink, bool quick);
/// Speed of rays through deforming meshes against meshes built afresh.
bool chartDeform(const ChartSink& sink, bool quick);

}  // namespace rtsg::bench
