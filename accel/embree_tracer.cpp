#include "accel/embree_tracer.h"

#include <chrono>
#include <cstring>
#include <string>

#include "accel/ends_on_disk.h"
#include "accel/quadric_intersect.h"
#include "core/error.h"
#include "scene/primitive_bounds.h"

namespace ambilux {

// The machine's width of packets is 16 only where it has these. Nothing is contracted, so that the bits are those of
// the scalar code; what is not inlined here is compiled for all processors.
#if defined(__x86_64__)
__attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,prefer-vector-width=512")))
#endif
void detail::cross_triangles(const RTCRay16& r, TriangleLanes& lanes) {
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC ivdep
#endif
    for (uint32_t k = 0; k < lanes.kWidth; ++k) {
        const Vec3f o = {r.org_x[k], r.org_y[k], r.org_z[k]}, d = {r.dir_x[k], r.dir_y[k], r.dir_z[k]};
        const Vec3f v0 = {lanes.v0[0][k], lanes.v0[1][k], lanes.v0[2][k]};
        const Vec3f v1 = {lanes.v1[0][k], lanes.v1[1][k], lanes.v1[2][k]};
        const Vec3f v2 = {lanes.v2[0][k], lanes.v2[1][k], lanes.v2[2][k]};
        const TriangleEdges edges = triangle_edges(o, make_ray_shear(d), v0, v1, v2);
        const Vec3f n = accurate_cross(v1 - v0, v2 - v0);
        const TriangleCrossing c = edges.crossing(rounded_divide(height_over_plane(v0 - o, n), dot(d, n)));
        lanes.t[k] = c.t, lanes.u[k] = c.u, lanes.v[k] = c.v;
        lanes.inside[k] = edges.inside;
    }
}

struct EmbreeAccel::UserData {
    SceneView view;
    // Embree and `view` read them, for as long as this lives.
    SharedArray<MeshVertex> vertices;
    SharedArray<Triangle> triangles;
    SharedArray<Quadric> quadrics;
    SharedArray<Instance> instances;
};

namespace {

bool count_bytes(void* total, ssize_t bytes, bool) {
    static_cast<std::atomic<int64_t>*>(total)->fetch_add(bytes, std::memory_order_relaxed);
    return true;
}

[[noreturn]] void throw_embree_error(RTCDevice device, const char* what) {
    throw Error(ExitCode::device, std::string("Embree: ") + what + " failed with error code " +
                                      std::to_string(int(rtcGetDeviceError(device))));
}

const detail::EmbreeRayContext& ray_context(EmbreeQueryContext* base) {
    return *reinterpret_cast<detail::EmbreeRayContext*>(base);
}

/// The ray of lane `i`, of one or of a packet.
const Ray& ray_of(const detail::EmbreeRayContext& context, RTCRayN* rays, unsigned n, unsigned i) {
    return context.rays[RTCRayN_id(rays, n, i)];
}

const Instance* instance_of(const RTCFilterFunctionNArguments* args, const SceneView& view, unsigned i) {
    return view.instance_count ? detail::instance_at(view, RTCHitN_instID(args->hit, args->N, i, 0)) : nullptr;
}
uint32_t stored_triangle(const RTCFilterFunctionNArguments* args, const Instance* instance, unsigned i) {
    return RTCHitN_primID(args->hit, args->N, i) + (instance ? instance->first_triangle : 0);
}

/// True if the ray of lane `i` meets the triangle: not one that lets it pass.
bool accepts(const RTCFilterFunctionNArguments* args, const detail::EmbreeRayContext& context, unsigned i) {
    if (!context.opacity) return true;
    const Instance* instance = instance_of(args, *context.scene, i);
    const uint32_t offset = instance ? instance->first_id - instance->first_triangle : 0;
    return accept_hit<kAllFeatures>(*context.scene, ray_of(context, args->ray, args->N, i),
                                    stored_triangle(args, instance, i), RTCHitN_u(args->hit, args->N, i),
                                    RTCHitN_v(args->hit, args->N, i), offset);
}

/// Rejects hits on surfaces that let their ray pass.
void filter_triangle(const RTCFilterFunctionNArguments* args) {
    const auto& context = ray_context(args->context);
    for (unsigned i = 0; i < args->N; ++i)
        if (args->valid[i] == -1 && !accepts(args, context, i)) args->valid[i] = 0;
}

/// The same, and the triangle on whose plane the ray starts.
void filter_occluder(const RTCFilterFunctionNArguments* args) {
    const auto& context = ray_context(args->context);
    const SceneView& view = *context.scene;
    for (unsigned i = 0; i < args->N; ++i) {
        if (args->valid[i] != -1) continue;
        const Instance* instance = instance_of(args, view, i);
        const Triangle tri = view.triangles[stored_triangle(args, instance, i)];
        const Vec3f o = ray_of(context, args->ray, args->N, i).o;
        if (detail::starts_on(instance ? instance->to_group.point(o) : o, view.vertices[tri.v0].p,
                              view.vertices[tri.v1].p, view.vertices[tri.v2].p) ||
            !accepts(args, context, i))
            args->valid[i] = 0;
    }
}

void bound_quadric(const RTCBoundsFunctionArguments* args) {
    const auto& view = *static_cast<const SceneView*>(args->geometryUserPtr);
    const Bounds3f b = quadric_bounds(view.quadrics[args->primID]);
    args->bounds_o->lower_x = b.lower.x, args->bounds_o->lower_y = b.lower.y, args->bounds_o->lower_z = b.lower.z;
    args->bounds_o->upper_x = b.upper.x, args->bounds_o->upper_y = b.upper.y, args->bounds_o->upper_z = b.upper.z;
}

/// First crossing that the ray does not pass; `upper` is exclusive.
bool first_crossing(const detail::EmbreeRayContext& context, const SceneView& view, const Ray& ray, uint32_t index,
                    float upper, float& t, float& u, float& v) {
    const QuadricCrossings hits = quadric_crossings<kAllFeatures>(view.quadrics[index], ray.o, ray.d, upper);
    for (int i = 0; i < hits.count; ++i) {
        if (context.opacity &&
            !accept_hit<kAllFeatures>(*context.scene, ray, view.triangle_count + index, hits.u[i], hits.v[i]))
            continue;
        t = hits.t[i], u = hits.u[i], v = hits.v[i];
        return true;
    }
    return false;
}

void intersect_quadric(const RTCIntersectFunctionNArguments* args) {
    const auto& view = *static_cast<const SceneView*>(args->geometryUserPtr);
    const auto& context = ray_context(args->context);
    const unsigned n = args->N;
    RTCRayN* rays = RTCRayHitN_RayN(args->rayhit, n);
    RTCHitN* hits = RTCRayHitN_HitN(args->rayhit, n);
    for (unsigned i = 0; i < n; ++i) {
        if (args->valid[i] != -1) continue;
        const Ray& ray = ray_of(context, rays, n, i);
        // Against the ray's tmax while nothing is hit, so that the bound is exclusive as for triangles.
        const float upper = RTCHitN_geomID(hits, n, i) == RTC_INVALID_GEOMETRY_ID ? ray.tmax : RTCRayN_tfar(rays, n, i);
        float t, u, v;
        if (!first_crossing(context, view, ray, args->primID, upper, t, u, v)) continue;
        RTCRayN_tfar(rays, n, i) = t;
        RTCHitN_u(hits, n, i) = u;
        RTCHitN_v(hits, n, i) = v;
        RTCHitN_primID(hits, n, i) = args->primID;
        RTCHitN_geomID(hits, n, i) = args->geomID;
        RTCHitN_instID(hits, n, i, 0) = RTC_INVALID_GEOMETRY_ID;
    }
}

void occlude_quadric(const RTCOccludedFunctionNArguments* args) {
    const auto& view = *static_cast<const SceneView*>(args->geometryUserPtr);
    const auto& context = ray_context(args->context);
    for (unsigned i = 0; i < args->N; ++i) {
        if (args->valid[i] != -1) continue;
        const Ray& ray = ray_of(context, args->ray, args->N, i);
        if (ends_on_disk(view.quadrics[args->primID], ray)) continue;
        float t, u, v;
        if (first_crossing(context, view, ray, args->primID, ray.tmax, t, u, v))
            RTCRayN_tfar(args->ray, args->N, i) = -kInfinity;
    }
}

/// Packets as wide as the processor's vectors, if this build of Embree has them: 16 where it has AVX-512.
uint32_t packet_width(RTCDevice device) {
#if defined(__x86_64__)
    if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
        return 16;
#endif
    return rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8 : 1;
}

void attach(RTCScene scene, RTCGeometry geometry, unsigned int id) {
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
    rtcReleaseGeometry(geometry);
}

RTCGeometry make_mesh(RTCDevice device, const Scene& scene, uint32_t first, uint32_t count) {
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, scene.vertices.data(), 0,
                               sizeof(MeshVertex), scene.vertices.size());
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, scene.triangles.data(),
                               first * sizeof(Triangle), sizeof(Triangle), count);
    if (scene.features.opacity) rtcSetGeometryIntersectFilterFunction(mesh, filter_triangle);
    rtcSetGeometryOccludedFilterFunction(mesh, filter_occluder);
    return mesh;
}

