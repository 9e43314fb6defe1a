// Headers of PLY files: what their elements and properties are called.
#include <initializer_list>

#include "core/error.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/meshes/ply_format.h"

namespace ambilux::ply {

namespace {

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

/// Elements of a file and properties of an element.
constexpr size_t kMostParts = 1000;

using Names = std::initializer_list<const char*>;

/// The properties of these names in an element that has all of them; else none.
std::vector<Property*> all_named(Element& element, Names names) {
    std::vector<Property*> found;
    for (const char* name : names)
        for (Property& p : element.properties)
            if (!p.list && p.name == name) {
                found.push_back(&p);
                break;
            }
    if (found.size() != names.size()) found.clear();
    return found;
}

/// Roles from `first` on for the first of the sets of names that the element has.
void name_roles(Element& element, Role first, std::initializer_list<Names> sets) {
    for (const Names& names : sets) {
        const std::vector<Property*> found = all_named(element, names);
        for (size_t i = 0; i < found.size(); ++i) found[i]->role = Role(int(first) + int(i));
        if (!found.empty()) return;
    }
}

/// NAME_0 to NAME_2, and colours by all their names.
void name_attributes(Element& element, const std::string& prefix) {
    for (Property& p : element.properties) {
        const size_t n = p.name.size();
        if (p.list || p.role != Role::skip || n < 3 || p.name[n - 2] != '_' || p.name[n - 1] < '0' ||
            p.name[n - 1] > '2')
            continue;
        p.channel = uint32_t(p.name[n - 1] - '0');
        p.attribute_name = (p.name.starts_with(prefix) ? "" : prefix) + p.name.substr(0, n - 2);
    }
    for (const Names& names :
         {Names{"r", "g", "b"}, Names{"red", "green", "blue"}, Names{"diffuse_red", "diffuse_green", "diffuse_blue"}}) {
        const std::vector<Property*> found = all_named(element, names);
        for (size_t i = 0; i < found.size(); ++i)
            found[i]->attribute_name = prefix + "color", found[i]->channel = uint32_t(i);
        if (!found.empty()) return;
    }
}

void name_parts(Element& element) {
    if (element.name == "vertex") {
        name_roles(element, Role::x, {{"x", "y", "z"}});
        name_roles(element, Role::nx, {{"nx", "ny", "nz"}, {"normal_x", "normal_y", "normal_z"}});
        name_roles(element, Role::u, {{"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}});
        name_attributes(element, "vertex_");
        return;
    }
    if (element.name != "face" && element.name != "tristrips") return;
    for (Property& p : element.properties)
        if (p.list && !has_role(element, Role::corners) && (p.name == "vertex_indices" || p.name == "vertex_index"))
            p.role = Role::corners;
    if (element.name != "face") return;
    for (Property& p : element.properties)
        if (p.list && p.name == "texcoord") p.role = Role::corner_uvs;
    name_attributes(element, "face_");
}

/// Bytes of the header with its last line end. Behind lines that end in CR alone, LF is the first byte of the data.
size_t size_of_header(std::string_view bytes) {
    size_t at = bytes.find("end_header");
    while (at != std::string_view::npos && at > 0 && bytes[at - 1] != '\n' && bytes[at - 1] != '\r')
        at = bytes.find("end_header", at + 1);
    const size_t end = bytes.find_first_of("\r\n", at);
    if (at == std::string_view::npos || end == std::string_view::npos) return bytes.size();
    return end + (line_end_of(bytes) != "\r" && bytes.substr(end, 2) == "\r\n" ? 2 : 1);
}

struct HeaderReader {
    const std::string& path;
    TextCursor text;

    [[noreturn]] void fail(const std::string& message) const { throw input_error(path, text.line, message); }
};

Scalar take_type(HeaderReader& in) {
    const std::string_view name = in.text.word();
    Scalar type{};
    if (!scalar_named(name, type)) in.fail("unknown type '" + std::string(name) + "'");
    return type;
}

Encoding take_format(HeaderReader& in) {
    const std::string_view name = in.text.word();
    if (name == "ascii") return Encoding::ascii;
    if (name == "binary_little_endian") return Encoding::little_endian;
    if (name == "binary_big_endian") return Encoding::big_endian;
    in.fail("unknown format '" + std::string(name) + "'");
}

Element take_element(HeaderReader& in, const std::vector<Element>& earlier) {
    Element element;
    element.name = in.text.word();
    for (const Element& e : earlier)
        if (e.name == element.name) in.fail("element '" + element.name + "' is declared twice");
    if (earlier.size() == kMostParts) in.fail("more than " + std::to_string(kMostParts) + " elements");
    in.text.skip_blanks();
    if (!in.text.number(element.count)) in.fail("expected a count for element '" + element.name + "'");
    return element;
}

Property take_property(HeaderReader& in) {
    Property property;
    const TextCursor type = in.text;
    property.list = in.text.word() == "list";
    if (property.list)
        property.count_type = take_type(in);
    else
        in.text = type;
    property.type = take_type(in);
    property.name = in.text.word();
    return property;
}

}  // namespace

Header read_header(const std::string& path, std::string_view bytes) {
    Header header;
    header.size = size_of_header(bytes);
    std::string store;
    HeaderReader in{path, TextCursor(plain_text(path, bytes.substr(0, header.size), store))};
    TextCursor& text = in.text;
    if (text.word() != "ply") in.fail("not a PLY file (no 'ply' in the first line)");
    text.next_line();
    bool has_format = false;
    for (;; text.next_line()) {
        if (text.done()) in.fail("header has no end_header");
        const std::string_view keyword = text.word();
        if (keyword == "end_header") break;
        if (keyword == "format") {
            header.encoding = take_format(in);
            has_format = true;
        } else if (keyword == "element") {
            header.elements.push_back(take_element(in, header.elements));
        } else if (keyword == "property") {
            if (header.elements.empty()) in.fail("property before any element");
            auto& properties = header.elements.back().properties;
            properties.push_back(take_property(in));
            if (properties.size() > kMostParts)
                in.fail("more than " + std::to_string(kMostParts) + " properties of an element");
        } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
            in.fail("unknown header statement '" + std::string(keyword) + "'");
        }
    }
    if (!has_format) in.fail("header has no format");
    header.lines = text.line;
    for (Element& element : header.elements) name_parts(element);
    return header;
}

}  // namespace ambilux::ply
