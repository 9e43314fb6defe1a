#include "formats/pbrt/projection.h"

#include <cmath>

namespace ambilux::pbrt {

namespace {

using document::Matrix;

Vec2f in_texture(const Projection& projection, Vec3d p) {
    const double phi = std::atan2(p.y, p.x);
    switch (projection.kind) {
        case Projection::Kind::cylindrical: return {float((M_PI + phi) / (2 * M_PI)), float(p.z)};
        case Projection::Kind::spherical: {
            const double l = length(p), theta = l > 0 ? std::acos(std::fmin(std::fmax(p.z / l, -1), 1)) : 0;
            return {float(theta / M_PI), float((phi < 0 ? phi + 2 * M_PI : phi) / (2 * M_PI))};
        }
        default: break;
    }
    return {float(projection.ds + dot(p, projection.v1)), float(projection.dt + dot(p, projection.v2))};
}

}  // namespace

Vec2f coordinates(const Projection& projection, Vec3d world) {
    return in_texture(projection, transformed(projection.to_texture, world));
}

Mesh projected(const Mesh& mesh, const Matrix& to_world, const Projection& projection) {
    const Matrix m = projection.to_texture * to_world;
    Mesh out;
    if (projection.kind == Projection::Kind::planar) {
        out = mesh;
        out.uvs.clear();
        for (const Vec3f& p : mesh.positions) out.uvs.push_back(in_texture(projection, transformed(m, in_double(p))));
        return out;
    }
    float Vec2f::* const turn = projection.kind == Projection::Kind::cylindrical ? &Vec2f::x : &Vec2f::y;
    out = with_own_corners(mesh);
    for (const auto& face : out.faces) {
        bool on_axis[3];
        float most = 0, sum = 0;
        int count = 0;
        for (size_t k = 0; k < 3; ++k) {
            const Vec3d p = transformed(m, in_double(out.positions[face[k]]));
            on_axis[k] = std::hypot(p.x, p.y) <= 1e-6 * length(p);
            out.uvs.push_back(in_texture(projection, p));
            if (!on_axis[k]) most = std::fmax(most, out.uvs.back().*turn);
        }
        for (size_t k = 0; k < 3; ++k) {
            float& t = out.uvs[face[k]].*turn;
            if (on_axis[k]) continue;
            if (most - t > 0.5f) t += 1;  // on the other side of the seam
            sum += t, ++count;
        }
        for (size_t k = 0; k < 3; ++k)
            if (on_axis[k] && count > 0) out.uvs[face[k]].*turn = sum / float(count);
    }
    return out;
}

}  // namespace ambilux::pbrt
