#include "formats/meshes/mesh.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/math.h"
#include "core/parallel.h"

namespace ambilux {

Mesh make_rectangle() {
    Mesh mesh;
    mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    mesh.faces = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

Mesh make_cube() {
    // Origin (uv = 0,0) and the directions of u and v of each face, as observed in Mitsuba; cross(u,v) is the inward
    // normal.
    struct Face {
        Vec3f origin, u, v;
    };
    const Face faces[6] = {
        {{-1, -1, -1}, {0, 0, 1}, {1, 0, 0}}, {{1, 1, 1}, {-1, 0, 0}, {0, 0, -1}},
        {{1, -1, 1}, {0, 1, 0}, {0, 0, -1}},  {{-1, -1, 1}, {0, 1, 0}, {1, 0, 0}},
        {{-1, -1, -1}, {0, 1, 0}, {0, 0, 1}}, {{-1, 1, -1}, {0, -1, 0}, {1, 0, 0}},
    };
    const Vec2f corner[4] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
    Mesh mesh;
    for (const Face& face : faces) {
        const uint32_t first = uint32_t(mesh.positions.size());
        for (Vec2f uv : corner) {
            mesh.positions.push_back(face.origin + face.u * (2 * uv.x) + face.v * (2 * uv.y));
            mesh.uvs.push_back(uv);
        }
        mesh.faces.push_back({first, first + 1, first + 2});
        mesh.faces.push_back({first, first + 2, first + 3});
    }
    return mesh;
}

std::vector<Vec3f> smooth_normals(const Mesh& mesh) {
    using Parts = std::array<Vec3f, 3>;  // what a face adds to its vertices
    const auto parts_of = [&](const std::array<uint32_t, 3>& face) {
        const Vec3f p[3] = {mesh.positions[face[0]], mesh.positions[face[1]], mesh.positions[face[2]]};
        const Vec3f n = cross(p[1] - p[0], p[2] - p[0]);
        Parts parts{};
        if (!(length_squared(n) > 0)) return parts;
        const Vec3f unit = normalize(n);
        for (size_t i = 0; i < 3; ++i) {
            const Vec3f a = p[(i + 1) % 3] - p[i], b = p[(i + 2) % 3] - p[i];
            parts[i] = unit * atan2f(length(cross(a, b)), dot(a, b));
        }
        return parts;
    };
    std::vector<Vec3f> sums(mesh.positions.size(), Vec3f{0, 0, 0});
    // Block by block: all threads compute, one adds, in the order of the faces.
    constexpr size_t kBlock = 65536;
    std::vector<Parts> block(std::min(kBlock, mesh.faces.size()));
    for (size_t first = 0; first < mesh.faces.size(); first += kBlock) {
        const size_t count = std::min(kBlock, mesh.faces.size() - first);
        parallel_for(count, [&](size_t i) { block[i] = parts_of(mesh.faces[first + i]); }, size_t(1024));
        for (size_t i = 0; i < count; ++i)
            for (size_t k = 0; k < 3; ++k) sums[mesh.faces[first + i][k]] += block[i][k];
    }
    for (Vec3f& n : sums)
        if (length_squared(n) > 0) n = normalize(n);
    return sums;
}

uint32_t append_vertex(Mesh& to, const Mesh& from, uint32_t v) {
    to.positions.push_back(from.positions[v]);
    if (!from.normals.empty()) to.normals.push_back(from.normals[v]);
    if (!from.uvs.empty()) to.uvs.push_back(from.uvs[v]);
    for (size_t i = 0; i < to.attributes.size(); ++i)
        if (!to.attributes[i].per_face) to.attributes[i].values.push_back(from.attributes[i].values[v]);
    return uint32_t(to.positions.size() - 1);
}

Mesh with_own_corners(const Mesh& mesh) {
    Mesh out;
    out.origin = mesh.origin;
    for (const auto& face : mesh.faces) {
        const uint32_t first = uint32_t(out.positions.size());
        for (const uint32_t v : face) append_vertex(out, mesh, v);
        out.faces.push_back({first, first + 1, first + 2});
    }
    out.uvs.clear();
    return out;
}

void add_grid_faces(Mesh& mesh, uint32_t first, uint32_t nx, uint32_t ny) {
    for (uint32_t j = 0; j < ny; ++j)
        for (uint32_t i = 0; i < nx; ++i) {
            const uint32_t a = first + j * (nx + 1) + i, b = a + 1, c = a + nx + 1, d = c + 1;
            mesh.faces.insert(mesh.faces.end(), {{a, b, d}, {a, d, c}});
        }
}

uint64_t mesh_bytes(uint64_t vertices, uint64_t triangles) {
    return vertices * (2 * sizeof(Vec3f) + sizeof(Vec2f)) + triangles * sizeof(std::array<uint32_t, 3>);
}

void set_positions(Mesh& mesh, const std::vector<std::array<double, 3>>& points) {
    constexpr double kFar = 16;  // half extents: four bits
    std::array<double, 3> lower, upper, middle;
    lower.fill(INFINITY), upper.fill(-INFINITY);
    for (const auto& p : points)
        for (size_t k = 0; k < 3; ++k) lower[k] = std::min(lower[k], p[k]), upper[k] = std::max(upper[k], p[k]);
    double extent = 0, away = 0;
    for (size_t k = 0; k < 3; ++k) {
        middle[k] = 0.5 * (lower[k] + upper[k]);
        extent = std::max(extent, 0.5 * (upper[k] - lower[k]));
        away = std::max(away, std::fabs(middle[k]));
    }
    if (away > kFar * extent && std::isfinite(away)) mesh.origin = middle;
    mesh.positions.resize(points.size());
    for (size_t i = 0; i < points.size(); ++i)
        for (size_t k = 0; k < 3; ++k) mesh.positions[i][int(k)] = float(points[i][k] - mesh.origin[k]);
}

void check_mesh(const std::string& path, Mesh& mesh) {
    const auto fail = [&](const std::string& message) { throw input_error(path, 0, message); };
    if (mesh.faces.empty()) fail("the mesh has no faces");
    for (const size_t count : {mesh.normals.size(), mesh.uvs.size()})
        if (count != 0 && count != mesh.positions.size())
            fail("normals or texture coordinates are given for " + std::to_string(count) + " of " +
                 std::to_string(mesh.positions.size()) + " vertices");
    for (size_t i = 0; i < mesh.positions.size(); ++i)
        if (!is_finite(mesh.positions[i])) fail("position of vertex " + std::to_string(i) + " is not finite");
    size_t bad_normals = 0;
    for (Vec3f& n : mesh.normals)
        if (!is_finite(n)) n = {0, 0, 0}, ++bad_normals;
    if (bad_normals > 0)
        mesh.notes.push_back("normals that are not finite are replaced by the triangle's: " +
                             std::to_string(bad_normals));
    for (size_t i = 0; i < mesh.uvs.size(); ++i)
        if (!is_finite(Vec3f{mesh.uvs[i].x, mesh.uvs[i].y, 0}))
            fail("texture coordinate of vertex " + std::to_string(i) + " is not finite");
    for (size_t i = 0; i < mesh.faces.size(); ++i)
        for (uint32_t v : mesh.faces[i])
            if (v >= mesh.positions.size())
                fail("face " + std::to_string(i) + " refers to vertex " + std::to_string(v) + " of " +
                     std::to_string(mesh.positions.size()));
}

}  // namespace ambilux
