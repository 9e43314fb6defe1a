// First rays of subpaths.
#pragma once

#include "transport/emitter/emission.h"
#include "transport/sensor/camera.h"
#include "transport/subpath/roulette.h"

namespace ambilux {

namespace detail {

template <class Mis>
AMBILUX_HD Subpath<Mis> first_ray(Vec3f origin, Vec3f direction, Rgb throughput) {
    Subpath<Mis> path{};
    path.origin = origin;
    path.direction = direction;
    path.throughput = throughput;
    path.depth = 1;
    path.roulette_scale = 1.0f;
    path.delta = true;
    return path;
}

}  // namespace detail

/// Eye subpath that begins with the camera ray `c`.
template <Features F, class Mis>
AMBILUX_HD Subpath<Mis> start_eye(const SceneView& scene, const Mis& mis, const CameraSample& c) {
    Subpath<Mis> path = detail::first_ray<Mis>(c.o, c.d, {1.0f, 1.0f, 1.0f});
    mis.template start_eye<F>(scene, c.d, path.sums, path.start);
    return path;
}

/// Light subpath that begins with the emission `e`.
template <class Mis>
AMBILUX_HD Subpath<Mis> start_light(const Mis& mis, const EmissionSample& e) {
    const float pdf = e.pick * e.pdf_pos * e.pdf_dir;
    Subpath<Mis> path = detail::first_ray<Mis>(e.prim == kNone ? e.p : offset_ray_origin(e.p, e.p_error, e.ng, e.d),
                                               e.d, e.radiance * (e.cos_theta / pdf));
    path.roulette_scale = light_roulette_scale(path.throughput);
    mis.start_light(e, path.start);
    return path;
}

/// The emission with which a light subpath begins. False if it carries no light.
template <Features F>
AMBILUX_HD bool sample_start(const SceneView& scene, const Draws& draws, EmissionSample& e) {
    const Vec4f direction = draws.emission_direction();
    return sample_emission<F>(scene, draws.emission_position(), {direction.x, direction.y}, e);
}

}  // namespace ambilux
