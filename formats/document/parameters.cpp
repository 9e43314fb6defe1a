// What of a scene can be changed.
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "formats/document/kept.h"
#include "formats/document/names.h"
#include "formats/edits.h"
#include "formats/file_budget.h"
#include "formats/gzip.h"

namespace ambilux {

using namespace document;

namespace {

nlohmann::json json_of(const Value& v) {
    switch (v.kind) {
        case ValueKind::boolean: return v.number != 0;
        case ValueKind::integer: return int64_t(v.number);
        case ValueKind::number: return v.number;
        case ValueKind::text: return v.text;
        case ValueKind::vector: return {v.vector.x, v.vector.y, v.vector.z};
        case ValueKind::rgb: return {v.rgb.x, v.rgb.y, v.rgb.z};
        case ValueKind::spectrum:
            if (v.samples.empty()) return v.number;
            return v.samples;
        case ValueKind::transform: break;
    }
    nlohmann::json rows = nlohmann::json::array();
    for (const auto& row : v.transform.m) rows.push_back(row);
    return rows;
}

const char* name_of(ValueKind kind) {
    constexpr const char* kNames[] = {"boolean", "integer", "number", "text", "vector", "rgb", "spectrum", "transform"};
    return kNames[size_t(kind)];
}

bool has_mesh(const Object& o) {
    return o.tag == "shape" && (o.type == "obj" || o.type == "ply" || o.type == "serialized" || o.type == "mesh");
}
bool has_image(const Object& o) { return o.type == "bitmap" || o.type == "envmap"; }

const Object& object_named(const Document& document, const std::string& name) {
    for (const NamedObject& n : named_objects(document))
        if (n.name == name) return *n.object;
    throw input_error(name, 0, "the scene has no such object");
}

std::string text_of(const Object& object, const char* name) {
    const Value* value = object.find(name);
    return value ? value->text : "";
}

}  // namespace

nlohmann::json scene_parameters(const Editable& from) {
    nlohmann::json all = nlohmann::json::array();
    for (const NamedObject& n : named_objects(*from.document)) {
        const Object& object = *n.object;
        const auto add = [&](const Value& v, bool given) {
            const char* kind = name_of(v.kind);
            all.push_back({{"object", n.name},
                           {"tag", object.tag},
                           {"name", n.name + "." + v.name},
                           {"kind", kind},
                           {"value", json_of(v)},
                           {"given", given}});
        };
        for (const Value& v : object.values) add(v, true);
        const auto textured = [&](const std::string& name) {
            return std::any_of(object.children.begin(), object.children.end(),
                               [&](const Child& c) { return c.name == name; });
        };
        if (const auto asked = from.kept->asked.find(n.object); asked != from.kept->asked.end())
            for (const Value& v : asked->second)
                if (!object.find(v.name) && !textured(v.name)) add(v, false);
        if (has_mesh(object)) all.push_back({{"name", n.name}, {"tag", object.tag}, {"kind", "mesh"}});
        if (has_image(object)) all.push_back({{"name", n.name}, {"tag", object.tag}, {"kind", "image"}});
    }
    return all;
}

Mesh mesh_of(const Editable& from, const std::string& name) {
    const Document& document = *from.document;
    if (const Mesh* mesh = document.mesh(name)) return *mesh;
    const Object& object = object_named(document, name);
    if (!has_mesh(object))
        throw input_error(name, 0, "a shape of type '" + object.type + "' has no arrays of vertices");
    const std::string given = text_of(object, object.type == "mesh" ? "name" : "mesh");
    if (const Mesh* mesh = given.empty() ? nullptr : document.mesh(given)) return *mesh;
    const std::string path = document.resolve(text_of(object, "filename"), object.where);
    const std::string bytes = gunzip_if_packed(path, read_input(path, document.limits), document.limits);
    const Value *flip = object.find("flip_tex_coords"), *index = object.find("shape_index");
    const bool flip_v = flip ? flip->number != 0 : object.type == "obj";
    if (object.type == "obj") return read_obj(path, bytes, flip_v, document.limits);
    if (object.type == "ply") return read_ply(path, bytes, flip_v, document.limits);
    return read_serialized(path, bytes, index ? int(index->number) : 0, flip_v, document.limits);
}

Texels image_of(const Editable& from, const std::string& name) {
    const Document& document = *from.document;
    if (const Texels* image = document.image(name)) return *image;
    const Object& object = object_named(document, name);
    if (!has_image(object))
        throw input_error(name, 0, "a " + object.tag + " of type '" + object.type + "' has no texels");
    const std::string given = text_of(object, "image");
    if (const Texels* image = given.empty() ? nullptr : document.image(given)) return *image;
    const std::string path = document.resolve(text_of(object, "filename"), object.where);
    return read_image(path, read_input(path, document.limits), document.limits);
}

}  // namespace ambilux
