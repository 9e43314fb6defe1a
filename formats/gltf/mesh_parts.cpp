// Meshes cut into parts that need materials of their own.
#include <array>
#include <cmath>
#include <map>

#include "formats/gltf/model.h"

namespace ambilux::gltf {

namespace {

/// The vertices of these faces and them. Attributes are left out.
Mesh mesh_of_faces(const Mesh& from, const std::vector<std::array<uint32_t, 3>>& faces) {
    Mesh out;
    std::vector<uint32_t> place(from.positions.size(), ~0u);
    for (const auto& face : faces) {
        std::array<uint32_t, 3> to;
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t i = face[k];
            if (place[i] == ~0u) place[i] = append_vertex(out, from, i);
            to[k] = place[i];
        }
        out.faces.push_back(to);
    }
    return out;
}

/// True if the image of a texture is seen in a mirror from outside.
bool shows_mirror(const Mesh& mesh, const std::array<uint32_t, 3>& face) {
    const auto [a, b, c] = face;
    const Vec2f u = mesh.uvs[b] - mesh.uvs[a], v = mesh.uvs[c] - mesh.uvs[a];
    const Vec3f n = cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]);
    const float outside = mesh.normals.empty() ? 1.0f : dot(n, mesh.normals[a] + mesh.normals[b] + mesh.normals[c]);
    // v runs downwards: an image that is not mirrored turns the other way.
    return (double(u.x) * v.y - double(u.y) * v.x) * outside > 0;
}

}  // namespace

Mesh take_mirrored(Mesh& mesh, bool in_mirror) {
    if (mesh.uvs.empty() || !mesh.attributes.empty()) return {};
    std::vector<std::array<uint32_t, 3>> plain, mirrored;
    for (const auto& face : mesh.faces) (shows_mirror(mesh, face) != in_mirror ? mirrored : plain).push_back(face);
    if (mirrored.empty()) return {};
    Mesh out = mesh_of_faces(mesh, mirrored);
    mesh = mesh_of_faces(mesh, plain);
    return out;
}

std::vector<ColoredPart> parts_by_color(const Mesh& mesh, const VertexColors& colors) {
    constexpr size_t kMostParts = 256;
    struct Group {
        std::vector<std::array<uint32_t, 3>> faces;
        double sum[4] = {0, 0, 0, 0};
    };
    std::map<std::array<int, 4>, Group> groups;
    for (int steps = 64;; steps /= 2) {
        groups.clear();
        for (const auto& face : mesh.faces) {
            double mean[4] = {0, 0, 0, 0};
            for (const uint32_t i : face)
                for (size_t k = 0; k < 4; ++k)
                    mean[k] += (k < 3 ? double(colors.values[i][int(k)])
                                      : (colors.alphas.empty() ? 1.0 : double(colors.alphas[i].x))) /
                               3;
            std::array<int, 4> key;
            for (size_t k = 0; k < 4; ++k) key[k] = int(std::lround(std::sqrt(std::min(mean[k], 1e6)) * steps));
            Group& group = groups[key];
            group.faces.push_back(face);
            for (size_t k = 0; k < 4; ++k) group.sum[k] += mean[k];
        }
        if (groups.size() <= kMostParts || steps == 1) break;
    }
    std::vector<ColoredPart> out;
    for (const auto& [key, group] : groups) {
        const double n = double(group.faces.size());
        VertexColors mean;
        mean.color = {float(group.sum[0] / n), float(group.sum[1] / n), float(group.sum[2] / n)};
        mean.alpha = group.sum[3] / n;
        out.push_back({mesh_of_faces(mesh, group.faces), mean});
    }
    return out;
}

}  // namespace ambilux::gltf
