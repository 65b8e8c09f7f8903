// ColorSpace: linear light or values for a display, and the curve between the two.
//
// Threading: pure functions. Source: IEC 61966-2-1 (sRGB transfer). docs/color.md explains the way of a colour from a
// field to a file.
#pragma once

#include <cstdint>

#include <rtsg/core/value.h>

namespace rtsg {

/// Linear: proportional to light. Display: sRGB-encoded, as colours of classic materials and bytes of pictures are.
/// Automatic (for settings only): PhysicalMaterial is computed in linear light, all other materials in the display
/// space.
enum class ColorSpace : std::uint8_t { automatic, linear, display };

/// The curve of IEC 61966-2-1 up to 1. Above 1, which no display shows, values are multiples of white in both spaces:
/// an emission of 8 is eight times as bright as one of 1.
float srgbFromLinear(float linear);
float linearFromSrgb(float encoded);
inline Vec3f srgbFromLinear(const Vec3f& v) {
    return {srgbFromLinear(v.r), srgbFromLinear(v.g), srgbFromLinear(v.b)};
}
inline Vec3f linearFromSrgb(const Vec3f& v) {
    return {linearFromSrgb(v.r), linearFromSrgb(v.g), linearFromSrgb(v.b)};
}

}  // namespace rtsg
