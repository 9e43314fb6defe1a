#include "formats/edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/error.h"
#include "core/nearest.h"
#include "core/text_cursor.h"
#include "formats/document/kept.h"
#include "formats/document/names.h"
#include "formats/mitsuba/xml.h"

namespace ambilux {

using namespace document;

namespace {

/// Places of edits in a document.
struct Target {
    Object* object = nullptr;
    std::string parameter;  ///< empty: the object itself
    Object* parent = nullptr;
    size_t child = 0;
};

struct Editor {
    Document& document;
    const Kept* kept;
    std::vector<NamedObject> named;
    std::map<std::string, size_t> by_name;
    std::map<const Object*, Object*> own;  ///< the same, to be changed

    explicit Editor(Document& d, const Kept* k) : document(d), kept(k) { find_names(); }

    void find_names() {
        named = named_objects(document);
        by_name.clear(), own.clear();
        for (size_t i = 0; i < named.size(); ++i) by_name[named[i].name] = i;
        for (const auto& object : document.storage) own[object.get()] = object.get();
    }

    [[noreturn]] void fail_unknown(const std::string& name) const {
        Names all;
        for (const NamedObject& n : named) all.push_back(n.name);
        const size_t dot = name.rfind('.');
        const std::string prefix = dot == std::string::npos ? name : name.substr(0, dot);
        const std::string near = nearest_name(all, prefix);
        const std::string rest = dot == std::string::npos ? "" : name.substr(dot);
        throw input_error(name, 0,
                          fmt::format("the scene has no '{}'{}", prefix,
                                      near.empty() ? "" : fmt::format(": is '{}{}' meant?", near, rest)));
    }

    /// `is_element`: which may be added to the scene.
    Target find(const std::string& name, bool is_element) const {
        if (const auto whole = by_name.find(name); whole != by_name.end()) {
            const NamedObject& n = named[whole->second];
            return {own.at(n.object), "", own.at(n.parent), n.child};
        }
        for (size_t dot = name.rfind('.'); dot != std::string::npos && dot > 0; dot = name.rfind('.', dot - 1))
            if (const auto at = by_name.find(name.substr(0, dot)); at != by_name.end())
                return {own.at(named[at->second].object), name.substr(dot + 1)};
        if (is_element && name.find('.') == std::string::npos) return {document.scene, name};
        fail_unknown(name);
    }

    void apply(const Edit& edit) {
        Target at = find(edit.name, edit.text.starts_with('<'));
        if (edit.mesh)
            set_mesh(edit, at);
        else if (edit.image)
            set_image(edit, at);
        else if (!edit.text.empty())
            set(edit, at);
        else if (at.parameter.empty())
            at.parent->children.erase(at.parent->children.begin() + ptrdiff_t(at.child));
        else
            erase(*at.object, at.parameter);
        if (!edit.mesh && !edit.image) document.edits[edit.name] = edit.text;
        // Objects came or went, and with them names.
        if (at.parameter.empty() || edit.text.starts_with('<')) find_names();
    }

    static void erase(Object& object, const std::string& name) {
        std::erase_if(object.values, [&](const Value& v) { return v.name == name; });
        std::erase_if(object.children, [&](const Child& c) { return c.name == name; });
    }

    void set(const Edit& edit, const Target& at) {
        const bool is_object = at.parameter.empty();
        Object& holder = is_object ? *at.parent : *at.object;
        const std::string name = is_object ? at.parent->children[at.child].name : at.parameter;
        const std::string text =
            edit.text.starts_with('<') ? edit.text : element_of(edit, holder, name.empty() ? "value" : name);
        // The new object may have the id of the one that it stands for.
        auto id = document.ids.extract(edit.name);
        const Object made = mitsuba::parse_elements(document, edit.name, text, document.scene->version);
        if (id) document.ids.insert(std::move(id));
        if (made.values.size() + made.children.size() != 1)
            throw input_error(edit.name, 0, "one value or one object is needed");
        if (!made.children.empty()) {
            Child child = made.children[0];
            child.name = is_object ? name : at.parameter;
            if (is_object) {
                give_id(*own_of(child.object), *at.object);
                at.parent->children[at.child] = child;
            } else {
                erase(holder, at.parameter);
                const bool by_tag = child.object->tag == at.parameter && child.object->tag != "texture";
                const bool in_scene = &holder == document.scene;
                if (in_scene && !by_tag) own_of(child.object)->id = at.parameter;
                if (by_tag || in_scene) child.name.clear();
                holder.children.push_back(child);
            }
            return;
        }
        Value value = made.values[0];
        if (name.empty()) throw input_error(edit.name, 0, "it is an object, and no value can stand for it");
        value.name = name;
        erase_other(holder, name);
        const auto there =
            std::find_if(holder.values.begin(), holder.values.end(), [&](const Value& v) { return v.name == name; });
        if (there == holder.values.end())
            holder.values.push_back(value);
        else
            *there = value;
    }

