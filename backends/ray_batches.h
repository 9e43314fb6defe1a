// The rays that `bench rays` traces: primary, bounced and shadow rays of the paths of one image, rays to its emitters
// and from them.
#pragma once

#include <string>
#include <vector>

#include "core/parallel.h"
#include "core/rng.h"
#include "core/sampling.h"
#include "scene/primitive_bounds.h"
#include "scene/surface.h"
#include "transport/emitter.h"
#include "transport/emitter/emission.h"
#include "transport/sensor/camera.h"

namespace ambilux {

struct RayBatch {
    std::string name;
    bool any_hit;   ///< asks whether something is in the way, not for the nearest hit
    bool coherent;  ///< neighbours in the array stay together in the scene
    std::vector<Ray> rays;
};

namespace detail {

/// Calls f(i) for 0 <= i < count on all threads.
template <class Function>
void for_all(size_t count, Function f) {
    parallel_for(count, f, size_t(1024));
}

/// Every second bit of a Morton code, gathered.
inline uint32_t even_bits(uint32_t code) {
    uint32_t x = 0;
    for (uint32_t bit = 0; bit < 16; ++bit) x |= (code >> (2 * bit) & 1u) << bit;
    return x;
}

/// Length of the diagonal of the box around all primitives; 0 for an empty scene.
inline float scene_diagonal(const SceneView& scene) {
    Bounds3f bounds;
    for (uint32_t i = 0; i < scene.ungrouped_count(); ++i) bounds.extend(triangle_bounds(scene, i));
    for (uint32_t i = 0; i < scene.instance_count; ++i) bounds.extend(instance_bounds(scene, scene.instances[i]));
    for (uint32_t i = 0; i < scene.quadric_count; ++i) bounds.extend(quadric_bounds(scene.quadrics[i]));
    return bounds.empty() ? 0.0f : length(bounds.upper - bounds.lower);
}

/// Point that a path met, moved off the surface, with the geometric normal on the side that the path came from.
struct BouncePoint {
    Vec3f p, n;
    uint32_t path;
};

/// Segment between two points of different paths, drawn again up to 16 times until each lies in front of the other. A
/// pair that is still not, stays.
inline Ray shadow_ray(const std::vector<BouncePoint>& points, RngKey key) {
    BouncePoint a = {}, b = {};
    for (uint32_t block = 0; block < 16; ++block) {
        const Uint4 bits = random_bits(key, block);
        a = points[mul_hi(bits.x, uint32_t(points.size()))];
        b = points[mul_hi(bits.y, uint32_t(points.size()))];
        const Vec3f d = b.p - a.p;
        if (a.path != b.path && dot(a.n, d) > 0.0f && dot(b.n, d) < 0.0f) break;
    }
    const Vec3f d = b.p - a.p;
    const float distance = length(d);
    if (!(distance > 0.0f)) return {a.p, 0.0f, a.n, 0};  // hits nothing
    return {a.p, 0.9999f * distance, d * (1.0f / distance), key.index};
}

/// Next event estimation at `point`: a segment to a sampled point of an emitter, or without end towards the
/// environment. False if no light comes that way.
inline bool ray_to_emitter(const SceneView& scene, const BouncePoint& point, RngKey key, float offset, Ray& ray) {
    EmitterSample light;
    if (!sample_emitter_deferred<kAllFeatures>(scene, point.p, random_floats(key, 0), light) ||
        !(dot(point.n, light.wi) > 0.0f))
        return false;
    ray = {point.p, kInfinity, light.wi, random_bits(key, 1).x};
    if (light.distance < kInfinity) ray.tmax = light.distance - offset;
    return ray.tmax > 0.0f;
}

/// Points that rays meet; is_hit[i] tells whether ray i did. Points lie `offset` off the surface.
template <Features F, class Tracer>
std::vector<BouncePoint> trace_points(const SceneView& scene, const Tracer& tracer, const std::vector<Ray>& rays,
                                      const std::vector<uint32_t>& path_of, float offset) {
    std::vector<BouncePoint> met(rays.size());
    std::vector<uint8_t> is_hit(rays.size());
    for_all(rays.size(), [&](size_t i) {
        Hit hit;
        is_hit[i] = tracer.template closest<F>(scene, rays[i], hit);
        if (!is_hit[i]) return;
        const SurfacePoint s = surface_at<F>(scene, hit.prim, hit.u, hit.v);
        const Vec3f n = dot(s.ng, rays[i].d) > 0.0f ? -s.ng : s.ng;
        met[i] = {s.p + n * offset, n, path_of[i]};
    });
    size_t count = 0;
    for (size_t i = 0; i < met.size(); ++i)
        if (is_hit[i]) met[count++] = met[i];
    met.resize(count);
    return met;
}

/// Cosine-weighted around the normal.
inline Ray bounced_ray(const BouncePoint& point, RngKey key) {
    const Vec4f u = random_floats(key, 0);
    return {point.p, kInfinity, normalize(frame_from_normal(point.n).to_world(square_to_cosine_hemisphere({u.x, u.y}))),
            random_bits(key, 1).x};
}

/// Rays, and the path of each.
struct PathRays {
    std::vector<Ray> rays;
    std::vector<uint32_t> path_of;

