#include "formats/pbrt/meshes.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "formats/meshes/loop_subdivision.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

/// Cells a side of a bilinear patch that is no parallelogram.
constexpr uint32_t kPatchCells = 8;

std::vector<Vec3f> triples(const Parameters& in, const char* name, size_t vertices = 0) {
    const std::vector<double>& numbers = in.numbers(name, 3);
    if (vertices && !numbers.empty() && numbers.size() != 3 * vertices)
        fail(in.where_of(name), std::string("'") + name + "' is given for " + std::to_string(numbers.size() / 3) +
                                    " of " + std::to_string(vertices) + " vertices");
    std::vector<Vec3f> out(numbers.size() / 3);
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = {float(numbers[3 * i]), float(numbers[3 * i + 1]), float(numbers[3 * i + 2])};
    return out;
}

std::vector<uint32_t> indices_of(const Parameters& in, size_t corners, size_t vertices) {
    std::vector<uint32_t> out;
    for (double i : in.numbers("indices", corners)) {
        if (!(i >= 0 && i < double(vertices)))
            fail(in.where_of("indices"),
                 "index " + std::to_string(int64_t(i)) + " of " + std::to_string(vertices) + " vertices");
        out.push_back(uint32_t(i));
    }
    if (out.empty() && vertices == corners)
        for (uint32_t i = 0; i < corners; ++i) out.push_back(i);
    if (out.empty()) fail(in.where, in.type + " has no indices");
    return out;
}

Mesh vertices_of(const Parameters& in) {
    Mesh mesh;
    mesh.positions = triples(in, "P");
    if (mesh.positions.empty()) fail(in.where, in.type + " has no vertices 'P'");
    mesh.normals = triples(in, "N", mesh.positions.size());
    const char* name = in.find("uv") ? "uv" : "st";
    const std::vector<double>& uvs = in.numbers(name, 2);
    if (!uvs.empty() && uvs.size() != 2 * mesh.positions.size())
        fail(in.where_of(name), "texture coordinates are given for " + std::to_string(uvs.size() / 2) + " of " +
                                    std::to_string(mesh.positions.size()) + " vertices");
    for (size_t i = 0; i < uvs.size(); i += 2) mesh.uvs.push_back({float(uvs[i]), float(uvs[i + 1])});
    return mesh;
}

}  // namespace

Mesh triangle_mesh(SceneMaker& scene, const Parameters& in) {
    Mesh mesh = vertices_of(in);
    if (in.find("S"))
        scene.report.note(in.where_of("S"), "tangents S are left out: rough surfaces turn with texture coordinates");
    in.ignore({"faceIndices"});  // of ptex
    const std::vector<uint32_t> indices = indices_of(in, 3, mesh.positions.size());
    for (size_t i = 0; i < indices.size(); i += 3) mesh.faces.push_back({indices[i], indices[i + 1], indices[i + 2]});
    return mesh;
}

Mesh with_default_uvs(const Mesh& mesh) {
    Mesh out = with_own_corners(mesh);
    for (size_t i = 0; i < out.faces.size(); ++i) out.uvs.insert(out.uvs.end(), {{0, 0}, {1, 0}, {1, 1}});
    return out;
}

Mesh bilinear_mesh(SceneMaker& scene, const Parameters& in) {
    const Mesh corners = vertices_of(in);
    in.ignore({"emissionfilename"});  // how pbrt samples the light of an image, which the light has itself
    const std::vector<uint32_t> indices = indices_of(in, 4, corners.positions.size());
    FileBudget budget(in.where.file, scene.document.limits);
    Mesh out;
    for (size_t first = 0; first < indices.size(); first += 4) {
        const uint32_t* q = indices.data() + first;  // at (u,v) = 00, 10, 01, 11
        const auto& p = corners.positions;
        const Vec3f twist = p[q[0]] + p[q[3]] - p[q[1]] - p[q[2]];
        const bool flat = length(twist) <= 1e-6f * length(p[q[3]] - p[q[0]]);
        const uint32_t n = flat && corners.normals.empty() ? 1 : kPatchCells;
        if (!flat)
            scene.report.note(in.where, "bilinear patches that are no parallelograms are 8x8 cells of two triangles");
        const uint32_t base = uint32_t(out.positions.size());
        budget.bytes(base + uint64_t(n + 1) * (n + 1), sizeof(Vec3f));
        for (uint32_t j = 0; j <= n; ++j)
            for (uint32_t i = 0; i <= n; ++i) {
                const float u = float(i) / float(n), v = float(j) / float(n);
                const float w[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
                Vec3f position{}, normal{};
                Vec2f uv{};
                for (int k = 0; k < 4; ++k) {
                    position += p[q[k]] * w[k];
                    if (!corners.normals.empty()) normal += corners.normals[q[k]] * w[k];
                    if (!corners.uvs.empty()) uv.x += corners.uvs[q[k]].x * w[k], uv.y += corners.uvs[q[k]].y * w[k];
                }
                out.positions.push_back(position);
                if (!corners.normals.empty()) out.normals.push_back(normal);
                out.uvs.push_back(corners.uvs.empty() ? Vec2f{u, v} : uv);
            }
        add_grid_faces(out, base, n, n);
    }
    return out;
}

Mesh loop_subdivision(SceneMaker& scene, const Parameters& in) {
    Mesh mesh = triangle_mesh(scene, in);
    const int64_t levels = in.integer("levels", 3);
    if (levels < 0 || levels > 12) fail(in.where_of("levels"), "levels must lie between 0 and 12");
    scene.report.note(in.where,
                      "a loopsubdiv is refined as often as it says, and its vertices moved to the limit surface");
    return subdivide_loop(in.where.text(), mesh, int(levels), scene.document.limits);
}

bool has_uvs(const std::string& path) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored)) return true;  // read_input says what is wrong with it
    std::ifstream file(path, std::ios::binary);
    std::string head(1 << 16, '\0');
    file.read(head.data(), std::streamsize(head.size()));
    head.resize(size_t(std::max<std::streamsize>(file.gcount(), 0)));
    if (head.starts_with("\x1f\x8b")) return false;  // packed
    return head.find("end_header") == std::string::npos || ply_has_uvs(path, head);
}

}  // namespace ambilux::pbrt
