// A scene's tree of objects as the XML that it could have been read from.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <pugixml.hpp>
#include <sstream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "formats/document/kept.h"
#include "formats/edits.h"
#include "formats/images/image_write.h"
#include "formats/mitsuba/xml.h"

namespace ambilux {

using namespace document;
namespace fs = std::filesystem;
using pugi::xml_node;

namespace {

struct Writer {
    const Document& document;
    std::string path;  ///< of the XML
    bool writes_arrays = false;
    std::map<const Object*, xml_node> written;
    std::map<const Object*, std::string> ids;

    std::string stem() const { return fs::path(path).stem().string() + "_files"; }
    std::string beside(const std::string& name) const {
        return (fs::path(path).parent_path() / stem() / name).string();
    }

    void write_object(xml_node parent, const Child& child) {
        const Object& object = *child.object;
        if (written.contains(&object)) {
            xml_node ref = parent.append_child("ref");
            if (!child.name.empty()) ref.append_attribute("name") = child.name.c_str();
            ref.append_attribute("id") = id_of(object).c_str();
            return;
        }
        xml_node node = parent.append_child(object.tag.c_str());
        written[&object] = node;
        node.append_attribute("type") = object.type.c_str();
        if (!object.id.empty()) node.append_attribute("id") = object.id.c_str();
        if (!child.name.empty()) node.append_attribute("name") = child.name.c_str();
        for (const Value& value : object.values) write_value(node, object, value);
        for (const Child& inner : object.children) write_object(node, inner);
    }

    /// One is made up for an object that is referred to and has none.
    const std::string& id_of(const Object& object) {
        std::string& id = ids[&object];
        if (!id.empty()) return id;
        if (!object.id.empty()) return id = object.id;
        id = fmt::format("object{}", ids.size());
        written[&object].append_attribute("id") = id.c_str();
        return id;
    }

    static std::string joined(const auto& numbers) {
        std::string text;
        for (const auto n : numbers) text += fmt::format("{}{}", text.empty() ? "" : " ", n);
        return text;
    }

    void write_value(xml_node parent, const Object& object, const Value& v) {
        const auto add = [&](const char* tag, const std::string& text) {
            xml_node node = parent.append_child(tag);
            node.append_attribute("name") = v.name.c_str();
            node.append_attribute("value") = text.c_str();
        };
        switch (v.kind) {
            case ValueKind::boolean: return add("boolean", v.number != 0 ? "true" : "false");
            case ValueKind::integer: return add("integer", fmt::format("{}", int64_t(v.number)));
            case ValueKind::number: return add("float", fmt::format("{}", v.number));
            case ValueKind::text: return write_text(parent, object, v);
            case ValueKind::vector: return add("vector", joined(std::array{v.vector.x, v.vector.y, v.vector.z}));
            case ValueKind::rgb: return add("rgb", joined(std::array{v.rgb.x, v.rgb.y, v.rgb.z}));
            case ValueKind::spectrum: return add_spectrum(add, v);
            case ValueKind::transform: break;
        }
        xml_node node = parent.append_child("transform");
        node.append_attribute("name") = v.name.c_str();
        std::vector<double> all;
        for (const auto& row : v.transform.m) all.insert(all.end(), row, row + 4);
        node.append_child("matrix").append_attribute("value") = joined(all).c_str();
    }

    /// One that is no light of equal energy is read as the number that it is.
    void add_spectrum(const auto& add, const Value& v) const {
        if (v.samples.empty())
            return add(v.equal_energy || document.scene->version < 2 ? "spectrum" : "float",
                       fmt::format("{}", v.number));
        std::string text;
        for (const auto& [wavelength, value] : v.samples)
            text += fmt::format("{}{}:{}", text.empty() ? "" : ", ", wavelength, value);
        add("spectrum", text);
    }

