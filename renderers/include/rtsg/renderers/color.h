// ColorSpace: whether numbers are light or values sent to a display, and the curve between the two.
//
// Threading: pure functions. Source: IEC 61966-2-1 (sRGB transfer). docs/color.md tells what happens to a colour from
// field to file.
#pragma once

#include <cstdint>

#include <rtsg/core/value.h>

namespace rtsg {

/// Linear: proportional to light. Display: sRGB-encoded, as colours of classic materials and bytes of pictures are.
/// Automatic, of a picture that is asked for: PhysicalMaterial in linear light, all else in the display's space.
enum class ColorSpace : std::uint8_t { automatic, linear, display };

/// IEC 61966-2-1 up to 1. Beyond, where no display reaches, numbers are multiples of white in both spaces: an emission
/// of 8 is eight times as bright as one of 1.
float srgbFromLinear(float linear);
float linearFromSrgb(float encoded);
inline Vec3f srgbFromLinear(const Vec3f& v) {
    return {srgbFromLinear(v.r), srgbFromLinear(v.g), srgbFromLinear(v.b)};
}
inline Vec3f linearFromSrgb(const Vec3f& v) {
    return {linearFromSrgb(v.r), linearFromSrgb(v.g), linearFromSrgb(v.b)};
}

}  // namespace rtsg
