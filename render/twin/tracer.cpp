#include "render/twin/tracer.h"

#include <algorithm>

#include "render/twin/in_double/accel/ends_on_disk.h"
#include "render/twin/in_double/accel/opacity.h"
#include "render/twin/in_double/scene/primitive_bounds.h"

namespace ambilux::twin {
namespace {

constexpr uint32_t kLeafSize = 4;

/// Up to two places where a ray meets a primitive, with the parameters of Hit.
struct Crossings {
    int count = 0;
    Hit hit[2];

    void add(double t, double u, double v, uint32_t prim) { hit[count++] = {t, u, v, prim}; }
};

/// By the volumes that the ray spans with the edges (Kensler and Shirley 2006, "Optimizing Ray-Triangle Intersection
/// via Automated Search", section 2.2). The distance follows from the height over the plane, which is 0 where the
/// origin lies on the plane within rounding.
void cross_triangle(const SceneView& scene, const Ray& ray, uint32_t prim, Crossings& out) {
    const Triangle& t = scene.triangles[prim];
    const Vec3f v0 = scene.vertices[t.v0].p, v1 = scene.vertices[t.v1].p, v2 = scene.vertices[t.v2].p;
    const Vec3f a = v0 - ray.o, b = v1 - ray.o, c = v2 - ray.o;
    const double u = dot(ray.d, cross(c, b)), v = dot(ray.d, cross(a, c)), w = dot(ray.d, cross(b, a));
    if (min(u, min(v, w)) < 0 && max(u, max(v, w)) > 0) return;
    const double volume = u + v + w;
    const Vec3f n = ambilux::twin::detail::accurate_cross(v1 - v0, v2 - v0);
    const double height = dot(a, n), slope = dot(ray.d, n);
    if (volume == 0 || slope == 0 || std::abs(height) <= gamma_bound(6) * dot(abs(a), abs(n))) return;
    out.add(height / slope, v / volume, w / volume, prim);
}

/// Roots of a t² + 2 b t + c = 0 for discriminant/4 = `d` (Press et al., Numerical Recipes, 5.6). An origin on the
/// surface, where c is 0 within rounding, has left one of them behind.
int roots(double a, double b, double c, double d, bool on_surface, double (&t)[2]) {
    if (!(d >= 0)) return 0;
    if (on_surface) {
        t[0] = -2 * b / a;
        return 1;
    }
    const double q = -(b + std::copysign(std::sqrt(d), b));
    t[0] = q / a;
    t[1] = c / q;
    return 2;
}

/// Unit sphere, or the unit cylinder along z where `flat` leaves z out.
int cross_round(Vec3f o, Vec3f d, double slack, double (&t)[2]) {
    const double a = dot(d, d), b = dot(o, d), o2 = dot(o, o), c = o2 - 1;
    const Vec3f nearest = o - d * (b / a);
    return roots(a, b, c, a * (1 - dot(nearest, nearest)), std::abs(c) <= gamma_bound(8) * (o2 + 1) + slack, t);
}

void cross_quadric(const SceneView& scene, const Ray& ray, uint32_t prim, Crossings& out) {
    const Quadric& q = scene.quadric(prim);
    const Vec3f centre = {q.to_world.m[0][3], q.to_world.m[1][3], q.to_world.m[2][3]};
    const Vec3f from = ray.o - centre, o = q.to_local.vector(from), d = q.to_local.vector(ray.d);
    double t[2];
    if (q.type == PrimitiveType::disk) {
        const Vec3f row = {q.to_local.m[2][0], q.to_local.m[2][1], q.to_local.m[2][2]};
        if (d.z == 0 || std::abs(o.z) <= gamma_bound(6) * dot(abs(row), abs(from))) return;
        const double s = -o.z / d.z, x = o.x + s * d.x, y = o.y + s * d.y;
        if (x * x + y * y <= 1) out.add(s, x, y, prim);
    } else if (q.type == PrimitiveType::sphere) {
        const int n = cross_round(o, d, 0, t);
        for (int i = 0; i < n; ++i) {
            const Vec2f e = octahedral_encode(normalize(o + d * t[i]));
            out.add(t[i], e.x, e.y, prim);
        }
    } else {
        double slack = 0;  // local coordinates are sums of products that may cancel
        for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 3; ++j) slack += std::abs(o[i] * q.to_local.m[i][j] * from[j]);
        const Vec3f flat_d = {d.x, d.y, 0};
        if (is_zero(flat_d)) return;
        const int n = cross_round({o.x, o.y, 0}, flat_d, 2 * gamma_bound(5) * slack, t);
        for (int i = 0; i < n; ++i) {
            const Vec3f p = o + d * t[i];
            if (p.z >= 0 && p.z <= 1) out.add(t[i], std::atan2(p.y, p.x), p.z, prim);
        }
    }
}

/// Where a ray enters a box; more than `tmax` if it does not.
double entry(const Vec3f& lower, const Vec3f& upper, const Ray& ray, Vec3f inv, double tmax) {
    double enter = 0, leave = tmax;
    for (int k = 0; k < 3; ++k) {
        const double a = (lower[k] - ray.o[k]) * inv[k], b = (upper[k] - ray.o[k]) * inv[k];
        enter = max(enter, min(a, b));
        leave = min(leave, max(a, b) * (1 + 4 * kRoundingUnit));
    }
    return enter <= leave ? enter : kInfinity;
}

}  // namespace

