#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "formats/file_budget.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/ply_blocks.h"
#include "formats/meshes/text_cursor.h"

namespace ambilux {

namespace {

using namespace ply;

bool scalar_named(std::string_view name, Scalar& type) {
    struct Name {
        const char* text;
        Scalar type;
    };
    static constexpr Name names[] = {
        {"char", Scalar::int8},      {"int8", Scalar::int8},       {"uchar", Scalar::uint8},
        {"uint8", Scalar::uint8},    {"short", Scalar::int16},     {"int16", Scalar::int16},
        {"ushort", Scalar::uint16},  {"uint16", Scalar::uint16},   {"int", Scalar::int32},
        {"int32", Scalar::int32},    {"uint", Scalar::uint32},     {"uint32", Scalar::uint32},
        {"float", Scalar::float32},  {"float32", Scalar::float32}, {"double", Scalar::float64},
        {"float64", Scalar::float64}};
    for (const Name& n : names)
        if (name == n.text) {
            type = n.type;
            return true;
        }
    return false;
}

Role role_named(std::string_view name) {
    if (name == "x") return Role::x;
    if (name == "y") return Role::y;
    if (name == "z") return Role::z;
    if (name == "nx") return Role::nx;
    if (name == "ny") return Role::ny;
    if (name == "nz") return Role::nz;
    if (name == "u" || name == "s" || name == "texture_u") return Role::u;
    if (name == "v" || name == "t" || name == "texture_v") return Role::v;
    return Role::skip;
}

/// Name and channel of an attribute; false for what is none.
bool attribute_named(const std::string& property, const char* prefix, std::string& name, uint32_t& channel) {
    for (uint32_t c = 0; c < 3; ++c)
        if (property == std::string(1, "rgb"[c])) {
            name = std::string(prefix) + "color";
            channel = c;
            return true;
        }
    const size_t n = property.size();
    if (n < 3 || property[n - 2] != '_' || property[n - 1] < '0' || property[n - 1] > '2') return false;
    channel = uint32_t(property[n - 1] - '0');
    name = property.substr(0, n - 2);
    if (!name.starts_with(prefix)) name.insert(0, prefix);
    return true;
}

/// Elements of a file and properties of an element.
constexpr size_t kMostParts = 1000;

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

std::vector<Element> read_header(PlyReader& in) {
    TextCursor& text = in.text;
    if (text.word() != "ply") in.fail("not a PLY file (no 'ply' in the first line)");
    text.next_line();
    std::vector<Element> elements;
    bool has_format = false;
    Encoding encoding = Encoding::ascii;
    for (;; text.next_line()) {
        if (text.done()) in.fail("header has no end_header");
        const std::string_view keyword = text.word();
        if (keyword == "end_header") break;
        if (keyword == "format") {
            const std::string_view name = text.word();
            if (name == "ascii")
                encoding = Encoding::ascii;
            else if (name == "binary_little_endian")
                encoding = Encoding::little_endian;
            else if (name == "binary_big_endian")
                encoding = Encoding::big_endian;
            else
                in.fail("unknown format '" + std::string(name) + "'");
            has_format = true;
        } else if (keyword == "element") {
            Element element;
            element.name = text.word();
            for (const Element& earlier : elements)
                if (earlier.name == element.name) in.fail("element '" + element.name + "' is declared twice");
            if (elements.size() == kMostParts) in.fail("more than " + std::to_string(kMostParts) + " elements");
            text.skip_blanks();
            if (!text.number(element.count)) in.fail("expected a count for element '" + element.name + "'");
            elements.push_back(element);
        } else if (keyword == "property") {
            if (elements.empty()) in.fail("property before any element");
            Property property;
            std::string_view type = text.word();
            if (type == "list") {
                property.list = true;
                const std::string_view count_type = text.word();
                if (!scalar_named(count_type, property.count_type))
                    in.fail("unknown type '" + std::string(count_type) + "'");
                type = text.word();
            }
            if (!scalar_named(type, property.type)) in.fail("unknown type '" + std::string(type) + "'");
            property.name = text.word();
            if (elements.back().properties.size() == kMostParts)
                in.fail("more than " + std::to_string(kMostParts) + " properties of an element");
            if (elements.back().name == "vertex" && !property.list) property.role = role_named(property.name);
            elements.back().properties.push_back(property);
        } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
            in.fail("unknown header statement '" + std::string(keyword) + "'");
        }
    }
    if (!has_format) in.fail("header has no format");
    text.next_line();
    in.encoding = encoding;
    return elements;
}

bool has_role(const Element& element, Role role) {
    for (const Property& p : element.properties)
        if (p.role == role) return true;
    return false;
}

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
    bool flip_v, keep_attributes;
    Mesh mesh;
    bool has_faces = false;

    void read(Element element) {
        const uint64_t size = least_size(element, in.encoding);
        // What is larger than the file is wrong and must not be allocated; the last blank may be missing.
        const uint64_t left = size_t(in.text.end - in.text.at) + 1;
        if (size > 0 && element.count > left / size)
            in.fail("element '" + element.name + "' claims " + std::to_string(element.count) +
                    " entries, more than the file holds");
        if (size == 0) return;
        if (keep_attributes && (element.name == "vertex" || element.name == "face")) declare_attributes(element);
        if (element.name == "vertex")
            read_vertices(element);
        else if (element.name == "face")
            read_faces(element);
        else
            skip(element);
    }

private:
    void declare_attributes(Element& element) {
        const bool per_face = element.name == "face";
        for (Property& p : element.properties) {
            std::string name;
            if (p.list || p.role != Role::skip ||
                !attribute_named(p.name, per_face ? "face_" : "vertex_", name, p.channel))
                continue;
            size_t i = 0;
            while (i < mesh.attributes.size() && mesh.attributes[i].name != name) ++i;
            if (i == mesh.attributes.size()) mesh.attributes.push_back({name, per_face, 0, {}});
            p.attribute = int(i);
            mesh.attributes[i].channels = std::max(mesh.attributes[i].channels, p.channel + 1);
        }
        budget.bytes(element.count * mesh.attributes.size() * sizeof(Rgb));
    }

