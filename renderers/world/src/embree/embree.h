// Embree 3 or 4, whichever was found, and one way to cast rays for both.
//
// Invariant: nothing else in this project names their versions; lanes that are not valid are never traced nor written.
// Threading: a RayCast is one thread's.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

#include <rtsg/core/machine.h>

#if RTSG_EMBREE >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace rtsg::bvh {

/// A device that uses no higher instruction sets than the kernels here, so that its packets are as wide as theirs. It
/// has all threads: one of fewer would take them from all else in the program.
inline RTCDevice newDevice() {
    const std::string highest = simd::isMaxInstructionSetKnown() ? simd::maxInstructionSetName() : "";
    return rtcNewDevice(highest.empty() ? nullptr : ("max_isa=" + highest).c_str());
}

/// The width of the widest packets that Embree traces natively on this machine: 16 with AVX-512, 8 with AVX, else 4.
/// Wider packets are streams in Embree 3, which know no valid lanes (the other lanes are traced, and may never end),
/// and single rays in Embree 4.
inline int packetWidth() {
    static const int answer = [] {
        const RTCDevice device = newDevice();
        const bool by16 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
        const bool by8 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
        rtcReleaseDevice(device);
        return by16 ? 16 : by8 ? 8 : 4;
    }();
    return answer;
}

// Packets of all widths are rows of four-byte values, one for each lane.
static_assert(offsetof(RTCRay4, tfar) == 8 * sizeof(float[4]) && offsetof(RTCRay16, tfar) == 8 * sizeof(float[16]));
static_assert(offsetof(RTCRay4, mask) == 9 * sizeof(float[4]) && offsetof(RTCRay16, mask) == 9 * sizeof(float[16]));
static_assert(offsetof(RTCRay4, id) == 10 * sizeof(float[4]) && offsetof(RTCRay16, id) == 10 * sizeof(float[16]));
static_assert(sizeof(RTCRay4) == 12 * sizeof(float[4]) && sizeof(RTCRay16) == 12 * sizeof(float[16]));

/// Traces those parts of a packet in which any lane is valid.
template <int kLanes, class Part, class Rays16, class Trace>
void traceParts(const int* valid, Rays16& rays, Trace trace) {
    constexpr std::size_t kPart = sizeof(float[kLanes]), kWhole = sizeof(float[16]), kRows = sizeof(Part) / kPart;
    constexpr std::size_t kTfar = 8, kId = 10, kHit = 12;
    static_assert(sizeof(Rays16) == kRows * kWhole);
    for (int first = 0; first < 16; first += kLanes, valid += kLanes) {
        int any = 0;
        for (int i = 0; i < kLanes; ++i) any |= valid[i];
        if (any == 0) continue;
        Part part;
        char* const wide = reinterpret_cast<char*>(&rays) + first * sizeof(float);
        char* const narrow = reinterpret_cast<char*>(&part);
        const auto take = [&](std::size_t row) { std::memcpy(narrow + row * kPart, wide + row * kWhole, kPart); };
        const auto give = [&](std::size_t row) { std::memcpy(wide + row * kWhole, narrow + row * kPart, kPart); };
        // Flags of rays are not read.
        for (std::size_t row = 0; row <= kId; ++row) take(row);
        for (std::size_t row = kHit; row < kRows; ++row) take(row);
        trace(valid, part);
        give(kTfar);
        for (std::size_t row = kHit; row < kRows; ++row) give(row);
    }
}

/// Whether coherent packets may be asked for occlusion. An Embree 4 that was built for AVX-512 by a GCC before 14 may
/// then loop for ever with packets of 16 (its pull request 574); in Debian's 3.13 the sets of lanes that it goes by are
/// whole.
constexpr bool kOccludesCoherently = RTSG_EMBREE < 4;

/// Scenes whose rays may be asked of each hit whether it counts.
#if RTSG_EMBREE >= 4
constexpr unsigned kAsksOfHits = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
#else
constexpr unsigned kAsksOfHits = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
#endif

/// The context that goes with the rays of several calls.
class RayCast {
  public:
    void intersect(RTCScene scene, RTCRayHit& ray) { trace(scene, ray); }
    void occluded(RTCScene scene, RTCRay& ray) { trace(scene, ray); }
    /// In packets of this machine's width.
    void intersect(const int* valid, RTCScene scene, RTCRayHit16& rays) {
        traceInWidth<RTCRayHit8, RTCRayHit4>(valid, scene, rays);
    }
    void occluded(const int* valid, RTCScene scene, RTCRay16& rays) {
        traceInWidth<RTCRay8, RTCRay4>(valid, scene, rays);
    }

