#include "formats/mitsuba/xml.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <pugixml.hpp>
#include <set>

#include "core/error.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/text_cursor.h"

namespace ambilux::mitsuba {

namespace fs = std::filesystem;

const Value* Object::find(const std::string& name) const {
    for (const Value& value : values)
        if (value.name == name) return &value;
    return nullptr;
}

std::string Document::resolve(const std::string& name, const Where& where) const {
    std::error_code ignored;
    const fs::path path(name);
    if (path.is_absolute() && fs::exists(path, ignored)) return name;
    std::vector<fs::path> folders = {fs::path(where.file).parent_path()};
    folders.insert(folders.end(), search_folders.begin(), search_folders.end());
    if (!files.empty()) folders.push_back(fs::path(files[0].first).parent_path());
    for (const fs::path& folder : folders) {
        const fs::path candidate = folder / path;
        if (fs::exists(candidate, ignored)) return candidate.string();
    }
    throw input_error(where.file, where.line, "file '" + name + "' does not exist");
}

namespace {

[[noreturn]] void fail(const Where& where, const std::string& message) {
    throw input_error(where.file, where.line, message);
}

bool is_object_tag(const std::string& tag) {
    static const std::set<std::string> tags = {"scene",   "integrator", "sensor", "sampler",   "film",
                                               "rfilter", "shape",      "bsdf",   "texture",   "emitter",
                                               "medium",  "phase",      "volume", "subsurface"};
    return tags.count(tag) > 0;
}

/// toWorld -> to_world, intIOR -> int_ior, toUV -> to_uv.
std::string snake_case(const std::string& name) {
    std::string out;
    for (size_t i = 0; i < name.size(); ++i) {
        const bool upper = std::isupper(static_cast<unsigned char>(name[i]));
        if (upper && i > 0 && !std::isupper(static_cast<unsigned char>(name[i - 1])) && name[i - 1] != '_') out += '_';
        out += char(std::tolower(static_cast<unsigned char>(name[i])));
    }
    return out;
}

std::string lower_case(std::string text) {
    for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

double parse_number(const std::string& text, const Where& where, const std::string& what) {
    TextCursor cursor(text);
    cursor.skip_space();
    double value = 0;
    const bool ok = cursor.number(value);
    cursor.skip_space();
    if (!ok || !cursor.done() || !std::isfinite(value)) fail(where, "'" + text + "' is not a number (" + what + ")");
    return value;
}

/// Numbers separated by commas or blanks.
std::vector<double> parse_list(const std::string& text, const Where& where, const std::string& what) {
    std::vector<double> values;
    std::string token;
    const auto flush = [&] {
        if (!token.empty()) values.push_back(parse_number(token, where, what));
        token.clear();
    };
    for (char c : text) {
        if (c == ',' || std::isspace(static_cast<unsigned char>(c)))
            flush();
        else
            token += c;
    }
    flush();
    return values;
}

float srgb_to_linear(double v) { return float(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4)); }

struct Parser {
    Document& document;
    std::map<std::string, std::string> parameters;
    std::set<std::string> given, used;
    std::vector<std::string> open_files;  ///< canonical paths of the files being parsed

    // One file.
    struct Source {
        std::string path;
        std::vector<ptrdiff_t> line_ends;
        int version = 3;
    };

    static Where where(const Source& source, ptrdiff_t offset) {
        const auto it = std::lower_bound(source.line_ends.begin(), source.line_ends.end(), offset);
        return {source.path, int(it - source.line_ends.begin()) + 1};
    }
    static Where where(const Source& source, const pugi::xml_node& node) { return where(source, node.offset_debug()); }

