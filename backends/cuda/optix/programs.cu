// The programs that OptiX runs along a ray. OptiX finds candidates; where a ray meets them, and whether it does, is for
// the same functions to say as in every other tracer (accel/). Only the edges of triangles are those of OptiX's own
// test, so that no ray slips between two of them.
#include <optix_device.h>

#include "accel/ends_on_disk.h"
#include "accel/opacity.h"
#include "accel/quadric_intersect.h"
#include "accel/traceable.h"
#include "accel/triangle_test.h"
#include "backends/cuda/optix/params.h"

using namespace ambilux;

/// OptixParams, which could not have default values here.
extern "C" {
__constant__ alignas(16) unsigned char optix_params[sizeof(OptixParams)];
}

namespace {

const __forceinline__ __device__ OptixParams& params() { return reinterpret_cast<const OptixParams&>(optix_params); }

constexpr Features kTraced = kAllFeatures;
/// Payload::prim after a hit behind which the way goes on.
constexpr uint32_t kGoOn = kNotHanded;

/// The ray of this thread, in the scene.
__forceinline__ __device__ Ray world_ray() {
    const float4* words = reinterpret_cast<const float4*>(params().handed.rays + optixGetLaunchIndex().x);
    const float4 a = words[0], b = words[1];
    return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, __float_as_uint(b.w)};
}

/// A triangle that OptiX found, with the ray in its coordinates.
struct Candidate {
    Ray ray;
    Vec3f v0, v1, v2;
    uint32_t stored, id_offset;

    /// Where the ray crosses its plane; false where that is no hit (intersect_triangle).
    __forceinline__ __device__ bool crosses(float& t) const {
        const Vec3f n = detail::accurate_cross(v1 - v0, v2 - v0);
        t = rounded_divide(height_over_plane(v0 - ray.o, n), dot(ray.d, n));
        return t > 0.0f && t < ray.tmax;
    }
    /// Barycentrics by our own test, or OptiX's where it calls the ray outside.
    __forceinline__ __device__ Vec2f barycentrics() const {
        const TriangleEdges edges = triangle_edges(ray.o, make_ray_shear(ray.d), v0, v1, v2);
        if (edges.inside) {
            const TriangleCrossing c = edges.crossing(0.0f);
            return {c.u, c.v};
        }
        const float2 b = optixGetTriangleBarycentrics();
        return {b.x, b.y};
    }
};

__forceinline__ __device__ Candidate candidate() {
    Candidate c;
    c.ray = world_ray();
    c.stored = optixGetPrimitiveIndex();
    c.id_offset = 0;
    const uint32_t id = optixGetInstanceId();
    if (id != ~0u && id >= kOptixFirstInstance) {
        const Instance& instance = params().scene.instances[id - kOptixFirstInstance];
        c.ray.o = instance.to_group.point(c.ray.o);
        c.ray.d = instance.to_group.vector(c.ray.d);
        c.stored += instance.first_triangle;
        c.id_offset = instance.first_id - instance.first_triangle;
    }
    const Triangle t = params().scene.triangles[c.stored];
    c.v0 = params().scene.vertices[t.v0].p;
    c.v1 = params().scene.vertices[t.v1].p;
    c.v2 = params().scene.vertices[t.v2].p;
    return c;
}

/// Past the end of the ray by more than OptiX's distances may be off: our own decide.
__forceinline__ __device__ float beyond(float tmax) { return fminf(tmax * (1.0f + 0x1p-16f), 0x1p126f); }

/// From `tmin` on, which is no hit. `hit.t`, if it is kGoOn: OptiX's distance of what was met.
template <unsigned kFlags>
__forceinline__ __device__ void follow(const Ray& ray, float tmin, unsigned flags, Hit& hit) {
    unsigned t = 0, u = 0, v = 0, prim = 0;
    optixTrace(OptixTraversableHandle(params().root), make_float3(ray.o.x, ray.o.y, ray.o.z),
               make_float3(ray.d.x, ray.d.y, ray.d.z), tmin, beyond(ray.tmax), 0.0f, OptixVisibilityMask(255),
               kFlags | flags, 0, 0, 0, t, u, v, prim);
    hit = {__uint_as_float(t), __uint_as_float(u), __uint_as_float(v), prim};
}

