#include "formats/document/origin.h"

#include <algorithm>
#include <cmath>

namespace ambilux::document {
namespace {

/// Half diagonals of a scene that its centre may be away from the origin: four bits.
constexpr double kFar = 16;

}  // namespace

Bounds3f surface_bounds(const Scene& scene) {
    const SceneView view = scene.view();
    Bounds3f box;
    for (const Instance& i : scene.instances) box.extend(instance_bounds(view, i));
    for (uint32_t i = 0; i < view.ungrouped_count(); ++i) box.extend(triangle_bounds(view, i));
    for (const Quadric& q : scene.quadrics) box.extend(quadric_bounds(q));
    return box;
}

Vec3d far_center(const Scene& scene, const Bounds3f& surfaces) {
    Bounds3f box = surfaces;
    const auto& m = scene.sensor.to_world.m;
    box.extend(Vec3f{m[0][3], m[1][3], m[2][3]});
    const Vec3d c = (in_double(box.lower) + in_double(box.upper)) * 0.5;
    const double radius = length(in_double(box.upper) - c),
                 away = std::max({std::fabs(c.x), std::fabs(c.y), std::fabs(c.z)});
    // Written so that what is not finite stays where it is, to be refused by name.
    return radius > 0 && std::isfinite(away + radius) && away > kFar * radius ? c : Vec3d{};
}

}  // namespace ambilux::document
