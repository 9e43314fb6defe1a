// t = 1: light vertices, and emitters themselves, are connected with the camera.
#pragma once

#include "transport/sensor/importance.h"
#include "transport/subpath/bsdf_directions.h"
#include "transport/subpath/rules.h"
#include "transport/subpath/vertex.h"

namespace ambilux {

namespace detail {

AMBILUX_HD bool reaches_crop(const Sensor& sensor, Vec2f film) {
    const float x = film.x - float(sensor.crop_x), y = film.y - float(sensor.crop_y);
    const float beyond = sensor.filter_radius - 0.5f;
    return x >= -beyond && x <= float(sensor.crop_width) + beyond && y >= -beyond &&
           y <= float(sensor.crop_height) + beyond;
}

}  // namespace detail

/// False for places on the film that no filter of a pixel reaches: what lands there needs no shadow ray.
template <Features F>
AMBILUX_HD bool reaches_pixels(const Sensor& sensor, Vec2f film) {
    if constexpr (!F.latlong) return detail::reaches_crop(sensor, film);
    bool reached = false;
    for_each_film_position<F>(sensor, film, [&](Vec2f at) { reached |= detail::reaches_crop(sensor, at); });
    return reached;
}

namespace detail {

template <class Mis>
AMBILUX_HD bool set_camera_segment(Candidate<Mis>& c, const CameraConnection& camera, Vec3f origin) {
    c.film = camera.film_position;
    c.origin = origin;
    c.direction = camera.wi;
    c.tmax = camera.distance * (1.0f - gamma_bound(8));
    c.environment = false;
    return c.tmax > 0.0f && !is_zero(c.value);
}

}  // namespace detail

/// The vertex `y` of a light subpath of `depth` segments and the camera. The value is what the light subpath adds to a
/// pixel where the filter has value 1, over the number of light subpaths per sample of a pixel.
template <Features F, class Mis>
AMBILUX_HD bool camera_connection(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& y, Rgb throughput,
                                  uint32_t depth, Vec2f lens_u, Candidate<Mis>& c) {
    CameraConnection camera;
    if (!rules.splat || !rules.wants(depth + 1, 1)) return false;
    if (!connect_to_camera<F>(scene.sensor, y.point.p, lens_u, camera) ||
        !reaches_pixels<F>(scene.sensor, camera.film_position))
        return false;
    const BsdfValue f = rules.directions.template evaluate<F>(y, camera.wi, TransportMode::importance);
    if (is_zero(f.value)) return false;
    c.value = throughput * f.value * (camera.weight / rules.mis.light_subpaths);
    const float cos_y = fabsf(dot(y.point.ng, camera.wi));
    c.ratio =
        rules.counted(rules.mis.template camera_ratio<F>(scene, y.sums, y.first, camera, cos_y, f.pdf_reverse_sa));
    c.strategy = Strategy::make(depth + 1, 1);
    return detail::set_camera_segment(c, camera, offset_ray_origin(y.point.p, y.offset, y.point.ng, camera.wi));
}

/// (1,1): the start of a light subpath on an area emitter, seen by the camera. No other emitter has it: deltas are seen
/// by nobody and the environment is left to eye subpaths.
template <Features F, class Mis>
AMBILUX_HD bool visible_emitter(const SceneView& scene, const Rules<Mis>& rules, const EmissionSample& e, Vec2f lens_u,
                                Candidate<Mis>& c) {
    CameraConnection camera;
    if (!rules.splat || rules.hide_emitters || !rules.wants(1, 1) || e.prim == kNone) return false;
    if (!connect_to_camera<F>(scene.sensor, e.p, lens_u, camera) ||
        !reaches_pixels<F>(scene.sensor, camera.film_position))
        return false;
    const float cos_light = dot(e.ng, camera.wi), pdf_pos = e.pick * e.pdf_pos;
    if (!(cos_light > 0.0f)) return false;
    c.value = e.radiance * (cos_light * camera.weight / (pdf_pos * rules.mis.light_subpaths));
    c.ratio = rules.counted(rules.mis.template visible_emitter_ratio<F>(scene, camera, cos_light, pdf_pos, e.opacity));
    c.strategy = Strategy::make(1, 1);
    return detail::set_camera_segment(c, camera, offset_ray_origin(e.p, e.p_error, e.ng, camera.wi));
}

}  // namespace ambilux
