#include "grids.h"

#include "scene/primitive_bounds.h"

namespace ambilux::lpv {
namespace {

Bounds3f bounds_of(const Scene& scene) {
    const SceneView view = scene.view();
    Bounds3f b;
    for (uint32_t t = 0; t < view.ungrouped_count(); ++t) b.extend(triangle_bounds(view, t));
    for (const Instance& i : scene.instances) b.extend(instance_bounds(view, i));
    for (const Quadric& q : scene.quadrics) b.extend(quadric_bounds(q));
    if (b.empty()) b.lower = b.upper = scene.bounds_center;
    return b;
}

}  // namespace

Cascades Cascades::plan(const Scene& scene, const Settings& settings) {
    const Bounds3f bounds = bounds_of(scene);
    const Vec3f extent = bounds.upper - bounds.lower;
    const float longest = max(max(extent.x, extent.y), extent.z);
    // Surfaces that bound the scene lie inside, as do the places half a cell before them.
    const float margin = 1.0f + 2.0f / float(settings.resolution);
    float edge = (longest > 0.0f ? longest : scene.bounds_radius) * settings.size * margin;
    const Vec3f center = (bounds.lower + bounds.upper) * 0.5f;
    Cascades c{};
    c.count = settings.cascades;
    for (uint32_t i = 0; i < c.count; ++i, edge *= 0.5f)
        c.grids[i] = {center - splat(0.5f * edge), edge / float(settings.resolution), settings.resolution};
    return c;
}

}  // namespace ambilux::lpv
