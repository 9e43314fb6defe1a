// Rays on which tracers are compared, and how far their hits may be apart.
#pragma once

#include <cmath>
#include <vector>

#include "scene/surface.h"
#include "tests/support/accel_scenes.h"

namespace ambilux::accel_test {

/// Rays of all kinds that make tracers differ, some of them along edges and surfaces, a few that are no rays.
inline std::vector<Ray> test_rays(const Scene& scene, uint32_t count, float scale, uint64_t seed) {
    std::vector<Ray> rays(count);
    const auto on_triangle = [&](Random& random, float b1, float b2) {
        const Triangle t = scene.triangles[random.index(uint32_t(scene.triangles.size()))];
        return scene.vertices[t.v0].p * (1 - b1 - b2) + scene.vertices[t.v1].p * b1 + scene.vertices[t.v2].p * b2;
    };
    for (uint32_t i = 0; i < count; ++i) {
        Random random(seed);
        random.key.index = i;
        Ray ray = {random.in_box(1.5f * scale), kInfinity, random.direction(), i};
        const float u = random.uniform();
        const int axis = int(i / 7 % 3);
        switch (i % 7) {
            case 1:  // axis-parallel
                ray.d = {0, 0, 0};
                ray.d[axis] = i / 21 % 2 ? 1.0f : -1.0f;
                break;
            case 2:  // in a coordinate plane
                ray.d[axis] = i / 21 % 2 ? 0.0f : -0.0f;
                ray.d = normalize(ray.d);
                break;
            case 3:  // towards an edge or a vertex
                if (!scene.triangles.empty())
                    ray.d = normalize(on_triangle(random, i / 7 % 2 ? u : 0.0f, 0.0f) - ray.o);
                break;
            case 4:  // grazing: from one surface point to another
                if (!scene.triangles.empty()) {
                    const Vec3f a = on_triangle(random, 0.3f, 0.3f), b = on_triangle(random, u * 0.5f, 0.4f);
                    if (length(b - a) > 0)
                        ray = {a - normalize(b - a) * (0.1f * scale), kInfinity, normalize(b - a), i};
                }
                break;
            case 5: ray.tmax = scale * 2.0f * u; break;
            default: break;
        }
        if (i % 1009 == 1008) ray.d = {0, 0, 0};
        if (i % 1013 == 1012) ray.tmax = i % 2 ? NAN : -1.0f;
        if (i % 1019 == 1018) ray.o.y = i % 2 ? NAN : kInfinity;
        rays[i] = ray;
    }
    return rays;
}

/// How far rounding may move a hit along its ray: a few units in the last place of the coordinates, as seen at the
/// angle between ray and surface.
inline float t_tolerance(const SceneView& view, const Ray& ray, const Hit& hit) {
    const SurfacePoint s = surface_at<kAllFeatures>(view, hit.prim, hit.u, hit.v);
    const float cosine = max(fabsf(dot(s.ng, ray.d)), 1e-4f);
    return max(1e-5f * hit.t, 32 * 0x1p-24f * (max_component(abs(ray.o)) + hit.t) / cosine);
}

}  // namespace ambilux::accel_test
