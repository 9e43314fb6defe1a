// Curves of type "ribbon": strips that face directions of their own.
#include <algorithm>
#include <cmath>

#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

constexpr int kSteps = 16;  // a segment

/// From the unit vectors `a` to `b` at a steady angle.
Vec3d turned(Vec3d a, Vec3d b, double u) {
    const double angle = std::acos(std::clamp(dot(a, b), -1.0, 1.0)), sine = std::sin(angle);
    if (!(sine > 1e-9)) return a;
    return a * (std::sin((1 - u) * angle) / sine) + b * (std::sin(u * angle) / sine);
}

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
        const Vec3d n = {normals[3 * k], normals[3 * k + 1], normals[3 * k + 2]};
        if (!(length(n) > 0)) fail(in.where_of("N"), "a normal is zero");
        return n * (1 / length(n));
    };
    scene.report.note(in.where, "ribbons are strips of " + std::to_string(kSteps) + " pieces a segment");
    Mesh mesh;
    size_t segment = 0;
    for (const Curve& curve : curves)
        for (size_t i = 0; i + 3 < curve.size(); ++i, ++segment)
            for (int k = 0; k <= kSteps; ++k) {
                const double x = double(k) / kSteps;
                const SplinePlace at = spline_at(&curve[i], x);
                const Vec3d n = turned(normal(segment), normal(segment + 1), x);
                Vec3d side = cross(n, at.tangent);
                if (length(side) > 0) side = side * (at.radius / length(side));
                for (const double v : {0.0, 1.0}) {
                    mesh.positions.push_back(rounded(at.center + side * (2 * v - 1)));
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
