// Rays on the host, traced by Embree.
#pragma once

#include <atomic>
#include <cfloat>
#include <cstdint>
#include <memory>

#include "accel/embree_api.h"
#include "accel/opacity.h"
#include "accel/traceable.h"
#include "accel/triangle_test.h"
#include "scene/scene.h"

namespace ambilux {

namespace detail {

/// True if `o` is on the plane of the triangle within rounding: such a ray does not meet it (intersect_triangle).
inline bool starts_on(Vec3f o, Vec3f v0, Vec3f v1, Vec3f v2) {
    return height_over_plane(v0 - o, accurate_cross(v1 - v0, v2 - v0)) == 0.0f;
}

/// What Embree's callbacks need to know about the ray in flight. `base` comes first: callbacks get a pointer to it.
struct EmbreeRayContext {
    EmbreeQueryContext base;
    const SceneView* scene;
    const Ray* ray;
    bool opacity;
};

}  // namespace detail

/// Traces rays through an EmbreeAccel, which must outlive it. Safe to use from many threads.
struct EmbreeTracer {
    RTCScene scene = nullptr;
    uint32_t triangle_count = 0;

    /// Nearest hit with 0 < t < ray.tmax; without one, hit.prim is kNone and the result is false. `view` is the scene
    /// that the accel was built from.
    template <Features F>
    bool closest(const SceneView& view, const Ray& ray, Hit& hit) const {
        hit = {ray.tmax, 0.0f, 0.0f, kNone};
        if (!is_traceable(ray)) return false;
        detail::EmbreeRayContext context = make_context<F>(view, ray);
        RTCRayHit query;
        query.ray = make_ray(ray);
        for (;;) {
            query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            query.hit.primID = RTC_INVALID_GEOMETRY_ID;
            query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
            embree_intersect(scene, &context.base, &query);
            if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
            hit = {query.ray.tfar, query.hit.u, query.hit.v,
                   query.hit.primID + (query.hit.geomID == 0 ? 0 : triangle_count)};
            if (query.hit.geomID != 0) return true;
            // Embree finds the triangle; our own test tells where, as precisely as on a device, and knows the plane
            // that the ray starts on.
            const Triangle tri = view.triangles[hit.prim];
            const Vec3f v0 = view.vertices[tri.v0].p, v1 = view.vertices[tri.v1].p, v2 = view.vertices[tri.v2].p;
            TriangleCrossing crossing;
            if (intersect_triangle(ray.o, ray.d, make_ray_shear(ray.d), v0, v1, v2, ray.tmax, crossing)) {
                hit = {crossing.t, crossing.u, crossing.v, hit.prim};
                return true;
            }
            if (!detail::starts_on(ray.o, v0, v1, v2)) return true;
            query.ray.tnear = next_float_up(hit.t);
            query.ray.tfar = next_float_down(ray.tmax);
            hit = {ray.tmax, 0.0f, 0.0f, kNone};
        }
    }

    /// True if anything lies at 0 < t < ray.tmax. Embree's own t of a triangle has the error of an estimated
    /// reciprocal, up to 2^-22 of it, so that where the ray ends depends on the processor to that extent. Connections
    /// end gamma_bound(8) before what they lead to.
    template <Features F>
    bool occluded(const SceneView& view, const Ray& ray) const {
        if (!is_traceable(ray)) return false;
        detail::EmbreeRayContext context = make_context<F>(view, ray);
        RTCRay query = make_ray(ray);
        embree_occluded(scene, &context.base, &query);
        return query.tfar < 0.0f;
    }

    /// Either of them; with `any_hit`, `hit` is not set.
    template <Features F>
    bool trace(const SceneView& view, const Ray& ray, bool any_hit, Hit& hit) const {
        return any_hit ? occluded<F>(view, ray) : closest<F>(view, ray, hit);
    }

private:
    template <Features F>
    static detail::EmbreeRayContext make_context(const SceneView& view, const Ray& ray) {
        detail::EmbreeRayContext context;
        embree_init_context(&context.base);
        context.scene = &view;
        context.ray = &ray;
        context.opacity = F.opacity;
        return context;
    }
    static RTCRay make_ray(const Ray& ray) {
        RTCRay r;
        r.org_x = ray.o.x, r.org_y = ray.o.y, r.org_z = ray.o.z;
        r.dir_x = ray.d.x, r.dir_y = ray.d.y, r.dir_z = ray.d.z;
        r.tnear = FLT_MIN;  // inclusive for triangles: at 0 a ray would meet the plane through zero that it leaves
        r.tfar = next_float_down(ray.tmax);  // inclusive in Embree
        r.time = 0.0f;
        r.mask = ~0u;
        r.id = 0;
        r.flags = 0;
        return r;
    }
};

/// Embree's structure over a scene: triangles as geometry 0, analytic shapes as geometry 1. The scene must outlive it.
class EmbreeAccel {
public:
    /// Builds over all TBB threads. Throws Error(device) when Embree fails.
    explicit EmbreeAccel(const Scene& scene);
    ~EmbreeAccel();
    EmbreeAccel(EmbreeAccel&& other) noexcept;
    EmbreeAccel(const EmbreeAccel&) = delete;
    EmbreeAccel& operator=(const EmbreeAccel&) = delete;

    EmbreeTracer tracer() const { return {scene_, triangle_count_}; }
    uint64_t memory_bytes() const { return uint64_t(*bytes_); }  ///< what Embree holds
    double build_seconds() const { return build_seconds_; }

private:
    struct UserData;  ///< what the callbacks of the analytic shapes read
    std::unique_ptr<std::atomic<int64_t>> bytes_;
    std::unique_ptr<UserData> user_;
    RTCDevice device_ = nullptr;
    RTCScene scene_ = nullptr;
    uint32_t triangle_count_ = 0;
    double build_seconds_ = 0;
};

}  // namespace ambilux