    Object* own_of(const Object* object) const {
        const auto at = std::find_if(document.storage.rbegin(), document.storage.rend(),
                                     [&](const auto& o) { return o.get() == object; });
        return at->get();
    }

    /// What refers to the old object refers to the new one.
    void give_id(Object& made, const Object& old) {
        made.id = old.id;
        for (auto& [id, object] : document.ids)
            if (object == &old) object = &made;
        for (const auto& object : document.storage)
            for (Child& child : object->children)
                if (child.object == &old) child.object = &made;
    }

    static void erase_other(Object& object, const std::string& name) {
        std::erase_if(object.children, [&](const Child& c) { return c.name == name; });
    }

    /// What the object has, or would have if nothing was said.
    const Value* known_value(const Object& object, const std::string& name) const {
        if (const Value* v = object.find(name)) return v;
        if (!kept) return nullptr;
        // Readers asked the object that this one is a copy of.
        const auto asked = kept->asked.find(origin_of(object));
        if (asked == kept->asked.end()) return nullptr;
        for (const Value& v : asked->second)
            if (v.name == name) return &v;
        return nullptr;
    }
    std::map<const Object*, const Object*> origins;  ///< of copies
    const Object* origin_of(const Object& object) const {
        const auto at = origins.find(&object);
        return at == origins.end() ? &object : at->second;
    }

    /// A text as an element of the kind that the parameter has.
    std::string element_of(const Edit& edit, const Object& object, const std::string& name) const {
        const Value* like = known_value(object, name);
        const bool pairs = edit.text.find(':') != std::string::npos;
        const auto [numbers, whole, count] = count_numbers(edit.text);
        const auto element = [&](const char* tag) {
            return fmt::format("<{} name=\"{}\" value=\"{}\"/>", tag, escaped(name), escaped(edit.text));
        };
        const ValueKind kind = like ? like->kind : guessed(edit.text, name, numbers, count);
        switch (kind) {
            case ValueKind::boolean: return element("boolean");
            case ValueKind::integer: return element(numbers && count == 1 && !whole ? "float" : "integer");
            case ValueKind::vector: return element("vector");
            case ValueKind::transform:
                return fmt::format("<transform name=\"{}\"><matrix value=\"{}\"/></transform>", escaped(name),
                                   escaped(edit.text));
            case ValueKind::text: return element(numbers && count == 1 && name.ends_with("ior") ? "float" : "string");
            default: break;
        }
        if (pairs) return element("spectrum");
        if (kind == ValueKind::number) return element(numbers && count == 3 ? "rgb" : "float");
        return element(kind == ValueKind::spectrum && count == 1 ? "spectrum" : "rgb");
    }

    struct Numbers {
        bool all = true, whole = true;
        size_t count = 0;
    };
    /// Whether the text is made of numbers, and of whole ones.
    static Numbers count_numbers(std::string text) {
        std::replace(text.begin(), text.end(), ',', ' ');
        Numbers out;
        TextCursor cursor(text);
        for (cursor.skip_space(); out.all && !cursor.done(); cursor.skip_space()) {
            double number = 0;
            out.all = cursor.number(number);
            out.whole = out.whole && number == std::floor(number);
            ++out.count;
        }
        return out;
    }

    /// The kind of a parameter of which nothing is known but its text.
    static ValueKind guessed(const std::string& text, const std::string& name, bool numbers, size_t count) {
        if (text == "true" || text == "false") return ValueKind::boolean;
        if (numbers && count == 1)
            return text.find_first_of(".eE") == std::string::npos ? ValueKind::integer : ValueKind::number;
        const Names places = {"position", "direction", "sun_direction", "center", "p0", "p1"};
        const bool is_place = std::find(places.begin(), places.end(), name) != places.end();
        if (numbers && count == 3) return is_place ? ValueKind::vector : ValueKind::rgb;
        if (numbers && (count == 9 || count == 16)) return ValueKind::transform;
        return numbers || text.find(':') != std::string::npos ? ValueKind::spectrum : ValueKind::text;
    }

    static std::string escaped(const std::string& text) {
        std::string out;
        for (const char c : text)
            out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '"' ? "&quot;" : std::string(1, c);
        return out;
    }