    /// Value of a property of entry `i`, kept if it is one of an attribute.
    float property_value(const Property& p, size_t i) {
        const float value = float(in.value(p.type));
        if (p.attribute < 0) return value;
        MeshAttribute& a = mesh.attributes[size_t(p.attribute)];
        a.values.resize(std::max(a.values.size(), i + 1));
        if (!std::isfinite(value)) in.fail("attribute '" + a.name + "' is not finite");
        a.values[i][int(p.channel)] = value;
        if (a.channels == 1) a.values[i] = {value, value, value};
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
        budget.bytes(mesh_bytes(element.count, 0));
        mesh.positions.resize(element.count);
        if (normals) mesh.normals.resize(element.count);
        if (uvs) mesh.uvs.resize(element.count);
        if (has_fixed_size(element)) return read_vertex_columns(element);
        for (uint64_t i = 0; i < element.count; ++i) {
            float vertex[9] = {};
            for (const Property& p : element.properties) {
                if (p.list)
                    skip_list(p);
                else
                    vertex[int(p.role)] = property_value(p, i);
            }
            mesh.positions[i] = {vertex[int(Role::x)], vertex[int(Role::y)], vertex[int(Role::z)]};
            if (normals) mesh.normals[i] = {vertex[int(Role::nx)], vertex[int(Role::ny)], vertex[int(Role::nz)]};
            const float v = vertex[int(Role::v)];
            if (uvs) mesh.uvs[i] = {vertex[int(Role::u)], flip_v ? 1 - v : v};
            budget.tick();
        }
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
                if (const auto [to, step] = target_of(p); to)
                    copy_column(p.type, is_swapped(in.encoding), from, stride, count, to + first * step, step);
                from += size_of(p.type);
            }
            if (flip_v && !mesh.uvs.empty())
                for (uint64_t i = first; i < first + count; ++i) mesh.uvs[i].y = 1 - mesh.uvs[i].y;
            in.text.at += count * stride;
            budget.tick(count);
        }
        for (MeshAttribute& a : mesh.attributes)
            if (!a.per_face) finish_attribute(a);
    }

    void finish_attribute(MeshAttribute& a) const {
        for (Rgb& value : a.values) {
            if (a.channels == 1) value = {value.x, value.x, value.x};
            if (!is_finite(value)) in.fail("attribute '" + a.name + "' is not finite");
        }
    }

    void read_faces(const Element& element) {
        budget.bytes(mesh_bytes(mesh.positions.size(), element.count));
        mesh.faces.reserve(element.count);
        std::vector<uint32_t> polygon;
        const FaceLayout layout = in.encoding == Encoding::ascii ? FaceLayout{} : face_layout(element);
        for (uint64_t i = 0; i < element.count; ++i) {
            if (layout.valid) {
                const uint64_t read = read_small_faces(layout, is_swapped(in.encoding), in.text.at, in.text.end,
                                                       std::min(kBlock, element.count - i), mesh.faces);
                budget.bytes(mesh_bytes(mesh.positions.size(), mesh.faces.size()));
                budget.tick(read);
                has_faces |= read > 0;
                if ((i += read) == element.count) break;
            }
            const size_t first = mesh.faces.size();
            polygon.clear();
            for (const Property& p : element.properties) {
                if (p.list && (p.name == "vertex_indices" || p.name == "vertex_index")) {
                    has_faces = true;
                    uint32_t left = in.index(p.count_type);
                    budget.bytes(mesh_bytes(mesh.positions.size(), mesh.faces.size() + left));
                    for (; left > 0; --left) polygon.push_back(in.index(p.type));
                } else if (p.list) {
                    skip_list(p);
                } else {
                    property_value(p, first);
                }
            }
            if (polygon.size() < 3) in.fail("face " + std::to_string(i) + " has fewer than three corners");
            for (size_t k = 2; k < polygon.size(); ++k) mesh.faces.push_back({polygon[0], polygon[k - 1], polygon[k]});
            for (MeshAttribute& a : mesh.attributes)
                if (a.per_face && first < a.values.size()) a.values.resize(mesh.faces.size(), Rgb(a.values[first]));
            budget.bytes(mesh_bytes(mesh.positions.size(), mesh.faces.size()));
            budget.tick();
        }
    }
};

}  // namespace

Mesh read_ply(const std::string& path, std::string_view bytes, bool flip_v, const Limits& limits, bool attributes) {
    FileBudget budget(path, limits);
    PlyReader in{path, TextCursor(bytes)};
    const std::vector<Element> elements = read_header(in);
    MeshBuilder builder{in, budget, flip_v, attributes, {}};
    bool has_vertices = false;
    for (const Element& element : elements) {
        has_vertices |= element.name == "vertex";
        builder.read(element);
    }
    if (!has_vertices) in.fail("no element 'vertex'");
    if (!builder.has_faces) in.fail("no faces with vertex_indices");
    check_mesh(path, builder.mesh);
    return std::move(builder.mesh);
}

}  // namespace ambilux