    /// Puts the values of $parameters into the text; the longest known name wins.
    std::string substitute(const std::string& text, const Where& at) {
        std::string out;
        for (size_t i = 0; i < text.size();) {
            if (text[i] != '$') {
                out += text[i++];
                continue;
            }
            size_t end = i + 1;
            while (end < text.size() && (std::isalnum(static_cast<unsigned char>(text[end])) || text[end] == '_'))
                ++end;
            size_t stop = end;
            while (stop > i + 1 && !parameters.count(text.substr(i + 1, stop - i - 1))) --stop;
            if (stop == i + 1) fail(at, "parameter '" + text.substr(i, end - i) + "' has no value and no <default>");
            const std::string name = text.substr(i + 1, stop - i - 1);
            used.insert(name);
            out += parameters[name];
            i = stop;
        }
        return out;
    }

    /// Attribute with parameters put in; an error if it is missing.
    std::string attribute(const Source& source, const pugi::xml_node& node, const char* name) {
        const pugi::xml_attribute a = node.attribute(name);
        const Where at = where(source, node);
        if (!a) fail(at, std::string("<") + node.name() + "> has no attribute '" + name + "'");
        return substitute(a.value(), at);
    }

    static void allow(const Source& source, const pugi::xml_node& node, std::initializer_list<const char*> names) {
        for (const pugi::xml_attribute& a : node.attributes())
            if (std::none_of(names.begin(), names.end(), [&](const char* n) { return std::string(n) == a.name(); }))
                fail(where(source, node),
                     std::string("unexpected attribute '") + a.name() + "' in <" + node.name() + ">");
    }

    std::string parameter_name(const Source& source, const pugi::xml_node& node) {
        std::string name = node.attribute("name") ? attribute(source, node, "name") : "";
        return source.version < 2 ? snake_case(name) : name;
    }

    double number_or(const Source& source, const pugi::xml_node& node, const char* name, double fallback) {
        return node.attribute(name) ? parse_number(attribute(source, node, name), where(source, node), name) : fallback;
    }

    Vec3d triple(const Source& source, const pugi::xml_node& node, double fallback, bool allow_single) {
        const Where at = where(source, node);
        if (!node.attribute("value"))
            return {number_or(source, node, "x", fallback), number_or(source, node, "y", fallback),
                    number_or(source, node, "z", fallback)};
        if (node.attribute("x") || node.attribute("y") || node.attribute("z"))
            fail(at, std::string("<") + node.name() + "> has both 'value' and x, y, z");
        const std::vector<double> v = parse_list(attribute(source, node, "value"), at, node.name());
        if (v.size() == 1 && allow_single) return {v[0], v[0], v[0]};
        if (v.size() == 2) return {v[0], v[1], fallback};
        if (v.size() != 3)
            fail(at, std::string("<") + node.name() + "> needs three numbers, not " + std::to_string(v.size()));
        return {v[0], v[1], v[2]};
    }

    Matrix parse_transform(const Source& source, const pugi::xml_node& node) {
        Matrix total;
        for (const pugi::xml_node& step : node.children()) {
            if (step.type() != pugi::node_element) continue;
            const std::string tag = lower_case(step.name());
            const Where at = where(source, step);
            Matrix m;
            if (tag == "translate") {
                allow(source, step, {"x", "y", "z", "value"});
                const Vec3d v = triple(source, step, 0, false);
                m = translation(v.x, v.y, v.z);
            } else if (tag == "scale") {
                allow(source, step, {"x", "y", "z", "value"});
                const Vec3d v = triple(source, step, 1, true);
                m = scaling(v.x, v.y, v.z);
            } else if (tag == "rotate") {
                allow(source, step, {"x", "y", "z", "value", "angle"});
                const Vec3d axis = triple(source, step, 0, false);
                if (!(length(axis) > 0)) fail(at, "<rotate> has no axis");
                m = rotation(axis.x, axis.y, axis.z, parse_number(attribute(source, step, "angle"), at, "angle"));
            } else if (tag == "lookat") {
                allow(source, step, {"origin", "target", "up"});
                Vec3d v[3] = {};
                const char* names[3] = {"origin", "target", "up"};
                for (int i = 0; i < 3; ++i) {
                    const std::vector<double> list = parse_list(attribute(source, step, names[i]), at, names[i]);
                    if (list.size() != 3) fail(at, std::string("'") + names[i] + "' of <lookat> needs three numbers");
                    v[i] = {list[0], list[1], list[2]};
                }
                bool valid = true;
                m = look_at(v[0], v[1], v[2], valid);
                if (!valid)
                    fail(at, "<lookat> is degenerate: target equals origin, or up is zero or along the view direction");
            } else if (tag == "matrix") {
                allow(source, step, {"value"});
                const std::vector<double> v = parse_list(attribute(source, step, "value"), at, "matrix");
                if (v.size() != 16 && v.size() != 9)
                    fail(at, "<matrix> needs 16 or 9 numbers, not " + std::to_string(v.size()));
                const size_t n = v.size() == 16 ? 4 : 3;
                for (size_t i = 0; i < v.size(); ++i) m.m[i / n][i % n] = v[i];
                if (!is_affine(m)) fail(at, "<matrix> is not affine: its last row must be 0 0 0 1");
            } else {
                fail(at, std::string("unknown element <") + step.name() + "> in <transform>");
            }
            total = m * total;
        }
        return total;
    }

