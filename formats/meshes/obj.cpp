#include <cstring>
#include <unordered_map>

#include "core/error.h"
#include "formats/file_budget.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/text_cursor.h"

namespace ambilux {

namespace {

constexpr uint32_t kAbsent = 0xffffffffu;

/// Indices of a corner into the file's three lists, from 0.
struct Corner {
    uint32_t v, vt, vn;
    bool operator==(const Corner&) const = default;
};

struct CornerHash {
    size_t operator()(const Corner& c) const {
        const uint64_t h = c.v * 0x9E3779B97F4A7C15ull ^ c.vt * 0xC2B2AE3D27D4EB4Full ^ c.vn * 0x165667B19E3779F9ull;
        return h ^ h >> 29;
    }
};

struct ObjReader {
    const std::string& path;
    TextCursor text;
    std::vector<Vec3f> positions, normals;
    std::vector<Vec2f> uvs;

    [[noreturn]] void fail(const std::string& message) const { throw input_error(path, text.line, message); }

    float coordinate(const char* statement) {
        text.skip_blanks();
        float value = 0;
        if (!text.number(value)) fail(std::string("expected a number in '") + statement + "'");
        return value;
    }

    /// Resolves a 1-based or negative index against a list of `count` entries.
    uint32_t resolve(int64_t index, size_t count, const char* what) const {
        const int64_t zero_based = index > 0 ? index - 1 : int64_t(count) + index;
        if (index == 0 || zero_based < 0 || zero_based >= int64_t(count))
            fail(std::string(what) + " index " + std::to_string(index) + " is out of range (" + std::to_string(count) +
                 " so far)");
        return uint32_t(zero_based);
    }

    Corner corner() {
        Corner c = {kAbsent, kAbsent, kAbsent};
        int64_t index = 0;
        if (!text.number(index)) fail("expected a vertex index in 'f'");
        c.v = resolve(index, positions.size(), "vertex");
        if (text.at < text.end && *text.at == '/') {
            ++text.at;
            if (text.at < text.end && *text.at != '/') {
                if (!text.number(index)) fail("expected a texture coordinate index in 'f'");
                c.vt = resolve(index, uvs.size(), "texture coordinate");
            }
            if (text.at < text.end && *text.at == '/') {
                ++text.at;
                if (!text.number(index)) fail("expected a normal index in 'f'");
                c.vn = resolve(index, normals.size(), "normal");
            }
        }
        return c;
    }
};

/// Corners without a normal in a file that has some: those faces are flat, with vertices of their own. `corners`: of
/// each vertex.
void flatten_faces(Mesh& mesh, std::vector<Corner>& corners) {
    for (auto& face : mesh.faces) {
        const Vec3f n =
            cross(mesh.positions[face[1]] - mesh.positions[face[0]], mesh.positions[face[2]] - mesh.positions[face[0]]);
        for (uint32_t& v : face) {
            if (corners[v].vn != kAbsent) continue;
            corners.push_back(corners[v]);
            mesh.positions.push_back(mesh.positions[v]);
            mesh.normals.push_back(n);
            if (!mesh.uvs.empty()) mesh.uvs.push_back(mesh.uvs[v]);
            v = uint32_t(mesh.positions.size() - 1);
        }
    }
}

}  // namespace

Mesh read_obj(const std::string& path, std::string_view bytes, bool flip_v, const Limits& limits) {
    FileBudget budget(path, limits);
    ObjReader in{path, TextCursor(bytes), {}, {}, {}};
    std::unordered_map<Corner, uint32_t, CornerHash> vertex_of;
    std::vector<Corner> corners;  ///< of each vertex
    Mesh mesh;
    std::vector<uint32_t> polygon;
    bool some_normals = false, some_uvs = false, lacks_normals = false;

    for (; !in.text.done(); in.text.next_line()) {
        budget.tick();
        const std::string_view keyword = in.text.word();
        if (keyword == "v") {
            const float x = in.coordinate("v"), y = in.coordinate("v"), z = in.coordinate("v");
            in.positions.push_back({x, y, z});
        } else if (keyword == "vn") {
            const float x = in.coordinate("vn"), y = in.coordinate("vn"), z = in.coordinate("vn");
            in.normals.push_back({x, y, z});
        } else if (keyword == "vt") {
            const float u = in.coordinate("vt");
            const float v = in.text.at_line_end() ? 0.0f : in.coordinate("vt");
            in.uvs.push_back({u, flip_v ? 1 - v : v});
        } else if (keyword == "f") {
            polygon.clear();
            while (!in.text.at_line_end()) {
                const Corner c = in.corner();
                some_normals |= c.vn != kAbsent;
                lacks_normals |= c.vn == kAbsent;
                some_uvs |= c.vt != kAbsent;
                const auto [vertex, is_new] = vertex_of.try_emplace(c, uint32_t(corners.size()));
                if (is_new) corners.push_back(c);
                polygon.push_back(vertex->second);
            }
            if (polygon.size() < 3) in.fail("a face needs at least three corners");
            for (size_t i = 2; i < polygon.size(); ++i) mesh.faces.push_back({polygon[0], polygon[i - 1], polygon[i]});
            budget.bytes(mesh_bytes(corners.size(), mesh.faces.size()));
        }
    }

    for (const Corner& c : corners) {
        mesh.positions.push_back(in.positions[c.v]);
        if (some_uvs) mesh.uvs.push_back(c.vt == kAbsent ? Vec2f{0, 0} : in.uvs[c.vt]);
        if (some_normals) mesh.normals.push_back(c.vn == kAbsent ? Vec3f{0, 0, 0} : in.normals[c.vn]);
    }
    if (some_normals && lacks_normals) flatten_faces(mesh, corners);
    check_mesh(path, mesh);
    return mesh;
}

}  // namespace ambilux
