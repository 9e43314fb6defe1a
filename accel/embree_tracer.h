// Rays on the host, traced by Embree.
#pragma once

#include <algorithm>
#include <atomic>
#include <cfloat>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

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

/// What Embree's callbacks need to know about the rays in flight, which name their places in `rays` by their ids.
/// `base` comes first: callbacks get a pointer to it.
struct EmbreeRayContext {
    EmbreeQueryContext base;
    const SceneView* scene;
    const Ray* rays;
    bool opacity;
};

/// Geometries of the structure over everything; those of instances follow. Groups have the first one alone.
constexpr unsigned kTriangleGeometry = 0, kQuadricGeometry = 1, kFirstInstance = 2;

/// The instance that Embree names by `inst_id`; null for none.
inline const Instance* instance_at(const SceneView& view, unsigned inst_id) {
    return inst_id == RTC_INVALID_GEOMETRY_ID ? nullptr : view.instances + (inst_id - kFirstInstance);
}

/// Rays and the triangles that they met, side by side, and where they cross them.
struct alignas(64) TriangleLanes {
    static constexpr uint32_t kWidth = 16;
    float v0[3][kWidth], v1[3][kWidth], v2[3][kWidth];
    float t[kWidth], u[kWidth], v[kWidth];
    uint32_t inside[kWidth];
};

/// intersect_triangle of all lanes, for processors with AVX-512: the same operations without branches, as vectors.
void cross_triangles(const RTCRay16& rays, TriangleLanes& lanes);

}  // namespace detail

/// Traces rays through an EmbreeAccel, which must outlive it. Safe to use from many threads.
struct EmbreeTracer {
    RTCScene scene = nullptr;
    uint32_t triangle_count = 0;
    uint32_t width = 1;  ///< of the packets that suit the machine: 16, 8, or 1 for single rays

