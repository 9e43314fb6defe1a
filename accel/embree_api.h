// Embree 3 or 4, whichever is installed, behind the few names we use.
#pragma once

#include <cstdint>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace ambilux {

#if RTC_VERSION_MAJOR >= 4
using EmbreeQueryContext = RTCRayQueryContext;
inline void embree_init_context(EmbreeQueryContext* context) { rtcInitRayQueryContext(context); }
inline RTCIntersectArguments embree_intersect_arguments(EmbreeQueryContext* context, bool coherent) {
    RTCIntersectArguments args;
    rtcInitIntersectArguments(&args);
    args.context = context;
    if (coherent) args.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    return args;
}
inline RTCOccludedArguments embree_occluded_arguments(EmbreeQueryContext* context, bool coherent) {
    RTCOccludedArguments args;
    rtcInitOccludedArguments(&args);
    args.context = context;
    if (coherent) args.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    return args;
}
inline void embree_intersect(RTCScene scene, EmbreeQueryContext* context, RTCRayHit* ray) {
    RTCIntersectArguments args = embree_intersect_arguments(context, false);
    rtcIntersect1(scene, ray, &args);
}
inline void embree_occluded(RTCScene scene, EmbreeQueryContext* context, RTCRay* ray) {
    RTCOccludedArguments args = embree_occluded_arguments(context, false);
    rtcOccluded1(scene, ray, &args);
}
#else
using EmbreeQueryContext = RTCIntersectContext;
inline void embree_init_context(EmbreeQueryContext* context) { rtcInitIntersectContext(context); }
inline void embree_set_coherent(EmbreeQueryContext* context, bool coherent) {
    context->flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
}
inline void embree_intersect(RTCScene scene, EmbreeQueryContext* context, RTCRayHit* ray) {
    rtcIntersect1(scene, context, ray);
}
inline void embree_occluded(RTCScene scene, EmbreeQueryContext* context, RTCRay* ray) {
    rtcOccluded1(scene, context, ray);
}
#endif

/// Packets of `kWidth` rays; valid[k] is -1 where there is one.
template <uint32_t kWidth>
struct EmbreePacket;

#if RTC_VERSION_MAJOR >= 4
#define AMBILUX_EMBREE_PACKET(N)                                                                            \
    template <>                                                                                             \
    struct EmbreePacket<N> {                                                                                \
        using Ray = RTCRay##N;                                                                              \
        using RayHit = RTCRayHit##N;                                                                        \
        static void intersect(const int* valid, RTCScene scene, EmbreeQueryContext* context, bool coherent, \
                              RayHit* rays) {                                                               \
            RTCIntersectArguments args = embree_intersect_arguments(context, coherent);                     \
            rtcIntersect##N(valid, scene, rays, &args);                                                     \
        }                                                                                                   \
        static void occluded(const int* valid, RTCScene scene, EmbreeQueryContext* context, bool coherent,  \
                             Ray* rays) {                                                                   \
            RTCOccludedArguments args = embree_occluded_arguments(context, coherent);                       \
            rtcOccluded##N(valid, scene, rays, &args);                                                      \
        }                                                                                                   \
    };
#else
#define AMBILUX_EMBREE_PACKET(N)                                                                            \
    template <>                                                                                             \
    struct EmbreePacket<N> {                                                                                \
        using Ray = RTCRay##N;                                                                              \
        using RayHit = RTCRayHit##N;                                                                        \
        static void intersect(const int* valid, RTCScene scene, EmbreeQueryContext* context, bool coherent, \
                              RayHit* rays) {                                                               \
            embree_set_coherent(context, coherent);                                                         \
            rtcIntersect##N(valid, scene, context, rays);                                                   \
        }                                                                                                   \
        static void occluded(const int* valid, RTCScene scene, EmbreeQueryContext* context, bool coherent,  \
                             Ray* rays) {                                                                   \
            embree_set_coherent(context, coherent);                                                         \
            rtcOccluded##N(valid, scene, context, rays);                                                    \
        }                                                                                                   \
    };
#endif
AMBILUX_EMBREE_PACKET(8)
AMBILUX_EMBREE_PACKET(16)
#undef AMBILUX_EMBREE_PACKET

}  // namespace ambilux
