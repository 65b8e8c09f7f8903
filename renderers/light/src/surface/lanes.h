// Works on the lanes of a SurfacePacket, eight at a time.
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

/// Does what RayView::leave does, from places with these normals and error bounds.
inline simd::V8 leaveFrom(const simd::V8& normal, const simd::V8& exact, const simd::V8& error,
                          const simd::V8& towards) {
    using namespace simd;
    const F8 far = absolute(normal.x) * error.x + absolute(normal.y) * error.y + absolute(normal.z) * error.z;
    const V8 offset = normal * simd::select(dot(towards, normal) < 0.0f, -far, far);
    const V8 start = exact + offset;
    const auto beyond = [](F8 x, F8 step) { return lanes::beyond<F8, I8>(x, step); };
    return {beyond(start.x, offset.x), beyond(start.y, offset.y), beyond(start.z, offset.z)};
}
/// The same of a packet. Precondition: findPoints().
inline simd::V8 leave8(const SurfacePacket& s, int at, const simd::V8& towards) {
    const simd::V8 n{simd::load(s.hits.normalX + at), simd::load(s.hits.normalY + at), simd::load(s.hits.normalZ + at)};
    return leaveFrom(n, loadV(s.exact, at), loadV(s.error, at), towards);
}

}  // namespace rtsg::trace