    /// Nearest hit with 0 < t < ray.tmax; without one, hit.prim is kNone and the result is false. `view` is the scene
    /// that the accel was built from.
    template <Features F>
    bool closest(const SceneView& view, const Ray& ray, Hit& hit) const {
        hit = {ray.tmax, 0.0f, 0.0f, kNone};
        if (!is_traceable(ray)) return false;
        detail::EmbreeRayContext context = make_context<F>(view, &ray);
        RTCRayHit query;
        query.ray = make_ray(ray);
        for (;;) {
            query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            query.hit.primID = RTC_INVALID_GEOMETRY_ID;
            query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
            embree_intersect(scene, &context.base, &query);
            if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
            const unsigned inst_id = query.hit.instID[0];
            hit = {query.ray.tfar, query.hit.u, query.hit.v,
                   primitive_of<F>(view, query.hit.geomID, query.hit.primID, inst_id)};
            if (query.hit.geomID != 0 || refine<F>(view, ray, inst_id, hit)) return true;
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
        detail::EmbreeRayContext context = make_context<F>(view, &ray);
        RTCRay query = make_ray(ray);
        embree_occluded(scene, &context.base, &query);
        return query.tfar < 0.0f;
    }

    /// Either of them; with `any_hit`, `hit` is not set.
    template <Features F>
    bool trace(const SceneView& view, const Ray& ray, bool any_hit, Hit& hit) const {
        return any_hit ? occluded<F>(view, ray) : closest<F>(view, ray, hit);
    }

    /// closest() of `count` rays, kMostPacketRays at most. `coherent`: they start together and go the same way.
    template <Features F>
    void closest(const SceneView& view, const Ray* rays, uint32_t count, bool coherent, Hit* hits) const {
        in_packets(
            count, [&](uint32_t k) { closest<F>(view, rays[k], hits[k]); },
            [&](auto packet, uint32_t first, uint32_t n) {
                closest_packet<F, packet.value>(view, rays + first, n, coherent, hits + first);
            });
    }
    /// occluded() of the same.
    template <Features F>
    void occluded(const SceneView& view, const Ray* rays, uint32_t count, bool coherent, bool* blocked) const {
        in_packets(
            count, [&](uint32_t k) { blocked[k] = occluded<F>(view, rays[k]); },
            [&](auto packet, uint32_t first, uint32_t n) {
                occluded_packet<F, packet.value>(view, rays + first, n, coherent, blocked + first);
            });
    }

private:
    template <class One, class Packet>
    void in_packets(uint32_t count, const One& one, const Packet& packet) const {
        if (width == 16 && count > 8) return packet(std::integral_constant<uint32_t, 16>(), 0, count);
        if (width == 1 || count < kFewestPacketRays) {
            for (uint32_t k = 0; k < count; ++k) one(k);
            return;
        }
        for (uint32_t first = 0; first < count; first += 8)
            packet(std::integral_constant<uint32_t, 8>(), first, std::min(8u, count - first));
    }
    template <Features F, uint32_t W>
    void closest_packet(const SceneView& view, const Ray* rays, uint32_t count, bool coherent, Hit* hits) const {
        detail::EmbreeRayContext context = make_context<F>(view, rays);
        alignas(64) int valid[W];
        typename EmbreePacket<W>::RayHit query;
        make_rays<W>(rays, count, query.ray, valid);
        for (uint32_t k = 0; k < W; ++k) query.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        if constexpr (F.instances)
            for (uint32_t k = 0; k < W; ++k) query.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
        EmbreePacket<W>::intersect(valid, scene, &context.base, coherent, &query);
        if constexpr (W == 16) return refine_packet<F>(view, rays, count, query, hits);
        for (uint32_t k = 0; k < count; ++k) {
            hits[k] = {rays[k].tmax, 0.0f, 0.0f, kNone};
            if (query.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
            const unsigned inst_id = query.hit.instID[0][k];
            hits[k] = {query.ray.tfar[k], query.hit.u[k], query.hit.v[k],
                       primitive_of<F>(view, query.hit.geomID[k], query.hit.primID[k], inst_id)};
            if (query.hit.geomID[k] == 0 && !refine<F>(view, rays[k], inst_id, hits[k]))
                closest<F>(view, rays[k], hits[k]);
        }
    }
    /// Where the rays of a packet meet what Embree found.
    template <Features F>
    void refine_packet(const SceneView& view, const Ray* rays, uint32_t count, const RTCRayHit16& query,
                       Hit* hits) const {
        detail::TriangleLanes lanes;
        // Those that met an instance, in its group.
        std::conditional_t<F.instances, RTCRay16, const RTCRay16&> moved = query.ray;
        for (uint32_t k = 0; k < lanes.kWidth; ++k) {
            uint32_t prim = query.hit.geomID[k] == 0 ? query.hit.primID[k] : kNone;
            if constexpr (F.instances) {
                const Instance* instance = prim == kNone ? nullptr : detail::instance_at(view, query.hit.instID[0][k]);
                if (instance) {
                    prim += instance->first_triangle;
                    const Vec3f o = instance->to_group.point(rays[k].o), d = instance->to_group.vector(rays[k].d);
                    moved.org_x[k] = o.x, moved.org_y[k] = o.y, moved.org_z[k] = o.z;
                    moved.dir_x[k] = d.x, moved.dir_y[k] = d.y, moved.dir_z[k] = d.z;
                }
            }
            const Triangle tri = prim == kNone ? Triangle{} : view.triangles[prim];
            Vec3f v0 = {0.0f, 0.0f, 0.0f}, v1 = v0, v2 = v0;
            if (prim != kNone) v0 = view.vertices[tri.v0].p, v1 = view.vertices[tri.v1].p, v2 = view.vertices[tri.v2].p;
            lanes.v0[0][k] = v0.x, lanes.v0[1][k] = v0.y, lanes.v0[2][k] = v0.z;
            lanes.v1[0][k] = v1.x, lanes.v1[1][k] = v1.y, lanes.v1[2][k] = v1.z;
            lanes.v2[0][k] = v2.x, lanes.v2[1][k] = v2.y, lanes.v2[2][k] = v2.z;
        }
        detail::cross_triangles(moved, lanes);
        for (uint32_t k = 0; k < count; ++k) {
            hits[k] = {rays[k].tmax, 0.0f, 0.0f, kNone};
            if (query.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
            const unsigned inst_id = query.hit.instID[0][k];
            hits[k] = {query.ray.tfar[k], query.hit.u[k], query.hit.v[k],
                       primitive_of<F>(view, query.hit.geomID[k], query.hit.primID[k], inst_id)};
            if (query.hit.geomID[k] != 0) continue;
            if (lanes.inside[k] && lanes.t[k] > 0.0f && lanes.t[k] < rays[k].tmax)
                hits[k] = {lanes.t[k], lanes.u[k], lanes.v[k], hits[k].prim};
            else if (!refine<F>(view, rays[k], inst_id, hits[k]))
                closest<F>(view, rays[k], hits[k]);
        }
    }
    template <Features F, uint32_t W>
    void occluded_packet(const SceneView& view, const Ray* rays, uint32_t count, bool coherent, bool* blocked) const {
        detail::EmbreeRayContext context = make_context<F>(view, rays);
        alignas(64) int valid[W];
        typename EmbreePacket<W>::Ray query;
        make_rays<W>(rays, count, query, valid);
        EmbreePacket<W>::occluded(valid, scene, &context.base, coherent, &query);
        for (uint32_t k = 0; k < count; ++k) blocked[k] = query.tfar[k] < 0.0f;
    }
    /// Embree finds the triangle; our own test tells where, as precisely as on a device, and knows the plane that the
    /// ray starts on: false if it is that of this triangle.
    template <Features F>
    static bool refine(const SceneView& view, const Ray& world_ray, unsigned inst_id, Hit& hit) {
        Ray ray = world_ray;
        uint32_t stored = hit.prim;
        if constexpr (F.instances) {
            if (const Instance* instance = detail::instance_at(view, inst_id)) {
                stored = instance->triangle_of(hit.prim);
                ray.o = instance->to_group.point(world_ray.o), ray.d = instance->to_group.vector(world_ray.d);
            }
        }
        const Triangle tri = view.triangles[stored];
        const Vec3f v0 = view.vertices[tri.v0].p, v1 = view.vertices[tri.v1].p, v2 = view.vertices[tri.v2].p;
        TriangleCrossing crossing;
        if (!intersect_triangle(ray.o, ray.d, make_ray_shear(ray.d), v0, v1, v2, ray.tmax, crossing))
            return !detail::starts_on(ray.o, v0, v1, v2);
        hit = {crossing.t, crossing.u, crossing.v, hit.prim};
        return true;
    }
    /// `inst_id` is read in scenes with instances only.
    template <Features F>
    uint32_t primitive_of(const SceneView& view, unsigned geometry, unsigned index, unsigned inst_id) const {
        if constexpr (F.instances)
            if (const Instance* instance = detail::instance_at(view, inst_id)) return instance->first_id + index;
        return index + (geometry == detail::kTriangleGeometry ? 0 : triangle_count);
    }
    template <Features F>
    static detail::EmbreeRayContext make_context(const SceneView& view, const Ray* rays) {
        detail::EmbreeRayContext context;
        embree_init_context(&context.base);
        context.scene = &view;
        context.rays = rays;
        context.opacity = F.opacity;
        return context;
    }
    static RTCRay make_ray(const Ray& ray) {
        RTCRay r;
        r.org_x = ray.o.x, r.org_y = ray.o.y, r.org_z = ray.o.z;
        r.dir_x = ray.d.x, r.dir_y = ray.d.y, r.dir_z = ray.d.z;
        r.tnear = kNear;
        r.tfar = next_float_down(ray.tmax);  // inclusive in Embree
        r.time = 0.0f;
        r.mask = ~0u;
        r.id = 0;
        r.flags = 0;
        return r;
    }
    /// The same for all lanes; those without a ray that may be traced are not valid.
    template <uint32_t W, class Rays>
    static void make_rays(const Ray* rays, uint32_t count, Rays& r, int* valid) {
        for (uint32_t k = 0; k < W; ++k) {
            const Ray ray = k < count ? rays[k] : Ray{{0.0f, 0.0f, 0.0f}, 0.0f, {0.0f, 0.0f, 1.0f}, 0};
            valid[k] = is_traceable(ray) ? -1 : 0;
            r.org_x[k] = ray.o.x, r.org_y[k] = ray.o.y, r.org_z[k] = ray.o.z;
            r.dir_x[k] = ray.d.x, r.dir_y[k] = ray.d.y, r.dir_z[k] = ray.d.z;
            r.tnear[k] = kNear;
            r.tfar[k] = valid[k] ? next_float_down(ray.tmax) : 0.0f;
            r.time[k] = 0.0f;
            r.mask[k] = ~0u;
            r.id[k] = k;
            r.flags[k] = 0;
        }
    }

    static constexpr float kNear = FLT_MIN;  ///< inclusive for triangles: at 0 a ray would meet the plane through zero
                                             ///< that it leaves
    static constexpr uint32_t kFewestPacketRays = 3;  ///< fewer are traced one by one
};

/// Embree's structure over a scene: triangles as geometry 0, analytic shapes as geometry 1, then instances of
/// structures over groups. It shares the arrays of the scene.
class EmbreeAccel {
public:
    /// Builds over all TBB threads. Throws Error(device) when Embree fails.
    explicit EmbreeAccel(const Scene& scene);
    ~EmbreeAccel();
    EmbreeAccel(EmbreeAccel&& other) noexcept;
    EmbreeAccel(const EmbreeAccel&) = delete;
    EmbreeAccel& operator=(const EmbreeAccel&) = delete;

    EmbreeTracer tracer() const { return {scene_, triangle_count_, width_}; }
    uint64_t memory_bytes() const { return uint64_t(*bytes_); }  ///< what Embree holds
    double build_seconds() const { return build_seconds_; }

private:
    void attach_instances(const Scene& scene);

    struct UserData;  ///< what the callbacks of the analytic shapes read
    std::unique_ptr<std::atomic<int64_t>> bytes_;
    std::unique_ptr<UserData> user_;
    RTCDevice device_ = nullptr;
    RTCScene scene_ = nullptr;
    std::vector<RTCScene> groups_;
    uint32_t triangle_count_ = 0, width_ = 1;
    double build_seconds_ = 0;
};

}  // namespace ambilux