    Value parse_color(const Source& source, const pugi::xml_node& node, const std::string& tag) {
        Value value;
        value.kind = ValueKind::rgb;
        const Where at = where(source, node);
        const std::string text = attribute(source, node, "value");
        std::vector<double> c;
        if (!text.empty() && text[0] == '#') {
            uint32_t hex = 0;
            const auto result = std::from_chars(text.data() + 1, text.data() + text.size(), hex, 16);
            if (text.size() != 7 || result.ec != std::errc() || result.ptr != text.data() + text.size())
                fail(at, "'" + text + "' is not a colour of the form #rrggbb");
            c = {(hex >> 16 & 255) / 255.0, (hex >> 8 & 255) / 255.0, (hex & 255) / 255.0};
        } else {
            c = parse_list(text, at, tag);
            if (c.size() == 1) c.resize(3, c[0]);
        }
        if (c.size() != 3) fail(at, "<" + tag + "> needs one or three numbers, not " + std::to_string(c.size()));
        if (tag == "srgb")
            value.vector = {srgb_to_linear(c[0]), srgb_to_linear(c[1]), srgb_to_linear(c[2])};
        else
            value.vector = {float(c[0]), float(c[1]), float(c[2])};
        return value;
    }

    Value parse_spectrum(const Source& source, const pugi::xml_node& node) {
        Value value;
        value.kind = ValueKind::spectrum;
        const Where at = where(source, node);
        std::string text;
        if (node.attribute("filename")) {
            const std::string path = document.resolve(attribute(source, node, "filename"), at);
            const std::string bytes = read_file_bytes(path);
            document.files.push_back({path, bytes});
            TextCursor cursor(bytes);
            for (; !cursor.done(); cursor.next_line()) {
                const std::string wavelength(cursor.word()), amount(cursor.word());
                if (wavelength.empty() || wavelength[0] == '#') continue;
                value.samples.push_back({parse_number(wavelength, {path, cursor.line}, "wavelength"),
                                         parse_number(amount, {path, cursor.line}, "value")});
            }
        } else {
            text = attribute(source, node, "value");
            if (text.find(':') == std::string::npos) {
                const std::vector<double> list = parse_list(text, at, "spectrum");
                if (list.size() == 3 && source.version < 2) {  // three bins are RGB in the older generation
                    value.kind = ValueKind::rgb;
                    value.vector = {float(list[0]), float(list[1]), float(list[2])};
                } else if (list.size() == 1) {
                    value.number = list[0];
                } else {
                    fail(at, "<spectrum> needs one number or a list of wavelength:value");
                }
                return value;
            }
            for (char& c : text)
                if (c == ':') c = ' ';
            const std::vector<double> list = parse_list(text, at, "spectrum");
            if (list.size() % 2) fail(at, "<spectrum> needs pairs of wavelength:value");
            for (size_t i = 0; i < list.size(); i += 2) value.samples.push_back({list[i], list[i + 1]});
        }
        if (value.samples.size() < 2) fail(at, "<spectrum> needs at least two pairs of wavelength:value");
        for (size_t i = 1; i < value.samples.size(); ++i)
            if (!(value.samples[i].first > value.samples[i - 1].first)) fail(at, "wavelengths of <spectrum> must rise");
        return value;
    }

