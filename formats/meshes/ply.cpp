#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/math.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/file_budget.h"
#include "formats/meshes/corners.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/ply_blocks.h"
#include "formats/meshes/polygons.h"

namespace ambilux {

namespace {

using namespace ply;

struct PlyReader {
    const std::string& path;
    TextCursor text;
    Encoding encoding = Encoding::ascii;

    [[noreturn]] void fail(const std::string& message) const {
        throw input_error(path, encoding == Encoding::ascii ? text.line : 0, message);
    }

    template <class T>
    double binary() {
        if (size_t(text.end - text.at) < sizeof(T)) fail("file ends too early");
        const T value = load<T>(text.at, is_swapped(encoding));
        text.at += sizeof(T);
        return double(value);
    }

    double value(Scalar type) {
        if (encoding == Encoding::ascii) {
            text.skip_space();
            double number = 0;
            if (text.done()) fail("file ends too early");
            if (!text.number(number)) fail("expected a number");
            return number;
        }
        return with_type(type, [&](auto tag) { return binary<decltype(tag)>(); });
    }

    uint32_t index(Scalar type) {
        const double number = value(type);
        if (!(number >= 0 && number < 4294967295.0) || number != std::floor(number)) {
            char shown[32];
            snprintf(shown, sizeof shown, "%.9g", number);
            fail(std::string("'") + shown + "' is no index or count");
        }
        return uint32_t(number);
    }
};

/// The largest value of a colour of this type.
float most_of(Scalar type) { return type == Scalar::uint8 ? 255.0f : type == Scalar::uint16 ? 65535.0f : 1.0f; }

/// Bytes that an entry takes at least: of text a digit and a blank for each number.
uint64_t least_size(const Element& element, Encoding encoding) {
    uint64_t size = 0;
    for (const Property& p : element.properties)
        size += encoding == Encoding::ascii ? 2 : size_of(p.list ? p.count_type : p.type);
    return size;
}

struct MeshBuilder {
    PlyReader& in;
    FileBudget& budget;
    bool flip_v;
    const std::set<std::string>& wanted;  ///< attributes
    Mesh mesh;
    bool has_faces = false;
    uint64_t vertices = 0;
    std::string unused = {};
    std::vector<std::array<double, 3>> points = {};  ///< positions that may be more than floats
    std::vector<Vec2f> corner_uvs = {};              ///< of faces up to the last one that has some
    PolygonCutter cutter = {};

    void read(Element element) {
        const uint64_t size = least_size(element, in.encoding);
        // What is larger than the file is wrong and must not be allocated; the last blank may be missing.
        const uint64_t left = size_t(in.text.end - in.text.at) + 1;
        if (size > 0 && element.count > left / size)
            in.fail("element '" + element.name + "' claims " + std::to_string(element.count) +
                    " entries, more than the file holds");
        if (size == 0) return;
        declare_attributes(element);
        note_unused(element);
        if (element.name == "vertex")
            read_vertices(element);
        else if (element.name == "face")
            read_faces(element);
        else if (element.name == "tristrips")
            read_strips(element);
        else
            skip(element);
    }

    Mesh finish(const std::string& path) {
        if (!points.empty()) set_positions(mesh, points);
        for (MeshAttribute& a : mesh.attributes) finish_attribute(a);
        if (!corner_uvs.empty()) divide_vertices();
        cutter.add_notes(mesh.notes);
        if (!unused.empty()) mesh.notes.push_back("the ply file has unused data: " + unused);
        check_mesh(path, mesh);
        return std::move(mesh);
    }

private:
    void declare_attributes(Element& element) {
        for (Property& p : element.properties) {
            if (!wanted.contains(p.attribute_name)) continue;
            size_t i = 0;
            while (i < mesh.attributes.size() && mesh.attributes[i].name != p.attribute_name) ++i;
            if (i == mesh.attributes.size()) {
                const float most = p.attribute_name.ends_with("color") ? most_of(p.type) : 1;
                mesh.attributes.push_back({p.attribute_name, element.name == "face", 0, {}, p.name, most});
            }
            p.attribute = int(i);
            mesh.attributes[i].channels = std::max(mesh.attributes[i].channels, p.channel + 1);
        }
        budget.bytes(element.count * mesh.attributes.size() * sizeof(Rgb));
    }

