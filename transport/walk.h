// Random walks from the camera and from emitters, vertex by vertex, with the sums that weight connections between them.
// Every bidirectional integrator and variant is made of these functions.
#pragma once

#include "core/rng.h"
#include "transport/bidirectional.h"
#include "transport/surface_scattering.h"

namespace ambilux {

/// A ray of a walk and what was gathered before it.
struct Walk {
    Vec3f o, d;
    Rgb throughput;        ///< eye: importance; light: flux. Everything up to and with the scattering into d
    MisSums sums;          ///< of the ray; unused on the first ray of a light walk
    LightStart start;      ///< first ray of a light walk
    float start_distance;  ///< first ray of an eye walk: from the camera to o
    uint32_t depth;        ///< segments, this one included
    float eta_scale;
    bool delta;  ///< the last scattering was a delta (true for first rays)
};

/// A surface point met by a walk.
struct WalkVertex {
    SurfacePoint point;  ///< of a vertex that comes from a queue: p and ng only
    float offset;        ///< ray_offset
    Scattering scattering;
    MisSums sums;
    bool first;  ///< met by the first ray of its walk
};

// ---- starting ----

/// First ray of an eye walk.
AMBILUX_HD Walk start_eye_walk(const SceneView& scene, const BidirectionalMis& mis, const CameraSample& c) {
    const Vec3f axis = scene.sensor.to_world.vector({0.0f, 0.0f, 1.0f});
    const float scale = length(axis), cos_camera = dot(c.d, axis) / scale;
    Walk w{};
    w.o = c.o;
    w.d = c.d;
    w.throughput = {1.0f, 1.0f, 1.0f};
    w.sums = camera_sums(mis, scene.sensor, cos_camera);
    w.start_distance = camera_delta_direction(scene.sensor) ? 0.0f : scene.sensor.near_clip * scale / cos_camera;
    w.depth = 1;
    w.eta_scale = 1.0f;
    w.delta = true;
    return w;
}

/// First ray of a light walk.
AMBILUX_HD Walk start_light_walk(const EmissionSample& e) {
    Walk w{};
    w.o = e.prim == kNone ? e.p : offset_ray_origin(e.p, e.p_error, e.ng, e.d);
    w.d = e.d;
    const float pdf = e.pick * e.pdf_pos * e.pdf_dir;
    w.throughput = e.radiance * (e.cos_theta / pdf);
    w.start = {1.0f / pdf, e.infinite ? e.pick * e.pdf_dir : e.cos_theta, e.prim, e.emitter};
    w.depth = 1;
    w.eta_scale = 1.0f;
    w.delta = true;
    return w;
}

// ---- vertices ----

/// Sums of an eye walk where its ray meets `point`.
AMBILUX_HD MisSums eye_sums(const SceneView& scene, const BidirectionalMis& mis, const Walk& w,
                            const SurfacePoint& point) {
    const bool first = w.depth == 1;
    float d2 = length_squared(point.p - w.o);
    if (first) d2 = sqr(sqrtf(d2) + w.start_distance);
    return sums_at_hit(mis, w.sums, d2, fabsf(dot(point.ng, w.d)), first && camera_delta_direction(scene.sensor));
}

/// Sums of a light walk where its ray meets `point`.
template <Features F>
AMBILUX_HD MisSums light_sums(const SceneView& scene, const BidirectionalMis& mis, const Walk& w,
                              const SurfacePoint& point) {
    const float cos_in = fabsf(dot(point.ng, w.d));
    if (w.depth == 1) return light_sums_at_first_hit<F>(scene, mis, w.start, w.o, w.d, point.p, cos_in);
    return sums_at_hit(mis, w.sums, length_squared(point.p - w.o), cos_in, false);
}

/// The vertex that a ray along `d`, the one numbered `depth` of a walk, meets at (prim,u,v), without its sums.
template <Features F>
AMBILUX_HD WalkVertex walk_vertex(const SceneView& scene, Vec3f d, uint32_t depth, uint32_t prim, float u, float v) {
    WalkVertex x;
    x.point = surface_at<F>(scene, prim, u, v);
    x.offset = ray_offset(x.point.p, x.point.p_error, x.point.ng);
    x.scattering = make_scattering<F>(scene, x.point, -d);
    x.first = depth == 1;
    return x;
}

template <Features F>
AMBILUX_HD WalkVertex eye_vertex(const SceneView& scene, const BidirectionalMis& mis, const Walk& w, uint32_t prim,
                                 float u, float v) {
    WalkVertex z = walk_vertex<F>(scene, w.d, w.depth, prim, u, v);
    z.sums = eye_sums(scene, mis, w, z.point);
    return z;
}

template <Features F>
AMBILUX_HD WalkVertex light_vertex(const SceneView& scene, const BidirectionalMis& mis, const Walk& w, uint32_t prim,
                                   float u, float v) {
    WalkVertex y = walk_vertex<F>(scene, w.d, w.depth, prim, u, v);
    y.sums = light_sums<F>(scene, mis, w, y.point);
    return y;
}

// ---- going on ----

/// Russian roulette of a walk; u uniform. It enters no density: every strategy's walks are thinned and repaid alike, so
/// that weights, which depend on the path alone, still sum to one.
AMBILUX_HD bool survives(Walk& w, float u) {
    const float survival = min(max_component(w.throughput) * sqr(w.eta_scale), 0.95f);
    if (!(u < survival)) return false;
    w.throughput = w.throughput / survival;
    return true;
}

/// Density of the way back over a delta, as a multiple of that of the way there. Fresnel terms are symmetric, but a
/// delta function of the direction on one side counts otherwise as one of the direction on the other: refraction
/// spreads solid angles by n_i² cos_i / (n_o² cos_o). `eta`: of the sample, n_o / n_i.
AMBILUX_HD float delta_reverse_pdf(const Scattering& s, Vec3f wo, float eta) {
    if (eta == 1.0f) return 1.0f;
    // Never 0 by rounding, where a walk leaves along the surface.
    return fabsf(s.wi.z) / (max(fabsf(dot(s.frame.n, wo)), 1e-7f) * sqr(eta));
}

/// The next ray of the walk `w` that met `vertex`; u.xyz scatter, u.w is for Russian roulette from `rr_depth` segments
/// on. False when the walk ends.
template <Features F>
AMBILUX_HD bool scatter_walk(const BidirectionalMis& mis, const WalkVertex& vertex, Vec4f u, TransportMode mode,
                             uint32_t rr_depth, Walk& w) {
    ScatterSample s;
    if (!scatter_sample<F>(vertex.scattering, {u.x, u.y, u.z}, mode, s)) return false;
    const Rgb throughput = w.throughput * s.weight;
    if (is_zero(throughput)) return false;
    const bool delta = s.flags & kScatterDelta;
    const float forward = delta ? 1.0f : s.pdf_sa;
    const float reverse = delta ? delta_reverse_pdf(vertex.scattering, s.wo, s.eta) : s.pdf_reverse_sa;
    w.sums =
        sums_after_scatter(mis, vertex.sums, vertex.first, delta, forward, reverse, fabsf(dot(vertex.point.ng, s.wo)));
    w.o = offset_ray_origin(vertex.point.p, vertex.offset, vertex.point.ng, s.wo);
    w.d = s.wo;
    w.throughput = throughput;
    // Sixteen bits, which is what queues keep: every variant then takes the same decisions.
    if (mode == TransportMode::radiance) w.eta_scale = bits_float(float_bits(w.eta_scale * s.eta) & 0xffff0000u);
    w.delta = delta;
    const uint32_t met = w.depth++;
    return met < rr_depth || survives(w, u.w);
}

// ---- contributions of strategies: value before visibility, and the sum of the other strategies' densities over this
// one's ----

/// A contribution and the ray that must be free for it.
struct WalkConnection {
    Rgb value;
    float others;  ///< weight = 1 / (1 + others)
    Vec3f o, d;
    float tmax;
};

/// True if the point that lies `to` from `x` lies in the plane of its surface, as far as positions are known: no higher
/// than where rays begin. Such points exchange no light.
AMBILUX_HD bool in_plane(const WalkVertex& x, Vec3f to) { return fabsf(dot(x.point.ng, to)) <= x.offset; }

/// Sets the ray from `from` to the point `to`, both ends moved off their surfaces. False if nothing lies between them.
AMBILUX_HD bool set_segment(WalkConnection& c, const WalkVertex& from, Vec3f wi, Vec3f to, float to_offset,
                            Vec3f to_ng) {
    c.o = offset_ray_origin(from.point.p, from.offset, from.point.ng, wi);
    const Vec3f segment = offset_ray_origin(to, to_offset, to_ng, -wi) - c.o;
    const float distance = length(segment);
    if (!(distance > 0.0f)) return false;
    c.d = segment / distance;
    c.tmax = distance * (1.0f - gamma_bound(8));
    return true;
}

/// s = 1: vertex z of an eye walk with throughput `throughput` samples an emitter with `u`. False when that gives
/// nothing. `environment`: the value is to be multiplied by environment_radiance from c.d, which is worth a look only
/// if the ray turns out to be free.
template <Features F>
AMBILUX_HD bool connect_next_event_deferred(const SceneView& scene, const BidirectionalMis& mis, const WalkVertex& z,
                                            Rgb throughput, Vec4f u, WalkConnection& c, bool& environment) {
    EmitterSample light;
    if (!sample_emitter_deferred<F>(scene, z.point.p, u, light) || !may_scatter(z.scattering, light.wi)) return false;
    const BsdfValue f = scatter_evaluate<F>(z.scattering, light.wi, TransportMode::radiance);
    if (is_zero(f.value)) return false;
    environment = is_environment<F>(scene, light.emitter);
    c.value = throughput * f.value * ((environment ? splat(1.0f) : light.radiance) / light.pdf_sa);
    c.others = others_of_next_event<F>(scene, mis, z.sums, z.first, light, f.pdf_sa, f.pdf_reverse_sa,
                                       fabsf(dot(z.point.ng, light.wi)));
    if (light.distance < kInfinity)
        return set_segment(c, z, light.wi, light.p, ray_offset(light.p, light.p_error, light.ng), light.ng);
    c.o = offset_ray_origin(z.point.p, z.offset, z.point.ng, light.wi);
    c.d = light.wi;
    c.tmax = kInfinity;
    return true;
}
/// The same with the environment's radiance.
template <Features F>
AMBILUX_HD bool connect_next_event(const SceneView& scene, const BidirectionalMis& mis, const WalkVertex& z,
                                   Rgb throughput, Vec4f u, WalkConnection& c) {
    bool environment = false;
    if (!connect_next_event_deferred<F>(scene, mis, z, throughput, u, c, environment)) return false;
    if (environment) c.value *= environment_radiance<F>(scene, c.d);
    return true;
}

/// False if no light can pass between two vertices, told from places and types of BSDFs: most pairs in a room face away
/// from each other.
AMBILUX_HD bool may_connect(const WalkVertex& y, const WalkVertex& z) {
    const Vec3f w = z.point.p - y.point.p;
    return may_scatter(y.scattering, w) && may_scatter(z.scattering, -w) && !in_plane(z, w);
}

/// Densities along the segment between a light vertex y and an eye vertex z, and of the directions back along their
/// walks (equation 7).
struct ConnectionDensities {
    float y_area, y_reverse_sa;  ///< of y by sampling at z; of the way back from y
    float z_area, z_reverse_sa;
};

/// The sum of the strategies that would have sampled both ends otherwise, in multiples of the density of one pair of
/// walks.
AMBILUX_HD float others_of_connection(const BidirectionalMis& mis, MisSums y, bool y_first, MisSums z, bool z_first,
                                      const ConnectionDensities& p) {
    return others_behind(mis, y, y_first, p.y_area, p.y_reverse_sa) +
           others_behind(mis, z, z_first, p.z_area, p.z_reverse_sa);
}

/// s >= 2, t >= 2: vertex y of a light walk and vertex z of an eye walk, but for the weight.
template <Features F>
AMBILUX_HD bool connect_unweighted(const WalkVertex& y, Rgb y_throughput, const WalkVertex& z, Rgb z_throughput,
                                   WalkConnection& c, ConnectionDensities& p) {
    const Vec3f to_y = y.point.p - z.point.p;
    const float d2 = length_squared(to_y);
    if (!(d2 > 0.0f) || !may_connect(y, z)) return false;
    const Vec3f w = to_y * inverse_sqrt(d2);
    const BsdfValue f_z = scatter_evaluate<F>(z.scattering, w, TransportMode::radiance);
    if (is_zero(f_z.value)) return false;
    const BsdfValue f_y = scatter_evaluate<F>(y.scattering, -w, TransportMode::importance);
    if (is_zero(f_y.value)) return false;
    c.value = y_throughput * f_y.value * f_z.value * z_throughput * (1.0f / d2);
    const float cos_y = fabsf(dot(y.point.ng, w)), cos_z = fabsf(dot(z.point.ng, w));
    p = {f_z.pdf_sa * cos_y / d2, f_y.pdf_reverse_sa, f_y.pdf_sa * cos_z / d2, f_z.pdf_reverse_sa};
    return set_segment(c, z, w, y.point.p, y.offset, y.point.ng);
}

/// s >= 2, t >= 2: vertex y of a light walk and vertex z of an eye walk.
template <Features F>
AMBILUX_HD bool connect_vertices(const BidirectionalMis& mis, const WalkVertex& y, Rgb y_throughput,
                                 const WalkVertex& z, Rgb z_throughput, WalkConnection& c) {
    ConnectionDensities p;
    if (!connect_unweighted<F>(y, y_throughput, z, z_throughput, c, p)) return false;
    c.others = others_of_connection(mis, y.sums, y.first, z.sums, z.first, p) / mis.connection_term();
    return true;
}

/// False for places on the film that no filter of a pixel reaches: what lands there needs no shadow ray.
AMBILUX_HD bool reaches_pixels(const Sensor& sensor, Vec2f film) {
    const float x = film.x - float(sensor.crop_x), y = film.y - float(sensor.crop_y),
                beyond = sensor.filter_radius - 0.5f;
    return x >= -beyond && x <= float(sensor.crop_width) + beyond && y >= -beyond &&
           y <= float(sensor.crop_height) + beyond;
}

/// t = 1: vertex y of a light walk and the camera. `value` is what the light walk adds to a pixel where the filter has
/// value 1 at `film_position`, over the number of light walks per pixel's sample.
template <Features F>
AMBILUX_HD bool connect_camera(const SceneView& scene, const BidirectionalMis& mis, const WalkVertex& y, Rgb throughput,
                               Vec2f lens_u, WalkConnection& c, Vec2f& film_position) {
    CameraConnection camera;
    if (!connect_to_camera(scene.sensor, y.point.p, lens_u, camera) ||
        !reaches_pixels(scene.sensor, camera.film_position))
        return false;
    const BsdfValue f = scatter_evaluate<F>(y.scattering, camera.wi, TransportMode::importance);
    if (is_zero(f.value)) return false;
    c.value = throughput * f.value * (camera.weight / mis.light_walks);
    c.others =
        others_of_camera(scene, mis, y.sums, y.first, camera, fabsf(dot(y.point.ng, camera.wi)), f.pdf_reverse_sa);
    film_position = camera.film_position;
    c.o = offset_ray_origin(y.point.p, y.offset, y.point.ng, camera.wi);
    c.d = camera.wi;
    c.tmax = camera.distance * (1.0f - gamma_bound(8));
    return c.tmax > 0.0f;
}

/// (1,1): the start of a light walk on an area emitter, seen by the camera. No other emitter has it: deltas are seen by
/// nobody and the environment is left to eye walks.
template <Features F>
AMBILUX_HD bool connect_visible_light(const SceneView& scene, const BidirectionalMis& mis, const EmissionSample& e,
                                      Vec2f lens_u, WalkConnection& c, Vec2f& film_position) {
    if (e.prim == kNone) return false;
    CameraConnection camera;
    if (!connect_to_camera(scene.sensor, e.p, lens_u, camera) || !reaches_pixels(scene.sensor, camera.film_position))
        return false;
    const float cos_light = dot(e.ng, camera.wi), pdf_pos = e.pick * e.pdf_pos;
    if (!(cos_light > 0.0f)) return false;
    c.value = e.radiance * (cos_light * camera.weight / (pdf_pos * mis.light_walks));
    c.others = others_of_visible_light(scene, mis, camera, cos_light, pdf_pos);
    film_position = camera.film_position;
    c.o = offset_ray_origin(e.p, e.p_error, e.ng, camera.wi);
    c.d = camera.wi;
    c.tmax = camera.distance * (1.0f - gamma_bound(8));
    return c.tmax > 0.0f;
}

}  // namespace ambilux
