// A room lit by square lamps under its ceiling, of `rtsg bench paths` and `rtsg chart light`.
//
// Threading: values.
#pragma once

#include <string>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg::bench {

/// Where the square lamps of a room are, and half a side of each, metres.
std::vector<Vec3f> lampMiddles(int lamps);
double lampHalf(int lamps);

/// A white room of 4 x 3 x 4 m with a ball and a box, and `lamps` square lamps of .18 m2 together under its ceiling.
/// `mirrors`: they mirror a trace of light too, so that only bounces find them. `seen`: they are in the picture, where
/// the edges of a thousand are to be sampled too.
std::string panelRoom(int lamps, bool mirrors, bool seen = true);

}  // namespace rtsg::bench