    Value parse_value(const Source& source, const pugi::xml_node& node, const std::string& tag) {
        Value value;
        const Where at = where(source, node);
        const auto text = [&] { return attribute(source, node, "value"); };
        if (tag == "transform") {
            allow(source, node, {"name"});
            value.kind = ValueKind::transform;
            value.transform = parse_transform(source, node);
        } else if (tag == "point" || tag == "vector") {
            allow(source, node, {"name", "x", "y", "z", "value"});
            value.kind = ValueKind::vector;
            const Vec3d v = triple(source, node, 0, false);
            value.vector = {float(v.x), float(v.y), float(v.z)};
        } else if (tag == "spectrum") {
            allow(source, node, {"name", "value", "filename"});
            value = parse_spectrum(source, node);
        } else {
            allow(source, node, {"name", "value"});
            if (tag == "boolean") {
                const std::string flag = lower_case(text());
                if (flag != "true" && flag != "false") fail(at, "'" + flag + "' is neither true nor false");
                value.kind = ValueKind::boolean;
                value.number = flag == "true";
            } else if (tag == "integer") {
                value.kind = ValueKind::integer;
                value.number = parse_number(text(), at, tag);
                if (value.number != std::floor(value.number) || std::fabs(value.number) > 9e15)
                    fail(at, "'" + text() + "' is not an integer");
            } else if (tag == "float") {
                value.kind = ValueKind::number;
                value.number = parse_number(text(), at, tag);
            } else if (tag == "string") {
                value.kind = ValueKind::text;
                value.text = text();
            } else {
                value = parse_color(source, node, tag);
            }
        }
        value.name = parameter_name(source, node);
        value.where = at;
        if (value.name.empty()) fail(at, "<" + tag + "> has no name");
        return value;
    }

    void parse_children(const Source& source, const pugi::xml_node& node, Object& object) {
        for (const pugi::xml_node& child : node.children()) {
            if (child.type() != pugi::node_element) continue;
            std::string tag = child.name();
            if (tag == "lookAt") tag = "lookat";
            const Where at = where(source, child);
            static const std::set<std::string> value_tags = {"boolean", "integer", "float", "string",   "point",
                                                             "vector",  "rgb",     "srgb",  "spectrum", "transform"};
            if (value_tags.count(tag)) {
                Value value = parse_value(source, child, tag);
                if (object.find(value.name)) fail(at, "parameter '" + value.name + "' is given twice");
                object.values.push_back(std::move(value));
            } else if (tag == "ref") {
                allow(source, child, {"name", "id"});
                object.children.push_back({parameter_name(source, child), at, attribute(source, child, "id"), nullptr});
            } else if (tag == "default") {
                allow(source, child, {"name", "value"});
                parameters.try_emplace(attribute(source, child, "name"), attribute(source, child, "value"));
            } else if (tag == "path") {
                allow(source, child, {"value"});
                const std::string folder = attribute(source, child, "value");
                document.search_folders.push_back(document.resolve(folder, at));
            } else if (tag == "alias") {
                allow(source, child, {"id", "as"});
                const std::string id = attribute(source, child, "id");
                if (!document.ids.count(id)) fail(at, "alias of unknown id '" + id + "'");
                add_id(attribute(source, child, "as"), document.ids[id], at);
            } else if (tag == "include") {
                allow(source, child, {"filename"});
                if (object.tag != "scene") fail(at, "<include> is only allowed in <scene>");
                parse_file(document.resolve(attribute(source, child, "filename"), at), at);
            } else if (is_object_tag(tag) && tag != "scene") {
                const Object* nested = parse_object(source, child, tag);
                object.children.push_back({parameter_name(source, child), at, "", nested});
            } else {
                fail(at, "unknown element <" + tag + ">");
            }
        }
    }

