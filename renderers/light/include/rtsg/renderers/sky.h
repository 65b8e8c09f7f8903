// Sky: the colours where a picture's rays hit nothing.
//
// Threading: plain data, const members are re-entrant. Source: ISO/IEC 19775-1 V4.0 24.2.1, 24.3.1 (backgrounds).
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <rtsg/core/value.h>
#include <rtsg/renderers/color.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

/// The bound Background or TextureBackground; black if it has no colours.
struct Sky {
    std::vector<Vec3f> skyColors{Vec3f(0)}, groundColors;
    /// Radians from the zenith, from the nadir, ascending; one less than colours.
    std::vector<float> skyAngles, groundAngles;
    float alpha = 1;  // 1 - transparency
    /// Front, back, left, right, top and bottom of the panorama; null for a side without a picture.
    std::array<std::shared_ptr<const Texture>, 6> panorama;
    glm::mat3 localFromWorld{1.0f};  // only its rotation is used (24.2.1)

    /// The premultiplied colour and the coverage in a unit direction in world space. The fields hold display values and
    /// are mixed as display values; `space` (linear or display) is that of the result.
    Vec4f color(const Vec3f& direction, ColorSpace space = ColorSpace::display) const;
    /// Whether all directions have the same colour.
    bool uniform() const;
    /// Pictures are compared by address.
    friend bool operator==(const Sky&, const Sky&) = default;
};

}  // namespace rtsg