    /// Of an element and its properties, all but what the mesh gets.
    void note_unused(const Element& element) {
        constexpr size_t kMost = 200;
        std::string names;
        for (const Property& p : element.properties)
            if (p.role == Role::skip && p.attribute < 0) names += (names.empty() ? "" : " ") + p.name;
        if (names.empty() || element.count == 0 || unused.size() > kMost) return;
        unused += (unused.empty() ? "" : ", ") + names.substr(0, kMost) + " of element " + element.name;
    }

    /// Value of a property of entry `i`, kept if it is one of an attribute.
    double property_value(const Property& p, size_t i) {
        const double value = in.value(p.type);
        if (p.attribute < 0) return value;
        MeshAttribute& a = mesh.attributes[size_t(p.attribute)];
        a.values.resize(std::max(a.values.size(), i + 1));
        a.values[i][int(p.channel)] = float(value);
        return value;
    }

    void skip_list(const Property& p) {
        for (uint32_t left = in.index(p.count_type); left > 0; --left) in.value(p.type);
    }
    void skip(const Element& element) {
        if (has_fixed_size(element)) {
            in.text.at += element.count * fixed_size(element);
            return;
        }
        for (uint64_t i = 0; i < element.count; ++i) {
            for (const Property& p : element.properties) {
                if (p.list)
                    skip_list(p);
                else
                    in.value(p.type);
            }
            budget.tick();
        }
    }

    /// True if all entries lie in the file, one as long as the other.
    bool has_fixed_size(const Element& element) const {
        if (in.encoding == Encoding::ascii || has_lists(element)) return false;
        if (element.count > size_t(in.text.end - in.text.at) / fixed_size(element)) in.fail("file ends too early");
        return true;
    }

    void read_vertices(const Element& element) {
        if (!has_role(element, Role::x) || !has_role(element, Role::y) || !has_role(element, Role::z))
            in.fail("vertices have no x, y, z");
        const bool normals = has_role(element, Role::nx) && has_role(element, Role::ny) && has_role(element, Role::nz),
                   uvs = has_role(element, Role::u) && has_role(element, Role::v);
        vertices = element.count;
        budget.bytes(mesh_bytes(vertices, 0));
        if (normals) mesh.normals.resize(element.count);
        if (uvs) mesh.uvs.resize(element.count);
        const bool columns = has_fixed_size(element);
        if (columns && !has_double_positions(element))
            mesh.positions.resize(element.count);
        else
            points.resize(element.count);
        if (columns) return read_vertex_columns(element);
        for (uint64_t i = 0; i < element.count; ++i) {
            double vertex[9] = {};
            for (const Property& p : element.properties) {
                if (p.list)
                    skip_list(p);
                else
                    vertex[int(p.role)] = property_value(p, i);
            }
            const auto at = [&](Role role) { return float(vertex[int(role)]); };
            points[i] = {vertex[int(Role::x)], vertex[int(Role::y)], vertex[int(Role::z)]};
            if (normals) mesh.normals[i] = {at(Role::nx), at(Role::ny), at(Role::nz)};
            if (uvs) mesh.uvs[i] = {at(Role::u), flip_v ? 1 - at(Role::v) : at(Role::v)};
            budget.tick();
        }
    }

    static bool has_double_positions(const Element& element) {
        for (const Property& p : element.properties)
            if (p.role >= Role::x && p.role <= Role::z && p.type == Scalar::float64) return true;
        return false;
    }

    /// Where the values of a property go, and how many floats apart; null if they are not kept.
    std::pair<float*, size_t> target_of(const Property& p) {
        if (p.attribute >= 0) return {&mesh.attributes[size_t(p.attribute)].values[0][int(p.channel)], 3};
        if (p.role >= Role::u) return {mesh.uvs.empty() ? nullptr : &mesh.uvs[0].x + (p.role == Role::v), 2};
        if (p.role >= Role::nx)
            return {mesh.normals.empty() ? nullptr : &mesh.normals[0].x + (int(p.role) - int(Role::nx)), 3};
        return {p.role == Role::skip ? nullptr : &mesh.positions[0].x + (int(p.role) - int(Role::x)), 3};
    }

