#include "formats/meshes/curves.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/file_budget.h"

namespace ambilux {

namespace {

/// Of length 1, or zero.
Vec3d normalized(Vec3d a) {
    const double l = length(a);
    return l > 0 ? a * (1 / l) : Vec3d{0, 0, 0};
}

/// Any unit vector across `t`.
Vec3d across(Vec3d t) {
    return normalized(cross(t, std::fabs(t.x) < 0.5 * length(t) ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
}

/// Rings of vertices, each joined with the next. A polygon is as wide on average as the circle that it stands for.
struct Tube {
    Mesh& mesh;
    uint32_t sides;

    double wide() const { return (M_PI / sides) / std::sin(M_PI / sides); }
    /// `normal(direction)`: of the surface where `direction` points from the centre.
    template <class Normal>
    void ring(Vec3d center, Vec3d s, Vec3d t, double radius, double v, bool joined, Normal normal) {
        for (uint32_t i = 0; i <= sides; ++i) {
            const double phi = 2 * M_PI * i / sides;
            const Vec3d d = s * std::cos(phi) + t * std::sin(phi);
            mesh.positions.push_back(rounded(center + d * (radius * wide())));
            mesh.normals.push_back(rounded(normal(d)));
            mesh.uvs.push_back({float(i) / float(sides), float(v)});
        }
        if (!joined) return;
        add_grid_faces(mesh, uint32_t(mesh.positions.size()) - 2 * (sides + 1), sides, 1);
    }
};

void add_sphere(Tube& tube, Vec3d center, double radius) {
    const uint32_t rows = std::max(tube.sides / 2, 3u);
    for (uint32_t k = 0; k <= rows; ++k) {
        const double theta = M_PI * (1 - double(k) / rows), r = std::max(std::sin(theta), 0.0);
        const double z = std::cos(theta);
        // Poles have no width; their triangles without area are left out later.
        tube.ring(center + Vec3d{0, 0, z * radius * tube.wide()}, {1, 0, 0}, {0, 1, 0},
                  k == 0 || k == rows ? 0 : radius * r, 0, k > 0, [&](Vec3d d) { return d * r + Vec3d{0, 0, z}; });
    }
}

}  // namespace

std::vector<Curve> read_curves(const std::string& path, std::string_view bytes, const Limits& limits) {
    FileBudget budget(path, limits);
    std::string store;
    const std::string_view text = plain_text(path, bytes, store);
    std::vector<Curve> curves;
    bool fresh = true;
    uint64_t points = 0;
    for (TextCursor cursor(text); !cursor.done(); cursor.next_line()) {
        budget.tick();
        if (cursor.at_line_end()) {
            fresh = true;
            continue;
        }
        CurvePoint point{};
        double* const numbers[4] = {&point.p.x, &point.p.y, &point.p.z, &point.radius};
        for (double* number : numbers) {
            cursor.skip_blanks();
            if (!cursor.number(*number) || !std::isfinite(*number))
                budget.fail("a line of a curve needs four numbers: x y z radius", cursor.line);
        }
        if (!(point.radius > 0)) budget.fail("the radius of a curve must be positive", cursor.line);
        if (!cursor.at_line_end()) budget.fail("more than four numbers in a line of a curve", cursor.line);
        if (fresh) curves.push_back({});
        fresh = false;
        curves.back().push_back(point);
        budget.bytes(++points, sizeof(CurvePoint));
    }
    if (curves.empty()) budget.fail("the file has no curves");
    for (const Curve& curve : curves)
        if (curve.size() < 2) budget.fail("a curve needs two points at least");
    return curves;
}

SplinePlace spline_at(const CurvePoint* points, double x) {
    const double y = 1 - x;
    const double w[4] = {y * y * y / 6, (4 - 6 * x * x + 3 * x * x * x) / 6, (4 - 6 * y * y + 3 * y * y * y) / 6,
                         x * x * x / 6};
    const double dw[4] = {-y * y / 2, (3 * x * x - 4 * x) / 2, (4 * y - 3 * y * y) / 2, x * x / 2};
    SplinePlace at;
    for (int j = 0; j < 4; ++j) {
        at.center = at.center + points[j].p * w[j], at.tangent = at.tangent + points[j].p * dw[j];
        at.radius += points[j].radius * w[j], at.slope += points[j].radius * dw[j];
    }
    return at;
}

uint32_t sides_of_curves(uint64_t segments) { return segments <= 2000 ? 32 : segments <= 50000 ? 12 : 6; }

Mesh mesh_of_linear_curves(const std::vector<Curve>& curves) {
    Mesh mesh;
    uint64_t segments = 0;
    for (const Curve& curve : curves) segments += curve.size() - 1;
    Tube tube{mesh, sides_of_curves(segments)};
    uint64_t index = 0;
    for (const Curve& curve : curves)
        for (size_t i = 0; i < curve.size(); ++i) {
            add_sphere(tube, curve[i].p, curve[i].radius);
            if (i + 1 == curve.size()) continue;
            const CurvePoint &a = curve[i], &b = curve[i + 1];
            const Vec3d axis = b.p - a.p;
            const double way = length(axis), narrows = a.radius - b.radius;
            const double v0 = double(index) / double(segments), v1 = double(++index) / double(segments);
            if (!(way > std::fabs(narrows))) continue;  // one sphere holds the other
            // The cone touches the spheres where their normals make this angle with its axis.
            const double cosine = narrows / way, sine = std::sqrt(1 - cosine * cosine);
            const Vec3d t = axis * (1 / way), s = across(t), u = cross(t, s);
            const auto normal = [&](Vec3d d) { return d * sine + t * cosine; };
            tube.ring(a.p + t * (a.radius * cosine), s, u, a.radius * sine, v0, false, normal);
            tube.ring(b.p + t * (b.radius * cosine), s, u, b.radius * sine, v1, true, normal);
        }
    return mesh;
}

Mesh mesh_of_bspline_curves(const std::string& path, const std::vector<Curve>& curves) {
    Mesh mesh;
    uint64_t segments = 0;
    for (const Curve& curve : curves) {
        if (curve.size() < 4) throw input_error(path, 0, "a B-spline curve needs four points at least");
        segments += curve.size() - 3;
    }
    Tube tube{mesh, sides_of_curves(segments)};
    const uint32_t steps = std::max(tube.sides / 3, 2u);
    uint64_t index = 0;
    for (const Curve& curve : curves) {
        Vec3d s{};
        for (size_t i = 0; i + 3 < curve.size(); ++i, ++index)
            for (uint32_t k = i == 0 ? 0 : 1; k <= steps; ++k) {
                const double x = double(k) / steps;
                const SplinePlace at = spline_at(&curve[i], x);
                const double speed = length(at.tangent);
                const Vec3d t = normalized(at.tangent);
                // The frame of the ring before, turned as little as possible.
                const Vec3d kept = s - t * dot(s, t);
                s = dot(kept, kept) > 1e-12 ? normalized(kept) : across(t);
                const double v = (double(index) + x) / double(segments);
                tube.ring(at.center, s, cross(t, s), at.radius, v, i > 0 || k > 0,
                          [&](Vec3d d) { return normalized(d * speed - t * at.slope); });
            }
    }
    return mesh;
}

}  // namespace ambilux
