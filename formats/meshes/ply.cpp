#include <bit>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "formats/file_budget.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/text_cursor.h"

namespace ambilux {

namespace {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
enum class Encoding { ascii, little_endian, big_endian };

/// What a property of the vertex element means to us.
enum class Role { skip, x, y, z, nx, ny, nz, u, v };

struct Property {
    std::string name;
    Scalar type;
    bool list = false;
    Scalar count_type = Scalar::uint8;
    Role role = Role::skip;
    int attribute = -1;    ///< place in Mesh::attributes
    uint32_t channel = 0;  ///< of it
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
};

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
        unsigned char bytes[sizeof(T)];
        memcpy(bytes, text.at, sizeof(T));
        text.at += sizeof(T);
        if ((encoding == Encoding::big_endian) == (std::endian::native == std::endian::little))
            for (size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
        T value;
        memcpy(&value, bytes, sizeof(T));
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
        switch (type) {
            case Scalar::int8: return binary<int8_t>();
            case Scalar::uint8: return binary<uint8_t>();
            case Scalar::int16: return binary<int16_t>();
            case Scalar::uint16: return binary<uint16_t>();
            case Scalar::int32: return binary<int32_t>();
            case Scalar::uint32: return binary<uint32_t>();
            case Scalar::float32: return binary<float>();
            case Scalar::float64: return binary<double>();
        }
        return 0;
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

size_t size_of(Scalar type) {
    switch (type) {
        case Scalar::int8:
        case Scalar::uint8: return 1;
        case Scalar::int16:
        case Scalar::uint16: return 2;
        case Scalar::float64: return 8;
        default: return 4;
    }
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
            for (uint64_t i = 0; i < element.count; ++i) skip(element);
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
        for (const Property& p : element.properties) {
            if (p.list)
                skip_list(p);
            else
                in.value(p.type);
        }
        budget.tick();
    }

    void read_vertices(const Element& element) {
        if (!has_role(element, Role::x) || !has_role(element, Role::y) || !has_role(element, Role::z))
            in.fail("vertices have no x, y, z");
        const bool normals = has_role(element, Role::nx) && has_role(element, Role::ny) && has_role(element, Role::nz),
                   uvs = has_role(element, Role::u) && has_role(element, Role::v);
        budget.bytes(mesh_bytes(element.count, 0));
        mesh.positions.reserve(element.count);
        if (normals) mesh.normals.reserve(element.count);
        if (uvs) mesh.uvs.reserve(element.count);
        for (uint64_t i = 0; i < element.count; ++i) {
            float vertex[9] = {};
            for (const Property& p : element.properties) {
                if (p.list)
                    skip_list(p);
                else
                    vertex[int(p.role)] = property_value(p, i);
            }
            mesh.positions.push_back({vertex[int(Role::x)], vertex[int(Role::y)], vertex[int(Role::z)]});
            if (normals) mesh.normals.push_back({vertex[int(Role::nx)], vertex[int(Role::ny)], vertex[int(Role::nz)]});
            const float v = vertex[int(Role::v)];
            if (uvs) mesh.uvs.push_back({vertex[int(Role::u)], flip_v ? 1 - v : v});
            budget.tick();
        }
    }

    void read_faces(const Element& element) {
        budget.bytes(mesh_bytes(mesh.positions.size(), element.count));
        mesh.faces.reserve(element.count);
        std::vector<uint32_t> polygon;
        for (uint64_t i = 0; i < element.count; ++i) {
            polygon.clear();
            const size_t first = mesh.faces.size();
            for (const Property& p : element.properties) {
                if (p.list && (p.name == "vertex_indices" || p.name == "vertex_index")) {
                    has_faces = true;
                    for (uint32_t left = in.index(p.count_type); left > 0; --left) polygon.push_back(in.index(p.type));
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