template <class Follow>
__forceinline__ __device__ void generate(Follow follow_ray) {
    const uint32_t i = optixGetLaunchIndex().x;
    if (i >= *params().handed.count) return;
    Hit& place = params().handed.hits[i];
    if (place.prim == kNotHanded) return;
    const Ray ray = world_ray();
    Hit hit = {ray.tmax, 0.0f, 0.0f, kNone};
    if (params().root && is_traceable(ray)) follow_ray(ray, hit);
    if (hit.prim == kNone) hit = {ray.tmax, 0.0f, 0.0f, kNone};
    reinterpret_cast<float4&>(place) = make_float4(hit.t, hit.u, hit.v, __uint_as_float(hit.prim));
}

}  // namespace

/// Without masks the nearest candidate alone is looked at, which costs less than a program for each of them; where it
/// is no hit, as the surface that the ray starts on, the ray goes on behind it.
extern "C" __global__ void __raygen__closest() {
    generate([](const Ray& ray, Hit& hit) {
        float tmin = 0.0f;
        do {
            follow<OPTIX_RAY_FLAG_NONE>(ray, tmin, params().opaque ? OPTIX_RAY_FLAG_DISABLE_ANYHIT : 0u, hit);
            tmin = next_float_up(hit.t);
        } while (hit.prim == kGoOn && tmin < ray.tmax);
        if (hit.prim == kGoOn) hit.prim = kNone;
    });
}

extern "C" __global__ void __raygen__occluded() {
    generate([](const Ray& ray, Hit& hit) {
        follow<OPTIX_RAY_FLAG_TERMINATE_ON_FIRST_HIT | OPTIX_RAY_FLAG_DISABLE_CLOSESTHIT>(ray, 0.0f, 0u, hit);
    });
}

extern "C" __global__ void __miss__none() { optixSetPayload_3(kNone); }

extern "C" __global__ void __anyhit__triangle() {
    const Candidate c = candidate();
    float t;
    if (!c.crosses(t)) return optixIgnoreIntersection();
    if (params().opaque || !material_of(params().scene, c.stored).lets_pass()) return;
    const Vec2f b = c.barycentrics();
    if (!accept_hit<kTraced>(params().scene, c.ray, c.stored, b.x, b.y, c.id_offset)) optixIgnoreIntersection();
}

extern "C" __global__ void __closesthit__triangle() {
    const Candidate c = candidate();
    float t;
    if (!c.crosses(t)) {
        optixSetPayload_0(__float_as_uint(optixGetRayTmax()));
        optixSetPayload_3(kGoOn);
        return;
    }
    const Vec2f b = c.barycentrics();
    optixSetPayload_0(__float_as_uint(t));
    optixSetPayload_1(__float_as_uint(b.x));
    optixSetPayload_2(__float_as_uint(b.y));
    optixSetPayload_3(c.stored + c.id_offset);
}

/// The first crossing that the ray does not pass.
extern "C" __global__ void __intersection__quadric() {
    const uint32_t index = optixGetPrimitiveIndex();
    const Quadric& quadric = params().scene.quadrics[index];
    const Ray ray = world_ray();
    if ((optixGetRayFlags() & OPTIX_RAY_FLAG_TERMINATE_ON_FIRST_HIT) && ends_on_disk(quadric, ray)) return;
    const QuadricCrossings hits = quadric_crossings<kTraced>(quadric, ray.o, ray.d, fminf(ray.tmax, optixGetRayTmax()));
    for (int i = 0; i < hits.count; ++i) {
        if (hits.t[i] < optixGetRayTmin()) continue;
        if (!params().opaque &&
            !accept_hit<kTraced>(params().scene, ray, params().scene.triangle_count + index, hits.u[i], hits.v[i]))
            continue;
        optixReportIntersection(hits.t[i], 0, __float_as_uint(hits.u[i]), __float_as_uint(hits.v[i]));
        return;
    }
}

extern "C" __global__ void __closesthit__quadric() {
    optixSetPayload_0(__float_as_uint(optixGetRayTmax()));
    optixSetPayload_1(optixGetAttribute_0());
    optixSetPayload_2(optixGetAttribute_1());
    optixSetPayload_3(params().scene.triangle_count + optixGetPrimitiveIndex());
}
