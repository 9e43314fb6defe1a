// What the parts of the converter share.
#pragma once

#include <map>
#include <pugixml.hpp>
#include <set>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace ambilux::convert {

using pugi::xml_node;

struct Writer {
    const Scene& scene;
    std::string folder;                         ///< where files go
    std::string prefix;                         ///< of their names in the XML
    std::map<std::string, std::string> images;  ///< by content -> name in the XML
    std::vector<std::string> notes;
    std::set<std::string> noted;

    void note(const std::string& text) {
        if (noted.insert(text).second) notes.push_back(text);
    }
};

// Elements of Mitsuba's XML; each returns what it adds.
xml_node add_object(xml_node parent, const char* tag, const std::string& type, const char* name = nullptr);
void add_number(xml_node parent, const char* name, double value);
void add_integer(xml_node parent, const char* name, int64_t value);
void add_boolean(xml_node parent, const char* name, bool value);
void add_text(xml_node parent, const char* name, const std::string& value);
void add_rgb(xml_node parent, const char* name, Rgb value);
void add_vector(xml_node parent, const char* tag, const char* name, Vec3f value);
void add_transform(xml_node parent, const char* name, const Affine& value);

/// A colour or its texture; white is left out if `white_is_default`.
void add_color(Writer& writer, xml_node parent, const char* name, const ParamRgb& value, bool white_is_default = false);
void add_textured_number(Writer& writer, xml_node parent, const char* name, const ParamFloat& value);
/// The texture times `factor`; of numbers that are no colours if `is_number`.
void add_texture(Writer& writer, xml_node parent, const char* name, int32_t texture, Rgb factor, bool is_number);
/// File of all texels as linear floats, times `factor`.
std::string float_image(Writer& writer, const Texture& texture, Rgb factor);

void add_material(Writer& writer, xml_node parent, uint32_t material, const std::string& id = "");
void add_sensor(Writer& writer, xml_node root);
/// An emitter of its own, or that of a shape.
void add_emitter(Writer& writer, xml_node parent, const Emitter& emitter);
void add_shapes(Writer& writer, xml_node root);

}  // namespace ambilux::convert
