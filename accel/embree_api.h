// Embree 3 or 4, whichever is installed, behind the few names we use.
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace ambilux {

#if RTC_VERSION_MAJOR >= 4
using EmbreeQueryContext = RTCRayQueryContext;
inline void embree_init_context(EmbreeQueryContext* context) { rtcInitRayQueryContext(context); }
inline void embree_intersect(RTCScene scene, EmbreeQueryContext* context, RTCRayHit* ray) {
    RTCIntersectArguments args;
    rtcInitIntersectArguments(&args);
    args.context = context;
    rtcIntersect1(scene, ray, &args);
}
inline void embree_occluded(RTCScene scene, EmbreeQueryContext* context, RTCRay* ray) {
    RTCOccludedArguments args;
    rtcInitOccludedArguments(&args);
    args.context = context;
    rtcOccluded1(scene, ray, &args);
}
#else
using EmbreeQueryContext = RTCIntersectContext;
inline void embree_init_context(EmbreeQueryContext* context) { rtcInitIntersectContext(context); }
inline void embree_intersect(RTCScene scene, EmbreeQueryContext* context, RTCRayHit* ray) {
    rtcIntersect1(scene, context, ray);
}
inline void embree_occluded(RTCScene scene, EmbreeQueryContext* context, RTCRay* ray) {
    rtcOccluded1(scene, context, ray);
}
#endif

}  // namespace ambilux
