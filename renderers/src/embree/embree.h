// Embree 3 or 4, whichever was found, and one way to cast rays for both.
//
// Invariant: nothing else in this project names their versions; lanes that are not valid are never traced nor written.
// Threading: a RayCast is one thread's.
#pragma once

#include <cstring>

#if RTSG_EMBREE >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace rtsg::bvh {

/// Whether Embree has packets of 16 rays on this machine; it needs AVX-512. Where it has none, Embree 3 takes such a
/// packet as a stream, which knows of no valid lanes (what lies in the others is traced, and may never end), and Embree
/// 4 takes one ray after the other. Packets of 8 it has wherever this program runs.
inline bool hasPacketsOf16() {
    static const bool answer = [] {
        const RTCDevice device = rtcNewDevice("threads=1");
        const bool native = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
        rtcReleaseDevice(device);
        return native;
    }();
    return answer;
}

/// Half of a packet of 16 rays, in the layout of those of 8: both are rows of four-byte values, one for each lane.
template <class Rays16, class Rays8>
class HalfPacket {
  public:
    HalfPacket(Rays16& rays, int half) : rays_(reinterpret_cast<char*>(&rays) + half * kHalfRow) {
        static_assert(sizeof(Rays16) == 2 * sizeof(Rays8));
        for (std::size_t i = 0; i < kRows; ++i) std::memcpy(row(i), rays_ + i * 2 * kHalfRow, kHalfRow);
    }
    ~HalfPacket() {
        for (std::size_t i = 0; i < kRows; ++i) std::memcpy(rays_ + i * 2 * kHalfRow, row(i), kHalfRow);
    }
    HalfPacket(const HalfPacket&) = delete;
    HalfPacket& operator=(const HalfPacket&) = delete;
    Rays8& operator*() { return half_; }

  private:
    static constexpr std::size_t kHalfRow = 8 * sizeof(float), kRows = sizeof(Rays8) / kHalfRow;
    char* row(std::size_t i) { return reinterpret_cast<char*>(&half_) + i * kHalfRow; }
    char* rays_;
    Rays8 half_;
};

/// Traces the halves of a packet in which any lane is valid.
template <class Rays8, class Rays16, class Trace>
void traceHalves(const int* valid, Rays16& rays, Trace trace) {
    for (int half = 0; half < 2; ++half, valid += 8) {
        int any = 0;
        for (int i = 0; i < 8; ++i) any |= valid[i];
        if (any == 0) continue;
        HalfPacket<Rays16, Rays8> packet(rays, half);
        trace(valid, *packet);
    }
}

/// What goes with the rays of one call after the other.
class RayCast {
  public:
#if RTSG_EMBREE >= 4
    explicit RayCast(bool coherent) : flags_(coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT) {
        rtcInitRayQueryContext(&context_);
    }
    void intersect(RTCScene scene, RTCRayHit& ray) {
        RTCIntersectArguments arguments = with<RTCIntersectArguments>(rtcInitIntersectArguments);
        rtcIntersect1(scene, &ray, &arguments);
    }
    void occluded(RTCScene scene, RTCRay& ray) {
        RTCOccludedArguments arguments = with<RTCOccludedArguments>(rtcInitOccludedArguments);
        rtcOccluded1(scene, &ray, &arguments);
    }
    void intersect(const int* valid, RTCScene scene, RTCRayHit16& rays) {
        RTCIntersectArguments arguments = with<RTCIntersectArguments>(rtcInitIntersectArguments);
        if (hasPacketsOf16()) return rtcIntersect16(valid, scene, &rays, &arguments);
        traceHalves<RTCRayHit8>(valid, rays,
                                [&](const int* lanes, RTCRayHit8& r) { rtcIntersect8(lanes, scene, &r, &arguments); });
    }
    void occluded(const int* valid, RTCScene scene, RTCRay16& rays) {
        RTCOccludedArguments arguments = with<RTCOccludedArguments>(rtcInitOccludedArguments);
        if (hasPacketsOf16()) return rtcOccluded16(valid, scene, &rays, &arguments);
        traceHalves<RTCRay8>(valid, rays,
                             [&](const int* lanes, RTCRay8& r) { rtcOccluded8(lanes, scene, &r, &arguments); });
    }
#else
    explicit RayCast(bool coherent) {
        rtcInitIntersectContext(&context_);
        context_.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    }
    void intersect(RTCScene scene, RTCRayHit& ray) { rtcIntersect1(scene, &context_, &ray); }
    void occluded(RTCScene scene, RTCRay& ray) { rtcOccluded1(scene, &context_, &ray); }
    void intersect(const int* valid, RTCScene scene, RTCRayHit16& rays) {
        if (hasPacketsOf16()) return rtcIntersect16(valid, scene, &context_, &rays);
        traceHalves<RTCRayHit8>(valid, rays,
                                [&](const int* lanes, RTCRayHit8& r) { rtcIntersect8(lanes, scene, &context_, &r); });
    }
    void occluded(const int* valid, RTCScene scene, RTCRay16& rays) {
        if (hasPacketsOf16()) return rtcOccluded16(valid, scene, &context_, &rays);
        traceHalves<RTCRay8>(valid, rays,
                             [&](const int* lanes, RTCRay8& r) { rtcOccluded8(lanes, scene, &context_, &r); });
    }
#endif
    /// What Embree notes as instance in the hits that it finds from here on.
    void setInstance(unsigned instance) { context_.instID[0] = instance; }

  private:
#if RTSG_EMBREE >= 4
    template <class Arguments>
    Arguments with(void (*initialize)(Arguments*)) {
        Arguments arguments;
        initialize(&arguments);
        arguments.flags = flags_;
        arguments.feature_mask = RTC_FEATURE_FLAG_TRIANGLE;
        arguments.context = &context_;
        return arguments;
    }
    RTCRayQueryContext context_;
    RTCRayQueryFlags flags_;
#else
    RTCIntersectContext context_;
#endif
};

}  // namespace rtsg::bvh
