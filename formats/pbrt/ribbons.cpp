// Curves of type "ribbon": strips that face directions of their own.
#include <algorithm>
#include <cmath>

#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

constexpr int kSteps = 16;  // a segment

Vec3d operator+(Vec3d a, Vec3d b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec3d operator*(Vec3d a, double s) { return {a.x * s, a.y * s, a.z * s}; }

/// From the unit vectors `a` to `b` at a steady angle.
Vec3d turned(Vec3d a, Vec3d b, double u) {
    const double angle = std::acos(std::clamp(dot(a, b), -1.0, 1.0)), sine = std::sin(angle);
    if (!(sine > 1e-9)) return a;
    return a * (std::sin((1 - u) * angle) / sine) + b * (std::sin(u * angle) / sine);
}

Vec3d unit(Vec3d v, const Where& where) {
    if (!(length(v) > 0)) fail(where, "a normal is zero");
    return v * (1 / length(v));
}

Vec3f rounded(Vec3d v) { return {float(v.x), float(v.y), float(v.z)}; }

/// Place, direction and half width at `x` of a segment of B-splines.
struct Spot {
    Vec3d place{}, tangent{};
    double half = 0;

    Spot(const CurvePoint* c, double x) {
        const double y = 1 - x;
        const double w[4] = {y * y * y / 6, (4 - 6 * x * x + 3 * x * x * x) / 6, (4 - 6 * y * y + 3 * y * y * y) / 6,
                             x * x * x / 6};
        const double dw[4] = {-y * y / 2, (3 * x * x - 4 * x) / 2, (4 * y - 3 * y * y) / 2, x * x / 2};
        for (int j = 0; j < 4; ++j) {
            const Vec3d p{c[j].p[0], c[j].p[1], c[j].p[2]};
            place = place + p * w[j], tangent = tangent + p * dw[j];
            half += c[j].radius * w[j];
        }
    }
};

}  // namespace

Mesh ribbon_mesh(SceneMaker& scene, const Parameters& in) {
    const std::vector<double> normals = in.numbers("N", 3);
    const std::vector<Curve> curves = read_curve(scene, in);
    size_t segments = 0;
    for (const Curve& curve : curves) segments += curve.size() - 3;
    if (normals.size() != 3 * (segments + 1))
        fail(in.where, "a ribbon of " + std::to_string(segments) + " segments needs " + std::to_string(segments + 1) +
                           " normals N, not " + std::to_string(normals.size() / 3));
    const auto normal = [&](size_t k) {
        return unit({normals[3 * k], normals[3 * k + 1], normals[3 * k + 2]}, in.where_of("N"));
    };
    scene.report.note(in.where, "ribbons are strips of " + std::to_string(kSteps) + " pieces a segment");
    Mesh mesh;
    size_t segment = 0;
    for (const Curve& curve : curves)
        for (size_t i = 0; i + 3 < curve.size(); ++i, ++segment)
            for (int k = 0; k <= kSteps; ++k) {
                const double x = double(k) / kSteps;
                const Spot at(&curve[i], x);
                const Vec3d n = turned(normal(segment), normal(segment + 1), x);
                Vec3d side = cross(n, at.tangent);
                if (length(side) > 0) side = side * (at.half / length(side));
                for (const double v : {0.0, 1.0}) {
                    mesh.positions.push_back(rounded(at.place + side * (2 * v - 1)));
                    mesh.normals.push_back(rounded(cross(at.tangent, side)));
                    mesh.uvs.push_back({float((double(segment) + x) / double(segments)), float(v)});
                }
                const uint32_t next = uint32_t(mesh.positions.size()) - 2, last = next - 2;
                if (k == 0) continue;
                mesh.faces.push_back({last, next, next + 1});
                mesh.faces.push_back({last, next + 1, last + 1});
            }
    return mesh;
}

}  // namespace ambilux::pbrt
