#include "formats/meshes/curves.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/file_budget.h"

namespace ambilux {

namespace {

struct V {
    double x, y, z;
};
V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
V operator*(V a, double s) { return {a.x * s, a.y * s, a.z * s}; }
double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
V normalized(V a) {
    const double l = std::sqrt(dot(a, a));
    return l > 0 ? a * (1 / l) : V{0, 0, 0};
}
V position(const CurvePoint& c) { return {c.p[0], c.p[1], c.p[2]}; }
Vec3f rounded(V a) { return {float(a.x), float(a.y), float(a.z)}; }

/// Any unit vector across `t`.
V across(V t) { return normalized(cross(t, std::fabs(t.x) < 0.5 * std::sqrt(dot(t, t)) ? V{1, 0, 0} : V{0, 1, 0})); }

/// Rings of vertices, each joined with the next. A polygon is as wide on average as the circle that it stands for.
struct Tube {
    Mesh& mesh;
    uint32_t sides;

    double wide() const { return (M_PI / sides) / std::sin(M_PI / sides); }
    /// `normal(direction)`: of the surface where `direction` points from the centre.
    template <class Normal>
    void ring(V center, V s, V t, double radius, double v, bool joined, Normal normal) {
        for (uint32_t i = 0; i <= sides; ++i) {
            const double phi = 2 * M_PI * i / sides;
            const V d = s * std::cos(phi) + t * std::sin(phi);
            mesh.positions.push_back(rounded(center + d * (radius * wide())));
            mesh.normals.push_back(rounded(normal(d)));
            mesh.uvs.push_back({float(i) / float(sides), float(v)});
        }
        if (!joined) return;
        const uint32_t above = uint32_t(mesh.positions.size()) - sides - 1, below = above - sides - 1;
        for (uint32_t i = 0; i < sides; ++i) {
            mesh.faces.push_back({below + i, below + i + 1, above + i + 1});
            mesh.faces.push_back({below + i, above + i + 1, above + i});
        }
    }
};

void add_sphere(Tube& tube, V center, double radius) {
    const uint32_t rows = std::max(tube.sides / 2, 3u);
    for (uint32_t k = 0; k <= rows; ++k) {
        const double theta = M_PI * (1 - double(k) / rows), r = std::max(std::sin(theta), 0.0);
        const double z = std::cos(theta);
        // Poles have no width; their triangles without area are left out later.
        tube.ring(center + V{0, 0, z * radius * tube.wide()}, {1, 0, 0}, {0, 1, 0},
                  k == 0 || k == rows ? 0 : radius * r, 0, k > 0, [&](V d) { return d * r + V{0, 0, z}; });
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
        double* const numbers[4] = {&point.p[0], &point.p[1], &point.p[2], &point.radius};
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

uint32_t sides_of_curves(uint64_t segments) { return segments <= 2000 ? 32 : segments <= 50000 ? 12 : 6; }

Mesh mesh_of_linear_curves(const std::vector<Curve>& curves) {
    Mesh mesh;
    uint64_t segments = 0;
    for (const Curve& curve : curves) segments += curve.size() - 1;
    Tube tube{mesh, sides_of_curves(segments)};
    uint64_t index = 0;
    for (const Curve& curve : curves)
        for (size_t i = 0; i < curve.size(); ++i) {
            add_sphere(tube, position(curve[i]), curve[i].radius);
            if (i + 1 == curve.size()) continue;
            const CurvePoint &a = curve[i], &b = curve[i + 1];
            const V axis = position(b) - position(a);
            const double length = std::sqrt(dot(axis, axis)), narrows = a.radius - b.radius;
            const double v0 = double(index) / double(segments), v1 = double(++index) / double(segments);
            if (!(length > std::fabs(narrows))) continue;  // one sphere holds the other
            // The cone touches the spheres where their normals make this angle with its axis.
            const double cosine = narrows / length, sine = std::sqrt(1 - cosine * cosine);
            const V t = axis * (1 / length), s = across(t), u = cross(t, s);
            const auto normal = [&](V d) { return d * sine + t * cosine; };
            tube.ring(position(a) + t * (a.radius * cosine), s, u, a.radius * sine, v0, false, normal);
            tube.ring(position(b) + t * (b.radius * cosine), s, u, b.radius * sine, v1, true, normal);
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
        V s{};
        for (size_t i = 0; i + 3 < curve.size(); ++i, ++index)
            for (uint32_t k = i == 0 ? 0 : 1; k <= steps; ++k) {
                const double x = double(k) / steps, y = 1 - x;
                const double w[4] = {y * y * y / 6, (4 - 6 * x * x + 3 * x * x * x) / 6,
                                     (4 - 6 * y * y + 3 * y * y * y) / 6, x * x * x / 6};
                const double dw[4] = {-y * y / 2, (3 * x * x - 4 * x) / 2, (4 * y - 3 * y * y) / 2, x * x / 2};
                V center{}, tangent{};
                double radius = 0, slope = 0;
                for (int j = 0; j < 4; ++j) {
                    const CurvePoint& c = curve[i + size_t(j)];
                    center = center + position(c) * w[j], tangent = tangent + position(c) * dw[j];
                    radius += c.radius * w[j], slope += c.radius * dw[j];
                }
                const double speed = std::sqrt(dot(tangent, tangent));
                const V t = normalized(tangent);
                // The frame of the ring before, turned as little as possible.
                const V kept = s - t * dot(s, t);
                s = dot(kept, kept) > 1e-12 ? normalized(kept) : across(t);
                const double v = (double(index) + x) / double(segments);
                tube.ring(center, s, cross(t, s), radius, v, i > 0 || k > 0,
                          [&](V d) { return normalized(d * speed - t * slope); });
            }
    }
    return mesh;
}

}  // namespace ambilux