    // Calls in the form that Embree takes; packets have packetWidth() lanes or fewer.
#if RTSG_EMBREE >= 4
    explicit RayCast(bool coherent) : flags_(coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT) {
        rtcInitRayQueryContext(&context_);
    }
    void trace(RTCScene scene, RTCRayHit& r) { rtcIntersect1(scene, &r, With<RTCIntersectArguments>(*this)); }
    void trace(RTCScene scene, RTCRay& r) { rtcOccluded1(scene, &r, With<RTCOccludedArguments>(*this)); }
    void trace(const int* v, RTCScene s, RTCRayHit16& r) {
        rtcIntersect16(v, s, &r, With<RTCIntersectArguments>(*this));
    }
    void trace(const int* v, RTCScene s, RTCRayHit8& r) { rtcIntersect8(v, s, &r, With<RTCIntersectArguments>(*this)); }
    void trace(const int* v, RTCScene s, RTCRayHit4& r) { rtcIntersect4(v, s, &r, With<RTCIntersectArguments>(*this)); }
    void trace(const int* v, RTCScene s, RTCRay16& r) { rtcOccluded16(v, s, &r, With<RTCOccludedArguments>(*this)); }
    void trace(const int* v, RTCScene s, RTCRay8& r) { rtcOccluded8(v, s, &r, With<RTCOccludedArguments>(*this)); }
    void trace(const int* v, RTCScene s, RTCRay4& r) { rtcOccluded4(v, s, &r, With<RTCOccludedArguments>(*this)); }
#else
    explicit RayCast(bool coherent) {
        rtcInitIntersectContext(&context_);
        context_.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    }
    void trace(RTCScene scene, RTCRayHit& r) { rtcIntersect1(scene, &context_, &r); }
    void trace(RTCScene scene, RTCRay& r) { rtcOccluded1(scene, &context_, &r); }
    void trace(const int* v, RTCScene s, RTCRayHit16& r) { rtcIntersect16(v, s, &context_, &r); }
    void trace(const int* v, RTCScene s, RTCRayHit8& r) { rtcIntersect8(v, s, &context_, &r); }
    void trace(const int* v, RTCScene s, RTCRayHit4& r) { rtcIntersect4(v, s, &context_, &r); }
    void trace(const int* v, RTCScene s, RTCRay16& r) { rtcOccluded16(v, s, &context_, &r); }
    void trace(const int* v, RTCScene s, RTCRay8& r) { rtcOccluded8(v, s, &context_, &r); }
    void trace(const int* v, RTCScene s, RTCRay4& r) { rtcOccluded4(v, s, &context_, &r); }
#endif
    /// From here on `filter` is asked of each hit whether it counts. told() gives it `what`.
    void ask(RTCFilterFunctionN filter, void* what) {
#if RTSG_EMBREE >= 4
        filter_ = filter;
#else
        context_.filter = filter;
#endif
        context_.what = what;
    }
    static void* contextOf(const RTCFilterFunctionNArguments& asked) {
        return static_cast<Context*>(asked.context)->what;
    }
    /// Sets the instance that Embree notes in the hits that it finds from now on.
    void setInstance(unsigned instance) { context_.instID[0] = instance; }

  private:
    template <class By8, class By4, class Rays16>
    void traceInWidth(const int* valid, RTCScene scene, Rays16& rays) {
        const auto part = [&](const int* lanes, auto& some) { trace(lanes, scene, some); };
        switch (packetWidth()) {
            case 16:
                return trace(valid, scene, rays);
            case 8:
                return traceParts<8, By8>(valid, rays, part);
            default:
                return traceParts<4, By4>(valid, rays, part);
        }
    }
#if RTSG_EMBREE >= 4
    /// The arguments of one call.
    template <class Arguments>
    struct With {
        explicit With(RayCast& cast) {
            if constexpr (std::is_same_v<Arguments, RTCIntersectArguments>)
                rtcInitIntersectArguments(&arguments);
            else
                rtcInitOccludedArguments(&arguments);
            arguments.flags = cast.flags_;
            arguments.feature_mask = RTC_FEATURE_FLAG_TRIANGLE;
            if (cast.filter_) {
                arguments.filter = cast.filter_;
                arguments.flags =
                    static_cast<RTCRayQueryFlags>(arguments.flags | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
                arguments.feature_mask = static_cast<RTCFeatureFlags>(RTC_FEATURE_FLAG_TRIANGLE |
                                                                      RTC_FEATURE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS);
            }
            arguments.context = &cast.context_;
        }
        operator Arguments*() { return &arguments; }
        Arguments arguments;
    };
    struct Context : RTCRayQueryContext {
        void* what = nullptr;
    };
    Context context_;
    RTCRayQueryFlags flags_;
    RTCFilterFunctionN filter_ = nullptr;
#else
    struct Context : RTCIntersectContext {
        void* what = nullptr;
    };
    Context context_;
#endif
};

}  // namespace rtsg::bvh