    /// Files are named as seen from the XML, and arrays become files.
    void write_text(xml_node parent, const Object& object, const Value& v) {
        std::string name = v.name, text = v.text;
        const bool of_file = object.tag == "shape" || object.tag == "texture" || object.tag == "emitter";
        if (of_file && name == "filename") {
            text = seen_from_here(document.resolve(text, v.where));
        } else if (path.empty()) {
            // as it is
        } else if (const Mesh* mesh = object.tag == "shape" && name == "mesh" ? document.mesh(text) : nullptr) {
            name = "filename", text = stem() + "/" + file_of(text) + ".ply";
            if (writes_arrays) write_file_atomic(beside(file_of(v.text) + ".ply"), ply_of(*mesh));
        } else if (const Texels* image = name == "image" ? document.image(text) : nullptr) {
            const std::string file = file_of(text) + (image->is_8bit ? ".png" : ".exr");
            name = "filename", text = stem() + "/" + file;
            if (writes_arrays) write_image(*image, beside(file));
        }
        xml_node node = parent.append_child("string");
        node.append_attribute("name") = name.c_str();
        node.append_attribute("value") = text.c_str();
    }

    std::string seen_from_here(const std::string& file) const {
        const fs::path full = fs::weakly_canonical(fs::absolute(file));
        const fs::path near = full.lexically_relative(fs::weakly_canonical(fs::absolute(path)).parent_path());
        return path.empty() || near.empty() || *near.begin() == ".." ? full.string() : near.string();
    }

    /// Of an array, by its digest.
    static std::string file_of(const std::string& name) { return name.substr(name.find(' ') + 1, 16); }

    static void write_image(const Texels& image, const std::string& path) {
        const auto colors = [&](const auto& rgba) {
            std::remove_cvref_t<decltype(rgba)> rgb;
            for (size_t i = 0; i < rgba.size(); ++i)
                if (i % 4 < 3) rgb.push_back(rgba[i]);
            return rgb;
        };
        if (image.is_8bit)
            write_byte_image(path, image.width, image.height, colors(image.bytes));
        else
            write_float_image(path, image.width, image.height, colors(image.floats));
    }

    static std::string ply_of(const Mesh& mesh) {
        std::string bytes =
            fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.size());
        const auto property = [&](std::initializer_list<const char*> names) {
            for (const char* name : names) bytes += fmt::format("property float {}\n", name);
        };
        property({"x", "y", "z"});
        if (!mesh.normals.empty()) property({"nx", "ny", "nz"});
        if (!mesh.uvs.empty()) property({"u", "v"});
        bytes +=
            fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n", mesh.faces.size());
        const auto append = [&](const auto& value) {
            bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
        };
        for (size_t i = 0; i < mesh.positions.size(); ++i) {
            append(mesh.positions[i]);
            if (!mesh.normals.empty()) append(mesh.normals[i]);
            if (!mesh.uvs.empty()) append(mesh.uvs[i]);
        }
        for (const auto& face : mesh.faces) {
            bytes += char(3);
            append(face);
        }
        return bytes;
    }
};

std::string text_of(const Editable& from, const std::string& path, bool writes_arrays) {
    const Document& document = *from.document;
    if (!document.smooth_normals || document.files.empty())
        throw input_error(from.kept->scene.path, 0,
                          "it was no Mitsuba scene, whose XML could be written: `ambilux convert` makes one of it");
    pugi::xml_document xml;
    xml_node root = xml.append_child("scene");
    root.append_attribute("version") =
        fmt::format("{}.{}.0", document.scene->version, document.scene->version == 0 ? 6 : 0).c_str();
    Writer writer{document, path, writes_arrays, {}, {}};
    if (writes_arrays && (!document.given_meshes.empty() || !document.given_images.empty()))
        make_folders((fs::path(path).parent_path() / writer.stem()).string());
    for (const Value& value : document.scene->values) writer.write_value(root, *document.scene, value);
    for (const Child& child : document.scene->children) writer.write_object(root, child);
    std::ostringstream text;
    xml.save(text, "    ");
    return text.str();
}

}  // namespace

std::string scene_text(const Editable& from, const std::string& path) { return text_of(from, path, false); }

void write_scene(const Editable& from, const std::string& path) { write_file_atomic(path, text_of(from, path, true)); }

}  // namespace ambilux
