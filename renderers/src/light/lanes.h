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

/// As RayView::leave. Precondition: findPoints().
inline simd::V8 leave8(const SurfacePacket& s, int at, const simd::V8& towards) {
    using namespace simd;
    const V8 n{load(s.hits.normalX + at), load(s.hits.normalY + at), load(s.hits.normalZ + at)}, e = loadV(s.error, at);
    const F8 far = absolute(n.x) * e.x + absolute(n.y) * e.y + absolute(n.z) * e.z;
    const V8 offset = n * simd::select(dot(towards, n) < 0.0f, -far, far);
    const V8 start = loadV(s.exact, at) + offset;
    const auto beyond = [](F8 x, F8 step) { return lanes::beyond<F8, I8>(x, step); };
    return {beyond(start.x, offset.x), beyond(start.y, offset.y), beyond(start.z, offset.z)};
}

}  // namespace rtsg::trace
