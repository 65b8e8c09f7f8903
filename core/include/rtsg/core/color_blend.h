// Blends two colours, as ColorInterpolator and the colour ramps of particles do.
//
// Threading: pure. Source: ISO/IEC 19775-1 V4.0 19.4.1, 40.4 (ParticleSystem's color).
#pragma once

#include <rtsg/core/value.h>

namespace rtsg {

/// Blends in HSV space, with the hue along the shorter arc. A colour without hue takes that of the other one. At w = 0
/// and 1 the result is exactly `a` and `b`.
Color blend(const Color& a, const Color& b, float w);

}  // namespace rtsg
