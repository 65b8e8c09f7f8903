// Embree 3 or 4, whichever was found, and one way to cast rays for both.
//
// Invariant: nothing else in this project names their versions. Threading: a RayCast is one thread's.
#pragma once

#if RTSG_EMBREE >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace rtsg::bvh {

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
        rtcIntersect16(valid, scene, &rays, &arguments);
    }
    void occluded(const int* valid, RTCScene scene, RTCRay16& rays) {
        RTCOccludedArguments arguments = with<RTCOccludedArguments>(rtcInitOccludedArguments);
        rtcOccluded16(valid, scene, &rays, &arguments);
    }
#else
    explicit RayCast(bool coherent) {
        rtcInitIntersectContext(&context_);
        context_.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    }
    void intersect(RTCScene scene, RTCRayHit& ray) { rtcIntersect1(scene, &context_, &ray); }
    void occluded(RTCScene scene, RTCRay& ray) { rtcOccluded1(scene, &context_, &ray); }
    void intersect(const int* valid, RTCScene scene, RTCRayHit16& rays) {
        rtcIntersect16(valid, scene, &context_, &rays);
    }
    void occluded(const int* valid, RTCScene scene, RTCRay16& rays) { rtcOccluded16(valid, scene, &context_, &rays); }
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
