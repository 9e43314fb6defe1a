#include "formats/extent.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/vec3d.h"
#include "scene/primitive_bounds.h"

namespace ambilux {

Vec3f column(const Affine& a, int i) { return {a.m[0][i], a.m[1][i], a.m[2][i]}; }

namespace {

double volume_scale(const Instance& i) {
    const Vec3f x = column(i.to_world, 0), y = column(i.to_world, 1), z = column(i.to_world, 2);
    return double(dot(cross(x, y), z));
}

}  // namespace

double triangle_area(const Scene& scene, const Triangle& t) {
    const Vec3f &a = scene.vertices[t.v0].p, &b = scene.vertices[t.v1].p, &c = scene.vertices[t.v2].p;
    return 0.5 * length(cross(in_double(b) - in_double(a), in_double(c) - in_double(a)));
}

void fill_bounds(Scene& scene) {
    Vec3f lo = splat(kInfinity), hi = splat(-kInfinity);
    const auto grow = [&](Vec3f a, Vec3f b) { lo = min(lo, a), hi = max(hi, b); };
    const Vec3f camera = column(scene.sensor.to_world, 3);
    grow(camera, camera);
    const SceneView view = scene.view();
    const std::span<const Triangle> triangles(scene.triangles.data(), view.ungrouped_count());
    for (const Triangle& t : triangles)
        for (uint32_t v : {t.v0, t.v1, t.v2}) grow(scene.vertices[v].p, scene.vertices[v].p);
    for (const Instance& i : scene.instances) {
        const Bounds3f b = instance_bounds(view, i);
        grow(b.lower, b.upper);
    }
    // Centre and half axes of a box around a quadric; a sphere about the origin holds it with radius `reach`.
    const auto quadric_ball = [](const Quadric& q, Vec3f& center) {
        center = column(q.to_world, 3);
        if (q.type == PrimitiveType::sphere) return q.radius;
        const float flat = length(Vec3f{length(column(q.to_world, 0)), length(column(q.to_world, 1)), 0});
        if (q.type == PrimitiveType::disk) return std::min(flat, std::max(q.radius, 0.0f));
        const Vec3f half = column(q.to_world, 2) * 0.5f;
        center = center + half;
        return sqrtf(q.radius * q.radius + length_squared(half));
    };
    for (const Quadric& q : scene.quadrics) {
        Vec3f c;
        const float r = quadric_ball(q, c);
        grow(c - splat(r), c + splat(r));
    }
    const Vec3f center = (lo + hi) * 0.5f;
    float squared = length_squared(camera - center);
    for (const Triangle& t : triangles)
        for (uint32_t v : {t.v0, t.v1, t.v2}) squared = max(squared, length_squared(scene.vertices[v].p - center));
    for (const Instance& i : scene.instances) {
        const Bounds3f b = instance_bounds(view, i);
        squared = max(squared, length_squared(max(abs(b.lower - center), abs(b.upper - center))));
    }
    float radius = sqrtf(squared);
    for (const Quadric& q : scene.quadrics) {
        Vec3f c;
        const float r = quadric_ball(q, c);
        radius = max(radius, length(c - center) + r);
    }
    scene.bounds_center = center;
    // A little larger against rounding; an empty scene gets a sphere of radius 1, so that distant emitters have
    // something to aim at.
    scene.bounds_radius = radius > 0 ? radius * (1 + 1e-5f) : 1.0f;
}

Receivers receivers_of(const Scene& scene) {
    const double disk = M_PI * double(scene.bounds_radius) * scene.bounds_radius;
    double area = 0;
    const SceneView view = scene.view();
    std::vector<double> group_areas(scene.groups.size());
    for (size_t g = 0; g < scene.groups.size(); ++g)
        for (uint32_t i = 0; i < scene.groups[g].triangle_count; ++i)
            group_areas[g] += triangle_area(scene, scene.triangles[scene.groups[g].first_triangle + i]);
    for (const Shape& shape : scene.shapes)
        if (shape.first_primitive < view.ungrouped_count() || shape.first_primitive >= view.triangle_count)
            area += double(shape.area);
    // About: of a scale that is the same along all axes.
    for (const Instance& i : scene.instances)
        area += group_areas[i.group] * std::pow(std::fabs(volume_scale(i)), 2. / 3);
    if (!(area > 0)) return {disk, 4 * disk};
    return {std::min(disk, area), std::min(4 * disk, 2 * area)};
}

}  // namespace ambilux