Tracer::Tracer(const SceneView& scene) : scene_(scene) {
    const uint32_t n = scene.primitive_count();
    std::vector<Centre> centres(n);
    for (uint32_t i = 0; i < n; ++i) {
        const Bounds3f b = scene.is_triangle(i) ? triangle_bounds(scene, i) : quadric_bounds(scene.quadric(i));
        centres[i] = {i, (b.lower + b.upper) * 0.5};
    }
    prims_.reserve(n);
    if (n > 0) build(centres, 0, n);
}

void Tracer::build(std::vector<Centre>& centres, uint32_t first, uint32_t last) {
    Bounds3f box, middle;
    for (uint32_t i = first; i < last; ++i) {
        const uint32_t prim = centres[i].prim;
        box.extend(scene_.is_triangle(prim) ? triangle_bounds(scene_, prim) : quadric_bounds(scene_.quadric(prim)));
        middle.extend(centres[i].p);
    }
    // A box that is flat at 0 stays flat: a ray within its plane, of which no interval follows, meets nothing in it.
    const Vec3f pad = max(abs(box.lower), abs(box.upper)) * (4 * kRoundingUnit);
    const size_t at = nodes_.size();
    nodes_.push_back({box.lower - pad, box.upper + pad, uint32_t(prims_.size()), last - first});
    if (last - first <= kLeafSize) {
        for (uint32_t i = first; i < last; ++i) prims_.push_back(centres[i].prim);
        return;
    }
    const Vec3f size = middle.upper - middle.lower;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const uint32_t half = first + (last - first) / 2;
    std::nth_element(centres.begin() + first, centres.begin() + half, centres.begin() + last,
                     [&](const Centre& a, const Centre& b) { return a.p[axis] < b.p[axis]; });
    build(centres, first, half);
    nodes_[at].first = uint32_t(nodes_.size());
    nodes_[at].count = 0;
    build(centres, half, last);
}

bool Tracer::trace(const Ray& ray, bool any, Hit& hit) const {
    hit = {ray.tmax, 0, 0, kNone};
    if (nodes_.empty()) return false;
    const Vec3f inv = {1 / ray.d.x, 1 / ray.d.y, 1 / ray.d.z};
    uint32_t stack[64], depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
        const uint32_t index = stack[--depth];
        const Node& node = nodes_[index];
        if (!(entry(node.lower, node.upper, ray, inv, hit.t) < kInfinity)) continue;
        if (node.count == 0) {
            stack[depth++] = node.first;
            stack[depth++] = index + 1;
            continue;
        }
        for (uint32_t i = node.first; i < node.first + node.count; ++i) {
            const uint32_t prim = prims_[i];
            Crossings crossings;
            if (scene_.is_triangle(prim))
                cross_triangle(scene_, ray, prim, crossings);
            else if (!any || !ends_on_disk(scene_.quadric(prim), ray))
                cross_quadric(scene_, ray, prim, crossings);
            for (int k = 0; k < crossings.count; ++k) {
                const Hit& h = crossings.hit[k];
                if (!(h.t > 0 && h.t < hit.t) || !accept_hit<kAllFeatures>(scene_, ray, prim, h.u, h.v)) continue;
                if (any) return true;
                hit = h;
            }
        }
    }
    return hit.prim != kNone;
}

Hit Tracer::closest(const Ray& ray) const {
    Hit hit;
    trace(ray, false, hit);
    return hit;
}

bool Tracer::occluded(const Ray& ray) const {
    Hit hit;
    return trace(ray, true, hit);
}

}  // namespace ambilux::twin
