#include <fmt/format.h>

#include "formats/convert/writer.h"

namespace ambilux::convert {

namespace {

xml_node add_value(xml_node parent, const char* tag, const char* name, const std::string& value) {
    xml_node node = parent.append_child(tag);
    node.append_attribute("name") = name;
    node.append_attribute("value") = value.c_str();
    return node;
}

}  // namespace

xml_node add_object(xml_node parent, const char* tag, const std::string& type, const char* name) {
    xml_node node = parent.append_child(tag);
    node.append_attribute("type") = type.c_str();
    if (name) node.append_attribute("name") = name;
    return node;
}

void add_number(xml_node parent, const char* name, double value) {
    add_value(parent, "float", name, fmt::format("{}", value));
}
void add_integer(xml_node parent, const char* name, int64_t value) {
    add_value(parent, "integer", name, std::to_string(value));
}
void add_boolean(xml_node parent, const char* name, bool value) {
    add_value(parent, "boolean", name, value ? "true" : "false");
}
void add_text(xml_node parent, const char* name, const std::string& value) { add_value(parent, "string", name, value); }
void add_rgb(xml_node parent, const char* name, Rgb value) {
    add_value(parent, "rgb", name, fmt::format("{} {} {}", value.x, value.y, value.z));
}
void add_vector(xml_node parent, const char* tag, const char* name, Vec3f value) {
    xml_node node = parent.append_child(tag);
    node.append_attribute("name") = name;
    node.append_attribute("x") = fmt::format("{}", value.x).c_str();
    node.append_attribute("y") = fmt::format("{}", value.y).c_str();
    node.append_attribute("z") = fmt::format("{}", value.z).c_str();
}

void add_transform(xml_node parent, const char* name, const Affine& value) {
    std::string text;
    for (const auto& row : value.m)
        for (const float v : row) text += fmt::format("{} ", v);
    xml_node node = parent.append_child("transform");
    node.append_attribute("name") = name;
    node.append_child("matrix").append_attribute("value") = (text + "0 0 0 1").c_str();
}

}  // namespace ambilux::convert
