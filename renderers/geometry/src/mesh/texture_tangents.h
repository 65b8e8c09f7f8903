// The tangent space of texture coordinates that change linearly.
//
// Threading: a function of its arguments.
#pragma once

#include <array>
#include <cmath>

#include <rtsg/core/value.h>

namespace rtsg {

/// How position changes with (s, t), where on two ways position changes by `along`, and (s, t) by `st`. False when the
/// mapping is singular.
inline bool textureTangents(const std::array<Vec3f, 2>& along, const std::array<Vec2f, 2>& st, Vec3f& dPds,
                            Vec3f& dPdt) {
    const float determinant = st[0].x * st[1].y - st[0].y * st[1].x;
    if (!(std::abs(determinant) > 1e-20f)) return false;
    const float inverse = 1.0f / determinant;
    dPds = (st[1].y * along[0] - st[0].y * along[1]) * inverse;
    dPdt = (st[0].x * along[1] - st[1].x * along[0]) * inverse;
    return true;
}

}  // namespace rtsg
