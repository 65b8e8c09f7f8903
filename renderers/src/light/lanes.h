// What is done to the lanes of a SurfacePacket eight at a time.
//
// Threading: values.
#pragma once

#include "mesh/simd8.h"
#include "surface_packet.h"

namespace rtsg::trace {

inline simd::V8 loadV(const Lanes3& lanes, int at) {
    return {simd::load(lanes.x + at), simd::load(lanes.y + at), simd::load(lanes.z + at)};
}
inline void storeV(Lanes3& lanes, int at, const simd::V8& v) {
    simd::store(lanes.x + at, v.x), simd::store(lanes.y + at, v.y), simd::store(lanes.z + at, v.z);
}
inline simd::V8 broadcast(const Vec3f& v) {
    return {simd::all(v.x), simd::all(v.y), simd::all(v.z)};
}

/// All ones in the lanes of `mask` from `at` on.
inline simd::I8 lanesFrom(std::uint32_t mask, int at) {
    const auto bits = static_cast<std::int32_t>(mask >> at);
    const simd::I8 each{1, 2, 4, 8, 16, 32, 64, 128};
    return (each & bits) != 0;
}

/// The true surface's normal on the viewer's side.
inline simd::V8 facing8(const SurfacePacket& s, int at) {
    const simd::V8 n{simd::load(s.hits.normalX + at), simd::load(s.hits.normalY + at), simd::load(s.hits.normalZ + at)};
    return n * simd::select(lanesFrom(s.back, at), simd::all(-1), simd::all(1));
}

/// One representable number further in the direction of `step`, where that is not 0.
inline simd::F8 beyond(simd::F8 x, simd::F8 step) {
    using namespace simd;
    const I8 i = bits(x);
    // Away from zero counts up, towards zero down; zero itself goes to the least number of the step's sign.
    const I8 outwards = ((x > 0.0f) & (step > 0.0f)) | ((x < 0.0f) & (step < 0.0f));
    const I8 atZero = x == 0.0f;
    I8 moved = i + (outwards ? I8{} + 1 : I8{} - 1);
    const I8 least =
        (bits(step) & (I8{} + std::int32_t(0x80000000))) | 0x00800000;  // not denormal: Embree flushes those
    moved = atZero ? least : moved;
    return simd::select(step == 0.0f, x, fromBits(moved));
}

/// As RayView::leave. Precondition: findPoints().
inline simd::V8 leave8(const SurfacePacket& s, int at, const simd::V8& towards) {
    using namespace simd;
    const V8 n{load(s.hits.normalX + at), load(s.hits.normalY + at), load(s.hits.normalZ + at)}, e = loadV(s.error, at);
    const F8 far = absolute(n.x) * e.x + absolute(n.y) * e.y + absolute(n.z) * e.z;
    const V8 offset = n * simd::select(dot(towards, n) < 0.0f, -far, far);
    const V8 start = loadV(s.exact, at) + offset;
    return {beyond(start.x, offset.x), beyond(start.y, offset.y), beyond(start.z, offset.z)};
}

}  // namespace rtsg::trace
