// First rays of subpaths.
#pragma once

#include "transport/emitter/emission.h"
#include "transport/sensor/camera.h"
#include "transport/sensor/filter.h"
#include "transport/subpath/camera_connection.h"
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

/// Camera ray through pixel (x,y) of the crop.
template <Features F, class Numbers>
AMBILUX_HD CameraSample camera_sample(const SceneView& scene, uint32_t x, uint32_t y, const Numbers& numbers) {
    const Vec4f u = numbers.camera();
    return sample_camera_ray<F>(scene.sensor, sample_film_position(scene, x, y, {u.x, u.y}), {u.z, u.w});
}

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

/// Eye subpath through pixel (x,y) of the crop. `tmax`: of its first ray.
template <Features F, class Mis>
AMBILUX_HD Subpath<Mis> start_eye_subpath(const SceneView& scene, const Mis& mis, uint32_t x, uint32_t y,
                                          const NumbersOf<Mis>& numbers, float& tmax) {
    const CameraSample c = camera_sample<F>(scene, x, y, numbers);
    tmax = c.tmax;
    return start_eye<F>(scene, mis, c);
}

/// Light subpath that begins with the emission `e`, which it draws. sink.valid(flux) may end it; sink.add(candidate) is
/// called where the camera sees the emitter itself: of a key's first light subpath. False if there is no first ray;
/// `path` is left alone if the emission carries no light.
template <Features F, class Mis, class Sink>
AMBILUX_HD bool start_light_subpath(const SceneView& scene, const Rules<Mis>& rules, const NumbersOf<Mis>& numbers,
                                    const Sink& sink, EmissionSample& e, Subpath<Mis>& path) {
    const Vec4f u = numbers.emission_direction();
    if (!sample_emission<F>(scene, numbers.emission_position(), {u.x, u.y}, e)) return false;
    path = start_light(rules.mis, e);
    if (!sink.valid(path.throughput)) return false;
    Candidate<Mis> c;
    if (numbers.number == 0 && visible_emitter<F>(scene, rules, e, {u.z, u.w}, c)) sink.add(c);
    return rules.max_depth >= 2;
}

}  // namespace ambilux