RTCScene new_scene(RTCDevice device) {
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    return scene;
}

}  // namespace

void EmbreeAccel::attach_instances(const Scene& scene) {
    for (const Group& group : scene.groups) {
        groups_.push_back(new_scene(device_));
        attach(groups_.back(), make_mesh(device_, scene, group.first_triangle, group.triangle_count),
               detail::kTriangleGeometry);
        rtcCommitScene(groups_.back());
    }
    for (size_t i = 0; i < scene.instances.size(); ++i) {
        RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(geometry, groups_[scene.instances[i].group]);
        rtcSetGeometryTimeStepCount(geometry, 1);
        rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, scene.instances[i].to_world.m);
        attach(scene_, geometry, detail::kFirstInstance + unsigned(i));
    }
}

EmbreeAccel::EmbreeAccel(const Scene& scene)
    : bytes_(std::make_unique<std::atomic<int64_t>>(0)), user_(std::make_unique<UserData>()),
      triangle_count_(uint32_t(scene.triangles.size())) {
    const auto start = std::chrono::steady_clock::now();
    user_->vertices = scene.vertices, user_->triangles = scene.triangles;
    user_->quadrics = scene.quadrics, user_->instances = scene.instances;
    user_->view = scene.view();
    device_ = rtcNewDevice(nullptr);
    if (!device_) throw_embree_error(nullptr, "making a device");
    rtcSetDeviceMemoryMonitorFunction(device_, count_bytes, bytes_.get());
    width_ = packet_width(device_);
    scene_ = new_scene(device_);
    if (const uint32_t count = user_->view.ungrouped_count())
        attach(scene_, make_mesh(device_, scene, 0, count), detail::kTriangleGeometry);
    if (!scene.quadrics.empty()) {
        RTCGeometry shapes = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_USER);
        rtcSetGeometryUserPrimitiveCount(shapes, unsigned(scene.quadrics.size()));
        rtcSetGeometryUserData(shapes, &user_->view);
        rtcSetGeometryBoundsFunction(shapes, bound_quadric, nullptr);
        rtcSetGeometryIntersectFunction(shapes, intersect_quadric);
        rtcSetGeometryOccludedFunction(shapes, occlude_quadric);
        attach(scene_, shapes, detail::kQuadricGeometry);
    }
    attach_instances(scene);
    rtcCommitScene(scene_);
    if (const RTCError error = rtcGetDeviceError(device_); error != RTC_ERROR_NONE)
        throw Error(ExitCode::device,
                    "Embree: building the structure failed with error code " + std::to_string(int(error)));
    build_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

EmbreeAccel::EmbreeAccel(EmbreeAccel&& other) noexcept
    : bytes_(std::move(other.bytes_)), user_(std::move(other.user_)), device_(other.device_), scene_(other.scene_),
      groups_(std::move(other.groups_)), triangle_count_(other.triangle_count_), width_(other.width_),
      build_seconds_(other.build_seconds_) {
    other.device_ = nullptr;
    other.scene_ = nullptr;
    other.groups_.clear();
}

EmbreeAccel::~EmbreeAccel() {
    if (scene_) rtcReleaseScene(scene_);
    for (RTCScene group : groups_) rtcReleaseScene(group);
    if (device_) rtcReleaseDevice(device_);
}

}  // namespace ambilux