    void add_id(const std::string& id, const Object* object, const Where& at) {
        const auto [it, added] = document.ids.emplace(id, object);
        if (!added)
            fail(at, "id '" + id + "' is already used at " + it->second->where.file + ":" +
                         std::to_string(it->second->where.line));
    }

    Object* parse_object(const Source& source, const pugi::xml_node& node, const std::string& tag) {
        allow(source, node, {"type", "id", "name"});
        document.storage.push_back(std::make_unique<Object>());
        Object* object = document.storage.back().get();
        object->tag = tag;
        object->where = where(source, node);
        object->version = source.version;
        object->type = attribute(source, node, "type");
        if (node.attribute("id")) {
            object->id = attribute(source, node, "id");
            add_id(object->id, object, object->where);
        }
        parse_children(source, node, *object);
        return object;
    }

    void parse_file(const std::string& path, const Where& from) {
        std::error_code ignored;
        const fs::path canonical = fs::weakly_canonical(path, ignored);
        if (std::find(open_files.begin(), open_files.end(), canonical.string()) != open_files.end())
            fail(from, "circular include of '" + path + "'");
        open_files.push_back(canonical.string());

        const std::string bytes = read_file_bytes(path);
        document.files.push_back({path, bytes});
        Source source;
        source.path = path;
        for (size_t i = 0; i < bytes.size(); ++i)
            if (bytes[i] == '\n') source.line_ends.push_back(ptrdiff_t(i));
        pugi::xml_document xml;
        const pugi::xml_parse_result result = xml.load_buffer(bytes.data(), bytes.size());
        if (!result) fail(where(source, result.offset), std::string("XML error: ") + result.description());
        const pugi::xml_node root = xml.document_element();
        if (!root || std::string(root.name()) != "scene")
            fail(where(source, root ? root.offset_debug() : 0), "the outermost element is not <scene>");
        allow(source, root, {"version", "type", "id"});
        if (root.attribute("version")) {
            const std::string version = root.attribute("version").value();
            TextCursor cursor(version);
            if (!cursor.number(source.version)) fail(where(source, root), "'" + version + "' is not a version");
        }
        if (!document.scene) {
            document.storage.push_back(std::make_unique<Object>());
            document.scene = document.storage.back().get();
            document.scene->tag = "scene";
            document.scene->where = where(source, root);
            document.scene->version = source.version;
        }
        parse_children(source, root, *document.scene);
        open_files.pop_back();
    }

    void resolve_references() {
        for (const auto& object : document.storage)
            for (Child& child : object->children)
                if (!child.object) {
                    const auto it = document.ids.find(child.ref);
                    if (it == document.ids.end()) fail(child.where, "reference to unknown id '" + child.ref + "'");
                    child.object = it->second;
                }
        // Objects must not contain themselves.
        std::map<const Object*, int> state;  // 1: being visited, 2: done
        const std::function<void(const Object*)> visit = [&](const Object* object) {
            state[object] = 1;
            for (const Child& child : object->children) {
                const int s = state[child.object];
                if (s == 1) fail(child.where, "circular reference to id '" + child.object->id + "'");
                if (s == 0) visit(child.object);
            }
            state[object] = 2;
        };
        visit(document.scene);
    }
};

}  // namespace

Document parse_document(const std::string& path, const std::vector<std::pair<std::string, std::string>>& parameters) {
    Document document;
    Parser parser{document, {}, {}, {}, {}};
    for (const auto& [name, value] : parameters) {
        parser.parameters[name] = value;
        parser.given.insert(name);
    }
    parser.parse_file(path, {path, 0});
    for (const std::string& name : parser.given)
        if (!parser.used.count(name)) throw input_error(path, 0, "the scene has no parameter '$" + name + "'");
    parser.resolve_references();
    return document;
}

}  // namespace ambilux::mitsuba