    void set_mesh(const Edit& edit, const Target& at) {
        Object& object = *at.object;
        const Names kinds = {"obj", "ply", "serialized", "mesh"};
        if (!at.parameter.empty() || object.tag != "shape" ||
            std::find(kinds.begin(), kinds.end(), object.type) == kinds.end())
            throw input_error(edit.name, 0,
                              fmt::format("a {} of type '{}' has no arrays of vertices", object.tag, object.type));
        std::string bytes;
        const auto add = [&](const auto& array) {
            bytes += std::to_string(array.size()) + ' ';
            bytes.append(reinterpret_cast<const char*>(array.data()), array.size() * sizeof array[0]);
        };
        add(edit.mesh->positions), add(edit.mesh->normals), add(edit.mesh->uvs), add(edit.mesh->faces);
        const std::string name = "array " + to_hex(sha256(bytes));
        document.given_meshes[name] = edit.mesh;
        if (object.type == "mesh") return set_given(object, "name", name, edit.name);
        object.type = "ply";
        for (const char* gone : {"filename", "flip_tex_coords", "shape_index", "mesh"}) erase(object, gone);
        set_given(object, "mesh", name, edit.name);
    }

    void set_image(const Edit& edit, const Target& at) {
        Object& object = *at.object;
        if (!at.parameter.empty() || (object.type != "bitmap" && object.type != "envmap"))
            throw input_error(edit.name, 0,
                              fmt::format("a {} of type '{}' has no array of texels", object.tag, object.type));
        const Texels& image = *edit.image;
        std::string bytes = fmt::format("{} {} ", image.width, image.height);
        bytes.append(reinterpret_cast<const char*>(image.bytes.data()), image.bytes.size());
        bytes.append(reinterpret_cast<const char*>(image.floats.data()), image.floats.size() * sizeof(float));
        const std::string name = "array " + to_hex(sha256(bytes));
        document.given_images[name] = edit.image;
        for (const char* gone : {"filename", "gamma"}) erase(object, gone);
        set_given(object, "image", name, edit.name);
    }

    void set_given(Object& object, const std::string& parameter, const std::string& name, const std::string& edit) {
        erase(object, parameter);
        set_text(object, parameter, name);
        document.edits[edit] = name;
    }
};

/// A copy that may be changed, and which object of the other each of its objects is.
std::shared_ptr<Document> copy_of(const std::shared_ptr<const Document>& from,
                                  std::map<const Object*, const Object*>& origins) {
    const auto to = std::make_shared<Document>();
    to->search_folders = from->search_folders;
    to->files = from->files;
    to->included_from = from->included_from;
    to->limits = from->limits;
    to->file_digests = from->file_digests;
    to->warnings = from->warnings, to->notes = from->notes;
    to->made_texels = from->made_texels;
    to->smooth_normals = from->smooth_normals;
    to->mirrors_turn_in = from->mirrors_turn_in;
    to->clips_reflectances = from->clips_reflectances;
    to->first = from->first ? from->first : from->meshes.empty() && from->images.empty() ? nullptr : from;
    to->given_meshes = from->given_meshes;
    to->given_images = from->given_images;
    to->edits = from->edits;
    std::unordered_map<const Object*, Object*> copies;
    for (const auto& object : from->storage) {
        to->storage.push_back(std::make_unique<Object>(*object));
        copies[object.get()] = to->storage.back().get();
        origins[to->storage.back().get()] = object.get();
    }
    const auto moved = [&](const Object* object) { return object ? copies.at(object) : nullptr; };
    for (const auto& object : to->storage)
        for (Child& child : object->children) child.object = moved(child.object);
    to->scene = moved(from->scene);
    for (const auto& [id, object] : from->ids) to->ids[id] = moved(object);
    for (const Object* back : from->light_backs) to->light_backs.insert(moved(back));
    return to;
}

void apply(Editor& editor, const std::vector<Edit>& edits) {
    for (const Edit& edit : edits) editor.apply(edit);
    if (!edits.empty()) check_references(editor.document);
}

}  // namespace

void apply_edits(Document& document, const std::vector<Edit>& edits, const Kept* kept) {
    if (edits.empty()) return;
    Editor editor(document, kept);
    apply(editor, edits);
}

Scene edited_scene(const std::string& path, const Editable& from, const LoadOptions& options) {
    std::map<const Object*, const Object*> origins;
    const std::shared_ptr<Document> document = copy_of(from.document, origins);
    Editor editor(*document, from.kept.get());
    editor.origins = std::move(origins);
    apply(editor, options.edits);
    Editable unwanted;
    LoadOptions with_kept = options;
    if (!with_kept.editable) with_kept.editable = &unwanted;
    *with_kept.editable = {nullptr, from.kept};
    return naming_includes(*document, [&] { return load_document(path, document, with_kept); });
}

}  // namespace ambilux
