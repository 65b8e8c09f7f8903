// The sRGB curve.
#include <rtsg/renderers/color.h>

#include <cmath>

namespace rtsg {

float srgbFromLinear(float linear) {
    if (linear > 1) return linear;
    return linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

float linearFromSrgb(float encoded) {
    if (encoded > 1) return encoded;
    return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

}  // namespace rtsg
