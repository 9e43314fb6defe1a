// How an emitter is picked for next event estimation. A sampler of lights is a type with
//   Pick                            the emitter of a pick, and `over_power`: its probability as a multiple of
//                                   Emitter::pick_probability, by which light subpaths begin
//                                   and, if the sampler spends more than u.x, the numbers `u` that are left
//   pick(view, receiver, u)         picks one with u.x in [0,1); y, z and w are for the sample on it
//   over_power(view, receiver, i, prim)   of emitter i, whoever found it; of an area emitter on primitive `prim`
// Receivers and sums by value: a reference to a part of a subpath cost nvcc 380 bytes of spills (core/hd.h).
// A model of weights names it (Mis::Lights), and Rules hold it.
#pragma once

#include "core/sampling.h"
#include "scene/view.h"

namespace ambilux {

/// The surface that a light is picked for.
struct Receiver {
    Vec3f p;
    Vec3f n;  ///< unit geometric normal, its sign without meaning; 0 where a ray tells no more than where it began
};

/// Where the ray with `sums` began at `p`. Sums that hold the normal there say so by receiver_normal().
template <class Sums>
AMBILUX_HD Receiver receiver_of_ray(Vec3f p, [[maybe_unused]] Sums sums) {
    if constexpr (requires { sums.receiver_normal(); })
        return {p, sums.receiver_normal()};
    else
        return {p, {0.0f, 0.0f, 0.0f}};
}

/// By power, whatever the receiver.
struct LightsByPower {
    char nothing[0];  ///< no size, as BsdfDirections

    struct Pick {
        static constexpr float over_power = 1.0f;
        uint32_t emitter;
    };
    AMBILUX_HD static Pick pick(const SceneView& view, Receiver, Vec4f u) {
        return {sample_cdf(view.emitter_cdf, view.emitter_count, u.x)};
    }
    AMBILUX_HD static constexpr float over_power(const SceneView&, Receiver, uint32_t, uint32_t) { return 1.0f; }
};

}  // namespace ambilux