    void read_vertex_columns(const Element& element) {
        for (const Property& p : element.properties)
            if (p.attribute >= 0) mesh.attributes[size_t(p.attribute)].values.resize(element.count);
        const size_t stride = fixed_size(element);
        for (uint64_t first = 0; first < element.count; first += kBlock) {
            const uint64_t count = std::min(kBlock, element.count - first);
            const char* from = in.text.at;
            for (const Property& p : element.properties) {
                if (!points.empty() && p.role >= Role::x && p.role <= Role::z)
                    copy_column(p.type, is_swapped(in.encoding), from, stride, count,
                                &points[first][size_t(p.role) - size_t(Role::x)], 3);
                else if (const auto [to, step] = target_of(p); to)
                    copy_column(p.type, is_swapped(in.encoding), from, stride, count, to + first * step, step);
                from += size_of(p.type);
            }
            if (flip_v && !mesh.uvs.empty())
                for (uint64_t i = first; i < first + count; ++i) mesh.uvs[i].y = 1 - mesh.uvs[i].y;
            in.text.at += count * stride;
            budget.tick(count);
        }
    }

    void finish_attribute(MeshAttribute& a) const {
        if (a.per_face) a.values.resize(mesh.faces.size());
        for (Rgb& value : a.values) {
            if (a.channels == 1) value = {value.x, value.x, value.x};
            if (a.most > 1) value = value / a.most;
            if (!is_finite(value)) in.fail("attribute '" + a.name + "' is not finite");
        }
    }

    /// So that all corners at a vertex have the same texture coordinates.
    void divide_vertices() {
        if (!mesh.uvs.empty())
            mesh.notes.emplace_back("texture coordinates of corners count, and not those of vertices");
        corner_uvs.resize(3 * mesh.faces.size());
        mesh.uvs.assign(mesh.positions.size(), {0, 0});
        std::vector<bool> is_used(mesh.positions.size());
        CornerMap vertex_of;
        for (size_t i = 0; i < corner_uvs.size(); ++i) {
            const Vec2f uv = corner_uvs[i];
            uint32_t& v = mesh.faces[i / 3][i % 3];
            if (v >= is_used.size()) continue;  // check_mesh() says so
            const auto [vertex, is_new] = vertex_of.try_emplace({v, float_bits(uv.x), float_bits(uv.y)}, v);
            if (is_new && is_used[v]) vertex->second = append_vertex(mesh, mesh, v);
            is_used[v] = true;
            v = vertex->second;
            mesh.uvs[v] = uv;
        }
    }

    void read_corner_uvs(const Property& p, std::vector<Vec2f>& out) {
        const uint32_t count = in.index(p.count_type);
        if (count % 2) in.fail("'" + p.name + "' needs two numbers for each corner");
        out.clear();
        for (uint32_t i = 0; i < count; ++i) {
            const float value = float(in.value(p.type));
            if (i % 2 == 0)
                out.push_back({value, 0});
            else
                out.back().y = flip_v ? 1 - value : value;
        }
    }

    void add_corner_uvs(size_t first, size_t corners, const std::vector<Vec2f>& uvs) {  // of the last polygon
        if (uvs.empty() || corners < 3) return;
        if (uvs.size() != corners)
            in.fail("a face of " + std::to_string(corners) + " corners has texture coordinates of " +
                    std::to_string(uvs.size()));
        corner_uvs.resize(3 * first);
        for (const auto& t : cutter.triangles) corner_uvs.insert(corner_uvs.end(), {uvs[t[0]], uvs[t[1]], uvs[t[2]]});
    }

