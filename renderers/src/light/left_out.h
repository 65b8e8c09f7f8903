// What rays pass as if it were not there: behind ClipPlanes, of other layers, around a cube that is drawn.
//
// Threading: the filters are const.
#pragma once

#include <memory>
#include <vector>

#include "light_tables.h"

namespace rtsg::trace {

/// What ClipPlanes and Viewports cut off; null: nothing. `eye`: the picture's; null: none whose edges matter.
std::shared_ptr<const RayFilter> clipFilter(const LightState& state, const RayView& world,
                                            const RenderSettings& settings, const Camera* eye);

/// The slots that `hidden` says besides what another filter leaves out, which may be null.
std::shared_ptr<const RayFilter> hidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other,
                                              const RayView& world, const RenderSettings& settings);

}  // namespace rtsg::trace
