#include "formats/document/document.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "formats/file_budget.h"

namespace ambilux::document {

namespace fs = std::filesystem;

void fail(const Where& where, const std::string& message) { throw input_error(where.file, where.line, message); }

void check_shapes(const Limits& limits, uint64_t count, const Where& where) {
    if (count > limits.shapes)
        fail(where, "the scene has more shapes than --limits shapes=" + std::to_string(limits.shapes));
}

void check_nesting(const Limits& limits, uint64_t depth, const Where& where, const char* what) {
    if (depth > limits.nesting)
        fail(where, std::string(what) + " are nested deeper than --limits nesting=" + std::to_string(limits.nesting));
}

const Value* Object::find(const std::string& name) const {
    for (const Value& value : values)
        if (value.name == name) return &value;
    return nullptr;
}

namespace {

template <class T>
const T* found(const std::map<std::string, std::shared_ptr<const T>>& given, const std::map<std::string, T>& own,
               const std::map<std::string, T>* first, const std::string& name) {
    if (const auto at = given.find(name); at != given.end()) return at->second.get();
    if (const auto at = own.find(name); at != own.end()) return &at->second;
    if (!first) return nullptr;
    const auto at = first->find(name);
    return at == first->end() ? nullptr : &at->second;
}

}  // namespace

const Mesh* Document::mesh(const std::string& name) const {
    return found(given_meshes, meshes, first ? &first->meshes : nullptr, name);
}

const Texels* Document::image(const std::string& name) const {
    return found(given_images, images, first ? &first->images : nullptr, name);
}

std::string Document::resolve(const std::string& name, const Where& where) const {
    std::error_code ignored;
    std::vector<fs::path> folders(search_folders.rbegin(), search_folders.rend());
    if (!files.empty()) folders.push_back(fs::path(files[0].first).parent_path());
    folders.push_back(fs::path(where.file).parent_path());
    std::string slashed = name;  // backslashes are what exporters on Windows write
    std::replace(slashed.begin(), slashed.end(), '\\', '/');
    for (const fs::path path : {name, slashed}) {
        if (path.is_absolute() && fs::exists(path, ignored)) return path.string();
        for (const fs::path& folder : folders)
            if (fs::path candidate = folder / path; fs::exists(candidate, ignored)) return candidate.string();
    }
    fail(where, "file '" + name + "' does not exist");
}

Scene naming_includes(const Document& document, const std::function<Scene()>& load) {
    try {
        return load();
    } catch (const Error& e) {
        const auto& included = document.included_from;
        const std::string message = e.what();
        auto at = std::find_if(included.begin(), included.end(),
                               [&](const auto& file) { return message.starts_with(file.first + ":"); });
        if (at == included.end()) throw;
        constexpr int kMostNamed = 4;
        std::string outer;
        for (int i = 0; at != included.end() && i < kMostNamed; at = included.find(at->second.file), ++i)
            outer.append(i ? ", by " : " (included by ").append(at->second.text());
        throw Error(e.code, message + outer + ")");
    }
}

namespace {

Value& add_value(Object& object, const std::string& name, ValueKind kind) {
    Value& value = object.values.emplace_back();
    value.name = name;
    value.kind = kind;
    value.where = object.where;
    return value;
}

}  // namespace

void for_all_below(const Object& object, const std::function<void(const Object&)>& f) {
    std::set<const Object*> seen;
    const std::function<void(const Object&)> visit = [&](const Object& o) {
        if (!seen.insert(&o).second) return;
        f(o);
        for (const Child& child : o.children)
            if (child.object) visit(*child.object);
    };
    visit(object);
}

void note_image(std::vector<std::string>& notes, const std::string& path, const std::vector<std::string>& of_image) {
    for (const std::string& text : of_image)
        if (const std::string note = path + ": " + text; std::find(notes.begin(), notes.end(), note) == notes.end())
            notes.push_back(note);
}

Texels read_image_file(Document& document, const std::string& path) {
    const std::string bytes = read_input(path, document.limits);
    document.file_digests.push_back({path, sha256(bytes)});
    Texels texels = read_image(path, bytes, document.limits);
    note_image(document.notes, path, texels.notes);
    return texels;
}

void take_texels(Document& document, const Where& where, uint64_t texels, uint64_t bytes_each) {
    FileBudget(where.file, document.limits).bytes(texels, bytes_each);
    document.made_texels += texels * bytes_each;
    if (document.made_texels > document.limits.total_bytes)
        fail(where, "with it, textures take more memory than --limits total_bytes=" +
                        std::to_string(document.limits.total_bytes));
}

Object make_object(const std::string& tag, const std::string& type, const Where& where, int version) {
    Object object;
    object.tag = tag;
    object.type = type;
    object.where = where;
    object.version = version;
    return object;
}

Object& add_object(Document& document, const std::string& tag, const std::string& type, const Where& where) {
    document.storage.push_back(std::make_unique<Object>(make_object(tag, type, where, 2)));
    return *document.storage.back();
}

Object& add_to_scene(Document& document, const std::string& tag, const std::string& type, const Where& where) {
    Object& object = add_object(document, tag, type, where);
    add_child(*document.scene, object);
    return object;
}

Texels& add_image(Document& document, const std::string& name, uint32_t width, uint32_t height) {
    Texels& image = document.images[name];
    image = {};
    image.width = width, image.height = height;
    image.is_linear = true;
    image.floats.assign(4 * size_t(width) * height, 1.0f);
    return image;
}

Object& add_bitmap(Document& document, const Where& where, const std::string& image, const char* filter) {
    Object& texture = add_object(document, "texture", "bitmap", where);
    set_text(texture, "image", image);
    set_boolean(texture, "raw", true);
    set_text(texture, "wrap_mode", "clamp");
    set_text(texture, "filter_type", filter);
    return texture;
}

Object& add_light_back(Document& document, const Object& shape) {
    Object& back = add_object(document, shape.tag, shape.type, shape.where);
    back.values = shape.values;
    back.children = shape.children;
    const Value* flip = shape.find("flip_normals");
    const bool flipped = flip && flip->number != 0;
    std::erase_if(back.values, [](const Value& v) { return v.name == "flip_normals"; });
    set_boolean(back, "flip_normals", !flipped);
    document.light_backs.insert(&back);
    return back;
}

void add_child(Object& parent, const Object& child, const std::string& name) {
    parent.children.push_back({name, child.where, "", &child});
}

void set_boolean(Object& object, const std::string& name, bool value) {
    add_value(object, name, ValueKind::boolean).number = value;
}
void set_integer(Object& object, const std::string& name, int64_t value) {
    add_value(object, name, ValueKind::integer).number = double(value);
}
void set_number(Object& object, const std::string& name, double value) {
    add_value(object, name, ValueKind::number).number = value;
}
void set_text(Object& object, const std::string& name, const std::string& value) {
    add_value(object, name, ValueKind::text).text = value;
}
void set_rgb(Object& object, const std::string& name, Rgb value) {
    add_value(object, name, ValueKind::rgb).rgb = value;
}
void set_vector(Object& object, const std::string& name, Vec3d value) {
    add_value(object, name, ValueKind::vector).vector = value;
}
void set_transform(Object& object, const std::string& name, const Matrix& value) {
    add_value(object, name, ValueKind::transform).transform = value;
}

}  // namespace ambilux::document
