#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/error.h"
#include "core/math.h"
#include "formats/meshes/mesh.h"

namespace ambilux {
namespace {

/// Faces around one point: their vertices are found in time of its square.
constexpr size_t kMostFacesAtPoint = 4096;

struct CutCorner {
    Vec3f p;
    Vec2f uv;
    uint32_t face, corner;

    auto place() const { return std::tie(p.x, p.y, p.z, uv.x, uv.y); }
};

Vec3f face_normal(const Mesh& mesh, const std::array<uint32_t, 3>& f) {
    const Vec3f a = mesh.positions[f[0]];
    const Vec3f n = cross(mesh.positions[f[1]] - a, mesh.positions[f[2]] - a);
    const float l2 = length_squared(n);
    return l2 > 0 && l2 < kInfinity ? normalize(n) : Vec3f{0, 0, 0};
}

}  // namespace

Mesh split_at_edges(const std::string& path, const Mesh& mesh, double degrees) {
    const float least = float(std::cos(degrees * (M_PI / 180)));
    std::vector<Vec3f> normals;
    std::vector<CutCorner> corners;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        normals.push_back(face_normal(mesh, mesh.faces[f]));
        for (uint32_t c = 0; c < 3; ++c) {
            const uint32_t v = mesh.faces[f][c];
            corners.push_back({mesh.positions[v], mesh.uvs.empty() ? Vec2f{0, 0} : mesh.uvs[v], f, c});
        }
    }
    std::stable_sort(corners.begin(), corners.end(),
                     [](const CutCorner& a, const CutCorner& b) { return a.place() < b.place(); });
    Mesh out;
    out.faces = mesh.faces;
    const auto is_same_side = [&](Vec3f a, Vec3f b) { return a == b || dot(a, b) > least; };
    for (size_t begin = 0, end; begin < corners.size(); begin = end) {
        for (end = begin + 1; end < corners.size() && corners[end].place() == corners[begin].place();) ++end;
        if (end - begin > kMostFacesAtPoint)
            throw input_error(path, 0,
                              "max_smooth_angle: more than " + std::to_string(kMostFacesAtPoint) +
                                  " corners of faces of a mesh lie at one point");
        std::vector<bool> done(end - begin, false);
        for (size_t i = begin; i < end; ++i) {
            if (done[i - begin]) continue;
            const uint32_t vertex = uint32_t(out.positions.size());
            out.positions.push_back(corners[i].p);
            if (!mesh.uvs.empty()) out.uvs.push_back(corners[i].uv);
            for (size_t k = i; k < end; ++k) {
                const CutCorner& c = corners[k];
                if (done[k - begin] || !is_same_side(normals[corners[i].face], normals[c.face])) continue;
                out.faces[c.face][c.corner] = vertex;
                done[k - begin] = true;
            }
        }
    }
    return out;
}

}  // namespace ambilux
