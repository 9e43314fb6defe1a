// Shadow rays that end on a disk, just behind it or never, from nearly edge-on to straight.
#pragma once

#include "scene/surface.h"
#include "tests/support/accel_scenes.h"
#include "transport/subpath/subpath.h"

namespace ambilux::accel_test {

struct DiskRays {
    Scene scene;  ///< one disk
    std::vector<Ray> rays;
    std::vector<bool> behind;  ///< the ray goes through the disk, so that it is blocked
};

/// `count` rays that end on a disk, most of them again to a point behind it and without an end, from where the cosine
/// is 0.001 to 1.
inline DiskRays rays_that_end_on_a_disk(int count, uint64_t seed) {
    constexpr Features kDisk = {0, 0, bit(PrimitiveType::disk), false, false, false};
    Random random(seed);
    DiskRays out;
    add_quadric(out.scene, PrimitiveType::disk, random.in_box(3.0f), frame_from_normal(random.direction()), 0.7f);
    const SceneView view = out.scene.view();
    for (int i = 0; i < count; ++i) {
        const Vec4f u = random.next();
        const float r = std::sqrt(u.x) * 0.99f, phi = 2 * kPi * u.y, cosine = std::pow(10.0f, -3 * u.z);
        const SurfacePoint on = surface_at<kDisk>(view, 0, r * std::cos(phi), r * std::sin(phi));
        const Vec3f across = normalize(cross(on.ng, random.direction()));
        const Vec3f origin = on.p + 10.0f * (on.ng * cosine + across * std::sqrt(1 - cosine * cosine));
        const auto add = [&](Vec3f end, bool behind) {
            const Vec3f way = end - origin;
            out.rays.push_back({origin, length(way) * (1 - gamma_bound(8)), normalize(way), 0});
            out.behind.push_back(behind);
        };
        add(offset_ray_origin(on.p, on.p_error, on.ng, origin - on.p), false);
        // Not so far behind it that the way goes past its rim.
        if (r + 1e-4f / cosine > 0.9f) continue;
        add(on.p - on.ng * 5e-5f, true);
        out.rays.push_back({origin, kInfinity, normalize(on.p - origin), 0});
        out.behind.push_back(true);
    }
    return out;
}

}  // namespace ambilux::accel_test
