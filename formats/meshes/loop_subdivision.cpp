#include "formats/meshes/loop_subdivision.h"

#include <map>

#include "formats/file_budget.h"

namespace ambilux {

namespace {

struct Edge {
    uint32_t middle = 0;  ///< vertex made on it
    uint32_t opposite[2] = {0, 0};
    int faces = 0;
};
using Edges = std::map<std::pair<uint32_t, uint32_t>, Edge>;

std::pair<uint32_t, uint32_t> key(uint32_t a, uint32_t b) { return {std::min(a, b), std::max(a, b)}; }

Edges edges_of(const Mesh& mesh, FileBudget& budget) {
    Edges edges;
    for (const auto& f : mesh.faces)
        for (size_t i = 0; i < 3; ++i) {
            Edge& e = edges[key(f[i], f[(i + 1) % 3])];
            if (e.faces == 2) budget.fail("an edge of the mesh belongs to more than two triangles");
            e.opposite[e.faces++] = f[(i + 2) % 3];
            budget.tick();
        }
    return edges;
}

/// Neighbours of a vertex: sums of all, and of those along the boundary.
struct Ring {
    uint32_t count = 0, boundary_count = 0;
    Vec3f sum{}, boundary_sum{};
};

std::vector<Ring> rings_of(const Mesh& mesh, const Edges& edges) {
    std::vector<Ring> rings(mesh.positions.size());
    for (const auto& [ends, e] : edges)
        for (const auto& [a, b] : {std::pair{ends.first, ends.second}, {ends.second, ends.first}}) {
            ++rings[a].count;
            rings[a].sum += mesh.positions[b];
            if (e.faces == 1) ++rings[a].boundary_count, rings[a].boundary_sum += mesh.positions[b];
        }
    return rings;
}

float weight(uint32_t valence) { return valence == 3 ? 3.0f / 16 : 3.0f / (8.0f * float(valence)); }

Mesh refine(const Mesh& mesh, FileBudget& budget) {
    Edges edges = edges_of(mesh, budget);
    const std::vector<Ring> rings = rings_of(mesh, edges);
    budget.bytes(mesh_bytes(mesh.positions.size() + edges.size(), 4 * mesh.faces.size()));
    Mesh out;
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
        const Ring& r = rings[v];
        const Vec3f p = mesh.positions[v];
        const float w = r.count ? weight(r.count) : 0;
        out.positions.push_back(r.boundary_count ? p * 0.75f + r.boundary_sum * (0.25f / float(r.boundary_count))
                                                 : p * (1 - w * float(r.count)) + r.sum * w);
    }
    for (auto& [ends, e] : edges) {
        const Vec3f both = mesh.positions[ends.first] + mesh.positions[ends.second];
        e.middle = uint32_t(out.positions.size());
        out.positions.push_back(
            e.faces == 1 ? both * 0.5f
                         : both * 0.375f + (mesh.positions[e.opposite[0]] + mesh.positions[e.opposite[1]]) * 0.125f);
    }
    for (const auto& f : mesh.faces) {
        const uint32_t a = edges[key(f[0], f[1])].middle, b = edges[key(f[1], f[2])].middle,
                       c = edges[key(f[2], f[0])].middle;
        out.faces.insert(out.faces.end(), {{f[0], a, c}, {a, f[1], b}, {c, b, f[2]}, {a, b, c}});
    }
    return out;
}

}  // namespace

Mesh subdivide_loop(const std::string& path, const Mesh& mesh, int levels, const Limits& limits) {
    FileBudget budget(path, limits);
    Mesh out;
    out.positions = mesh.positions;
    out.faces = mesh.faces;
    for (int i = 0; i < levels; ++i) out = refine(out, budget);
    const std::vector<Ring> rings = rings_of(out, edges_of(out, budget));
    std::vector<Vec3f> limit;
    for (size_t v = 0; v < out.positions.size(); ++v) {
        const Ring& r = rings[v];
        const Vec3f p = out.positions[v];
        const float w = r.count ? 1 / (float(r.count) + 3 / (8 * weight(r.count))) : 0;
        limit.push_back(r.boundary_count ? p * 0.6f + r.boundary_sum * (0.4f / float(r.boundary_count))
                                         : p * (1 - w * float(r.count)) + r.sum * w);
    }
    out.positions = std::move(limit);
    out.normals = smooth_normals(out);
    return out;
}

}  // namespace ambilux
