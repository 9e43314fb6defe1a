#include <set>

#include "core/error.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/file_budget.h"
#include "formats/meshes/corners.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/polygons.h"

namespace ambilux {

namespace {

/// An index of what a corner has not; others count the file's lists from 0.
constexpr uint32_t kAbsent = 0xffffffffu;

struct ObjReader {
    const std::string& path;
    TextCursor text;
    bool wants_colors;
    std::vector<std::array<double, 3>> positions;
    std::vector<Rgb> colors;  ///< of positions
    std::vector<Vec3f> normals;
    std::vector<Vec2f> uvs;
    std::set<std::string> unused;                   ///< what the file has beside the mesh
    uint64_t names_no_uv = 0, names_no_normal = 0;  ///< the first line that names one before the file has any

    [[noreturn]] void fail(const std::string& message) const { throw input_error(path, text.line, message); }
    Vec3d place(uint32_t v) const { return {positions[v][0], positions[v][1], positions[v][2]}; }

    /// A backslash at the end of a line stands for a blank, and '#' begins a comment.
    bool at_end() {
        text.skip_blanks();
        while (text.at < text.end && *text.at == '\\') {
            TextCursor rest = text;
            ++rest.at;
            if (!rest.at_line_end()) break;
            rest.next_line();
            text = rest;
            text.skip_blanks();
        }
        return text.done() || *text.at == '\n' || *text.at == '#';
    }
    /// Without a backslash at the end of the line.
    std::string_view word() {
        std::string_view result = text.word();
        if (result.size() > 1 && result.back() == '\\') result.remove_suffix(1), --text.at;
        return result;
    }
    /// Behind the rest of the statement.
    void next_statement() {
        while (!at_end()) word();
        text.next_line();
    }

