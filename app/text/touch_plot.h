// touchPlot: forces and depths of a touch by time, as a drawing.
#pragma once

#include <string>
#include <vector>

#include <rtsg/haptics/haptic_tick.h>

namespace rtsg::app {

/// SVG of its own: the force, and how far the hand is from its proxy.
std::string touchPlot(const std::vector<HapticTick>& ticks);

}  // namespace rtsg::app
