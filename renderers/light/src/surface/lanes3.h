// Lanes3: three numbers for each of sixteen lanes.
//
// Threading: values.
#pragma once

#include <rtsg/core/value.h>

namespace rtsg::trace {

struct alignas(64) Lanes3 {
    float x[16], y[16], z[16];
    void set(int lane, const Vec3f& v) { x[lane] = v.x, y[lane] = v.y, z[lane] = v.z; }
    void add(int lane, const Vec3f& v) { x[lane] += v.x, y[lane] += v.y, z[lane] += v.z; }
    Vec3f get(int lane) const { return {x[lane], y[lane], z[lane]}; }
};

}  // namespace rtsg::trace