    template <class T = float>
    T coordinate(const char* statement) {
        T value = 0;
        if (at_end() || !text.number(value)) fail(std::string("expected a number in '") + statement + "'");
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

    /// Index behind a '/', or none: exporters write slashes without an index behind them, and indices of what the file
    /// has none of.
    uint32_t next_index(size_t count, const char* what, uint64_t& names_none) {
        if (text.at >= text.end || *text.at != '/') return kAbsent;
        ++text.at;
        int64_t index = 0;
        if (at_corner_end() || *text.at == '/') return kAbsent;
        if (!text.number(index)) fail(std::string("expected a ") + what + " index in 'f'");
        if (count == 0 && names_none == 0) names_none = text.line;
        return count == 0 ? kAbsent : resolve(index, count, what);
    }
    bool at_corner_end() const {
        return text.done() || std::string_view(" \t\n#\\").find(*text.at) != std::string_view::npos;
    }

    Corner corner() {
        int64_t index = 0;
        if (!text.number(index)) fail("expected a vertex index in 'f'");
        const uint32_t v = resolve(index, positions.size(), "vertex");
        const uint32_t vt = next_index(uvs.size(), "texture coordinate", names_no_uv);
        const uint32_t vn = next_index(normals.size(), "normal", names_no_normal);
        if (!at_corner_end()) fail("expected a blank behind a corner in 'f'");
        return {v, vt, vn};
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
            v = append_vertex(mesh, mesh, v);
            mesh.normals[v] = n;
        }
    }
}

/// A statement of another kind.
void leave_out(ObjReader& in, std::string_view keyword) {
    static const std::string without_effect =
        " o g s usemtl mtllib usemap maplib lod mg bevel c_interp d_interp shadow_obj trace_obj ctech stech ";
    constexpr size_t kMost = 8, kLongest = 16;
    const std::string word(keyword.substr(0, kLongest));
    if (in.unused.size() < kMost && without_effect.find(" " + word + " ") == std::string::npos)
        in.unused.insert("'" + word + "'");
}

void read_vertex(ObjReader& in) {
    const double x = in.coordinate<double>("v"), y = in.coordinate<double>("v"), z = in.coordinate<double>("v");
    in.positions.push_back({x, y, z});
    Rgb color{};
    int more = 0;  // one is a weight, three are a colour
    for (; !in.at_end(); ++more)
        if (in.wants_colors && more < 3)
            color[more] = in.coordinate("v");
        else
            in.word();
    if (more < 3) return;
    if (in.wants_colors)
        in.colors.push_back(color);
    else
        in.unused.insert("colours of vertices");
}

/// The vertices of a face; new ones are added to `corners`.
void read_polygon(ObjReader& in, CornerMap& vertex_of, std::vector<Corner>& corners, std::vector<uint32_t>& polygon) {
    polygon.clear();
    while (!in.at_end()) {
        const Corner c = in.corner();
        const auto [vertex, is_new] = vertex_of.try_emplace(c, uint32_t(corners.size()));
        if (is_new) corners.push_back(c);
        polygon.push_back(vertex->second);
    }
}

void add_colors(const ObjReader& in, const std::vector<Corner>& corners, Mesh& mesh) {
    if (in.colors.empty()) return;
    if (in.colors.size() != in.positions.size())
        throw input_error(in.path, 0,
                          "colours are given for " + std::to_string(in.colors.size()) + " of " +
                              std::to_string(in.positions.size()) + " vertices");
    MeshAttribute& attribute = mesh.attributes.emplace_back();
    attribute.name = "vertex_color";
    attribute.channels = 3;
    for (const Corner& c : corners) attribute.values.push_back(in.colors[c.v]);
}

/// Of indices before the file had any of the kind, all are left out, or none.
void note_absent(const ObjReader& in, uint64_t line, bool has_some, const char* what, Mesh& mesh) {
    if (line == 0) return;
    if (has_some) throw input_error(in.path, line, std::string(what) + " are named before the first of them");
    mesh.notes.push_back(std::string("faces have indices of ") + what + ", which the obj file lacks");
}

void add_notes(const ObjReader& in, const PolygonCutter& cutter, Mesh& mesh) {
    note_absent(in, in.names_no_uv, !in.uvs.empty(), "texture coordinates", mesh);
    note_absent(in, in.names_no_normal, !in.normals.empty(), "normals", mesh);
    cutter.add_notes(mesh.notes);
    if (in.unused.empty()) return;
    std::string list;
    for (const std::string& what : in.unused) list += (list.empty() ? "" : ", ") + what;
    mesh.notes.push_back("the obj file has unused data: " + list);
}

}  // namespace

Mesh read_obj(const std::string& path, std::string_view bytes, bool flip_v, const Limits& limits,
              const std::set<std::string>& attributes) {
    FileBudget budget(path, limits);
    std::string store;
    ObjReader in{path, TextCursor(plain_text(path, bytes, store)), attributes.contains("vertex_color"), {}, {}, {}, {},
                 {}};
    CornerMap vertex_of;
    std::vector<Corner> corners;  ///< of each vertex
    Mesh mesh;
    PolygonCutter cutter;
    std::vector<uint32_t>& polygon = cutter.polygon;
    bool some_normals = false, some_uvs = false, lacks_normals = false;

    for (; !in.text.done(); in.next_statement()) {
        budget.tick();
        if (in.at_end()) continue;
        const std::string_view keyword = in.word();
        if (keyword == "v") {
            read_vertex(in);
        } else if (keyword == "vn") {
            const float x = in.coordinate("vn"), y = in.coordinate("vn"), z = in.coordinate("vn");
            in.normals.push_back({x, y, z});
        } else if (keyword == "vt") {
            const float u = in.coordinate("vt");
            const float v = in.at_end() ? 0.0f : in.coordinate("vt");
            in.uvs.push_back({u, flip_v ? 1 - v : v});
        } else if (keyword == "f" || keyword == "fo") {
            read_polygon(in, vertex_of, corners, polygon);
            if (polygon.size() > 2)
                for (uint32_t v : polygon) {
                    some_normals |= corners[v].vn != kAbsent;
                    lacks_normals |= corners[v].vn == kAbsent;
                    some_uvs |= corners[v].vt != kAbsent;
                }
            cutter.add_to(mesh.faces, [&](uint32_t v) { return in.place(corners[v].v); });
            budget.bytes(mesh_bytes(corners.size(), mesh.faces.size()));
        } else {
            leave_out(in, keyword);
        }
    }

    std::vector<std::array<double, 3>> points;
    for (const Corner& c : corners) {
        points.push_back(in.positions[c.v]);
        if (some_uvs) mesh.uvs.push_back(c.vt == kAbsent ? Vec2f{0, 0} : in.uvs[c.vt]);
        if (some_normals) mesh.normals.push_back(c.vn == kAbsent ? Vec3f{0, 0, 0} : in.normals[c.vn]);
    }
    set_positions(mesh, points);
    add_colors(in, corners, mesh);
    if (some_normals && lacks_normals) flatten_faces(mesh, corners);
    add_notes(in, cutter, mesh);
    check_mesh(path, mesh);
    return mesh;
}

}  // namespace ambilux
