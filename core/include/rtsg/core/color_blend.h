// Blends two colours, as ColorInterpolator and the colour ramps of particles do.
//
// Threading: pure. Source: ISO/IEC 19775-1 V4.0 19.4.1, 40.4 (ParticleSystem's color).
#pragma once

#include <rtsg/core/value.h>

namespace rtsg {

/// In HSV space, hue the short way round; a colour without hue takes the other's. The ends come out as they are.
Color blend(const Color& a, const Color& b, float w);

}  // namespace rtsg