    void resize(size_t count) {
        rays.resize(count);
        path_of.resize(count);
    }
};

/// Numbers of samples: below them are those of the bounces.
constexpr uint32_t kShadowSample = 1000, kEmitterSample[2] = {1001, 1004}, kEmissionSample = 1002,
                   kLightBounceSample = 1003;

struct BatchKeys {
    uint64_t seed;
    RngKey operator()(uint32_t path, uint32_t sample) const { return {seed, path, sample, Stream::bench}; }
};

/// Jittered, through size x size pixels in Morton order.
inline PathRays camera_rays(const SceneView& scene, uint32_t size, BatchKeys key) {
    Sensor sensor = scene.sensor;
    sensor.film_width = sensor.film_height = size;
    sensor.tan_half_fov.y = sensor.tan_half_fov.x;
    PathRays camera;
    camera.resize(size_t(size) * size);
    for_all(camera.rays.size(), [&](size_t i) {
        const uint32_t path = uint32_t(i);
        const Vec4f u = random_floats(key(path, 0), 0);
        const float x = float(even_bits(path)) + u.x, y = float(even_bits(path >> 1)) + u.y;
        const CameraSample sample = sample_camera_ray<kAllFeatures>(sensor, {x, y}, {u.z, u.w});
        camera.rays[i] = {sample.o, sample.tmax, sample.d, random_bits(key(path, 0), 1).x};
        camera.path_of[i] = path;
    });
    return camera;
}

inline void bounce_rays(const std::vector<BouncePoint>& points, uint32_t sample, BatchKeys key, PathRays& bounced) {
    bounced.resize(points.size());
    for_all(points.size(), [&](size_t i) {
        bounced.rays[i] = bounced_ray(points[i], key(points[i].path, sample));
        bounced.path_of[i] = points[i].path;
    });
}

inline void add_rays_to_emitters(const SceneView& scene, const std::vector<BouncePoint>& points, uint32_t sample,
                                 float offset, BatchKeys key, std::vector<Ray>& rays) {
    for (const BouncePoint& point : points) {
        Ray ray;
        if (ray_to_emitter(scene, point, key(point.path, sample), offset, ray)) rays.push_back(ray);
    }
}

inline std::vector<Ray> shadow_rays(const std::vector<BouncePoint>& points, uint32_t count, BatchKeys key) {
    std::vector<Ray> rays(points.empty() ? 0 : count);
    for_all(rays.size(), [&](size_t i) { rays[i] = shadow_ray(points, key(uint32_t(i), kShadowSample)); });
    return rays;
}

/// First rays of light subpaths.
inline PathRays emitted_rays(const SceneView& scene, uint32_t paths, float offset, BatchKeys key) {
    PathRays emitted;
    for (uint32_t path = 0; path < paths; ++path) {
        const RngKey k = key(path, kEmissionSample);
        const Vec4f direction = random_floats(k, 1);
        EmissionSample e;
        if (!sample_emission<kAllFeatures>(scene, random_floats(k, 0), {direction.x, direction.y}, e)) continue;
        emitted.rays.push_back({e.prim == kNone ? e.p : e.p + e.ng * offset, kInfinity, e.d, random_bits(k, 2).x});
        emitted.path_of.push_back(path);
    }
    return emitted;
}

}  // namespace detail

/// Rays of size x size paths (a power of two up to 2^15) through pixels in Morton order, with the scene's camera and
/// its horizontal field of view on both axes: "primary", jittered; "bounce 1" and "bounce 3": cosine-weighted around
/// the geometric normal, origins moved along it by 1e-5 of the scene's diagonal, paths that escaped left out; "shadow":
/// segments between random points that different paths met, both ends moved off the surface likewise and 0.9999 of the
/// length; "to emitters" and "to emitters 3": next event estimation where primary rays end, and the rays of bounce 2,
/// as far as light comes that way; "from emitters": first rays of light subpaths; "light bounce": cosine-weighted where
/// these end. A function of the scene and of `seed`.
template <Features F, class Tracer>
std::vector<RayBatch> make_ray_batches(const SceneView& scene, const Tracer& tracer, uint32_t size, uint64_t seed) {
    constexpr uint32_t kBounces = 3;
    const uint32_t paths = size * size;
    const float offset = 1e-5f * detail::scene_diagonal(scene);
    const detail::BatchKeys key = {seed};

    detail::PathRays eye = detail::camera_rays(scene, size, key);
    std::vector<RayBatch> batches;
    batches.push_back({"primary", false, true, eye.rays});

    std::vector<detail::BouncePoint> points;
    RayBatch to_emitters[2] = {{"to emitters", true, false, {}}, {"to emitters 3", true, false, {}}};
    for (uint32_t bounce = 1; bounce <= kBounces; ++bounce) {
        const std::vector<detail::BouncePoint> met =
            detail::trace_points<F>(scene, tracer, eye.rays, eye.path_of, offset);
        detail::bounce_rays(met, bounce, key, eye);
        if (bounce != 2) {
            detail::add_rays_to_emitters(scene, met, detail::kEmitterSample[bounce / 2], offset, key,
                                         to_emitters[bounce / 2].rays);
            batches.push_back({"bounce " + std::to_string(bounce), false, false, eye.rays});
        }
        points.insert(points.end(), met.begin(), met.end());
    }
    batches.push_back({"shadow", true, false, detail::shadow_rays(points, paths, key)});
    for (RayBatch& batch : to_emitters) batches.push_back(std::move(batch));

    detail::PathRays light = detail::emitted_rays(scene, paths, offset, key);
    batches.push_back({"from emitters", false, false, light.rays});
    const std::vector<detail::BouncePoint> lit =
        detail::trace_points<F>(scene, tracer, light.rays, light.path_of, offset);
    detail::bounce_rays(lit, detail::kLightBounceSample, key, light);
    batches.push_back({"light bounce", false, false, std::move(light.rays)});
    return batches;
}

}  // namespace ambilux