    void read_faces(const Element& element) {
        budget.bytes(mesh_bytes(vertices, element.count));
        mesh.faces.reserve(element.count);
        std::vector<Vec2f> uvs;
        const auto place = [&](uint32_t v) {  // zero of what the file has later, or not at all
            if (v >= points.size()) return v < mesh.positions.size() ? in_double(mesh.positions[v]) : Vec3d{};
            return Vec3d{points[v][0], points[v][1], points[v][2]};
        };
        const FaceLayout layout = in.encoding == Encoding::ascii ? FaceLayout{} : face_layout(element);
        for (uint64_t i = 0; i < element.count; ++i) {
            if (layout.valid) {
                const uint64_t read = read_small_faces(layout, is_swapped(in.encoding), in.text.at, in.text.end,
                                                       std::min(kBlock, element.count - i), mesh.faces,
                                                       [&](size_t at) { cutter.cut_fan(mesh.faces, at, place); });
                budget.bytes(mesh_bytes(vertices, mesh.faces.size()));
                budget.tick(read);
                has_faces |= read > 0;
                if ((i += read) == element.count) break;
            }
            const size_t first = mesh.faces.size();
            cutter.polygon.clear();
            for (const Property& p : element.properties) {
                if (p.role == Role::corners) {
                    has_faces = true;
                    uint32_t left = in.index(p.count_type);
                    budget.bytes(mesh_bytes(vertices, mesh.faces.size() + left));
                    for (; left > 0; --left) cutter.polygon.push_back(in.index(p.type));
                } else if (p.role == Role::corner_uvs) {
                    read_corner_uvs(p, uvs);
                } else if (p.list) {
                    skip_list(p);
                } else {
                    property_value(p, first);
                }
            }
            cutter.add_to(mesh.faces, place);
            add_corner_uvs(first, cutter.polygon.size(), uvs);
            for (MeshAttribute& a : mesh.attributes)
                if (a.per_face && first < a.values.size()) a.values.resize(mesh.faces.size(), Rgb(a.values[first]));
            budget.bytes(mesh_bytes(vertices + corner_uvs.size(), mesh.faces.size()));
            budget.tick();
        }
    }

    /// Every corner but the first two of a strip makes a triangle with those before it, turned over at every second
    /// one; -1 ends a strip.
    void read_strips(const Element& element) {
        std::vector<uint32_t> strip;
        for (uint64_t i = 0; i < element.count; ++i)
            for (const Property& p : element.properties) {
                if (p.role != Role::corners) {
                    p.list ? skip_list(p) : void(in.value(p.type));
                    continue;
                }
                has_faces = true;
                strip.clear();
                for (uint32_t left = in.index(p.count_type); left > 0; --left) {
                    TextCursor here = in.text;
                    if (in.value(p.type) == -1) {
                        strip.clear();
                        continue;
                    }
                    in.text = here;
                    strip.push_back(in.index(p.type));
                    const size_t n = strip.size();
                    if (n < 3) continue;
                    const uint32_t a = strip[n - 3], b = strip[n - 2], c = strip[n - 1];
                    if (a != b && b != c && c != a) mesh.faces.push_back({n % 2 ? a : b, n % 2 ? b : a, c});
                    if (n % 4096 == 0) budget.bytes(mesh_bytes(vertices, mesh.faces.size()));
                    budget.tick();
                }
            }
    }
};

}  // namespace

Mesh read_ply(const std::string& path, std::string_view bytes, bool flip_v, const Limits& limits,
              const std::set<std::string>& attributes) {
    FileBudget budget(path, limits);
    const Header header = read_header(path, bytes);
    std::string_view body = bytes.substr(header.size);
    std::string store;
    if (header.encoding == Encoding::ascii) body = plain_text(path, body, store);
    PlyReader in{path, TextCursor(body), header.encoding};
    in.text.line = header.lines + 1;
    MeshBuilder builder{in, budget, flip_v, attributes, {}};
    bool has_vertices = false;
    for (const Element& element : header.elements) {
        has_vertices |= element.name == "vertex";
        builder.read(element);
    }
    if (!has_vertices) in.fail("no element 'vertex'");
    if (!builder.has_faces) in.fail("no faces with vertex_indices");
    return builder.finish(path);
}

bool ply_has_uvs(const std::string& path, std::string_view bytes) {
    const auto& elements = read_header(path, bytes).elements;
    return std::any_of(elements.begin(), elements.end(), [](const Element& element) {
        return has_role(element, Role::u) || has_role(element, Role::corner_uvs);
    });
}

}  // namespace ambilux
