#include "formats/mitsuba/xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/document/plugins.h"
#include "formats/file_budget.h"
#include "formats/mitsuba/xml_values.h"

namespace ambilux::mitsuba {

namespace fs = std::filesystem;

namespace {

const Plugins& object_tags() {
    static const Plugins tags = {"scene", "integrator", "sensor",  "sampler", "film",  "rfilter", "shape",
                                 "bsdf",  "texture",    "emitter", "medium",  "phase", "volume",  "subsurface"};
    return tags;
}
bool is_object_tag(const std::string& tag) { return is_one_of(object_tags(), tag); }

[[noreturn]] void fail_unknown(const Where& at, const std::string& tag) {
    const auto known = plugins();
    const auto plugin = known.find(tag);
    const std::string near = nearest_name(object_tags(), tag);
    fail(at, "unknown element <" + tag + ">" +
                 (plugin != known.end() ? ": '" + tag + "' is a type of <" + plugin->second + ">"
                  : near.empty()        ? ""
                                        : ": <" + near + "> is known"));
}

constexpr int kNewestVersion = 3;

struct Parser {
    Document& document;
    ValueParser values;
    std::vector<std::string> open_files;  ///< canonical paths of the files being parsed

    void parse_children(const XmlSource& source, const pugi::xml_node& node, Object& object, uint64_t depth) {
        check_nesting(document.limits, depth, where(source, node), "elements");
        std::set<std::string> names;
        for (const pugi::xml_node& child : node.children()) {
            if (child.type() != pugi::node_element) continue;
            std::string tag = child.name();
            // Names of format 0.3.
            if (tag == "luminaire") tag = "emitter";
            if (tag == "camera") tag = "sensor";
            const Where at = where(source, child);
            // Mitsuba 2 has one element for both.
            if (tag == "spectrum" && child.attribute("type") &&
                is_one_of(texture_plugins(), values.attribute(source, child, "type")) &&
                !ValueParser::is_spectrum_plugin(values.attribute(source, child, "type")))
                tag = "texture";
            if (ValueParser::is_value_tag(tag)) {
                Value value = values.parse_value(source, child, tag);
                if (names.insert(value.name).second)
                    object.values.push_back(std::move(value));
                else
                    replace_value(source, object, std::move(value));
            } else if (tag == "ref") {
                ValueParser::allow(source, child, {"name", "id"});
                object.children.push_back(
                    {values.parameter_name(source, child), at, values.attribute(source, child, "id"), nullptr});
            } else if (tag == "default") {
                ValueParser::allow(source, child, {"name", "value"});
                values.set_default(values.attribute(source, child, "name"), values.attribute(source, child, "value"));
            } else if (tag == "path") {
                ValueParser::allow(source, child, {"value"});
                const std::string folder = values.attribute(source, child, "value");
                check_includes(document.search_folders.size() + 1, at);
                // As in Mitsuba: beside the file that names it, else where files are looked for.
                std::error_code ignored;
                const fs::path beside = fs::path(source.path).parent_path() / folder;
                document.search_folders.push_back(fs::exists(beside, ignored) ? beside.string()
                                                                              : document.resolve(folder, at));
            } else if (tag == "alias") {
                ValueParser::allow(source, child, {"id", "as"});
                const std::string id = values.attribute(source, child, "id");
                if (!document.ids.count(id)) fail(at, "alias of unknown id '" + id + "'");
                add_id(values.attribute(source, child, "as"), document.ids[id], at);
            } else if (tag == "include") {
                ValueParser::allow(source, child, {"filename"});
                if (object.tag != "scene") fail(at, "<include> is only allowed in <scene>");
                parse_file(document.resolve(values.attribute(source, child, "filename"), at), at, depth + 1);
            } else if (is_object_tag(tag) && tag != "scene") {
                const Object* nested = parse_object(source, child, tag, depth + 1);
                object.children.push_back({values.parameter_name(source, child), at, "", nested});
            } else {
                fail_unknown(at, tag);
            }
        }
    }

    /// The last one counts in Mitsuba 0.6.
    void replace_value(const XmlSource& source, Object& object, Value value) {
        if (source.version >= 2) fail(value.where, "parameter '" + value.name + "' is given twice");
        document.notes.push_back(value.where.text() + ": parameter '" + value.name +
                                 "' is given twice; the last one counts");
        for (Value& v : object.values)
            if (v.name == value.name) v = value;
    }

    void add_id(const std::string& id, const Object* object, const Where& at) {
        const auto [it, added] = document.ids.emplace(id, object);
        if (!added) fail(at, "id '" + id + "' is already used at " + it->second->where.text());
    }

    void check_includes(size_t count, const Where& at) const {
        if (count > document.limits.includes)
            fail(at, "more files or folders than --limits includes=" + std::to_string(document.limits.includes));
    }

    Object* parse_object(const XmlSource& source, const pugi::xml_node& node, const std::string& tag, uint64_t depth) {
        ValueParser::allow(source, node, {"type", "id", "name"});
        Object* object = &add_object(document, tag, values.attribute(source, node, "type"), where(source, node));
        object->version = source.version;
        if (node.attribute("id")) {
            object->id = values.attribute(source, node, "id");
            add_id(object->id, object, object->where);
        }
        parse_children(source, node, *object, depth);
        return object;
    }

    void parse_file(const std::string& path, const Where& from, uint64_t depth) {
        std::error_code ignored;
        const fs::path canonical = fs::weakly_canonical(path, ignored);
        if (std::find(open_files.begin(), open_files.end(), canonical.string()) != open_files.end())
            fail(from, "circular include of '" + path + "'");
        open_files.push_back(canonical.string());

        check_includes(document.files.size(), from);
        if (depth > 1) document.included_from.try_emplace(path, from);
        parse_scene(path, read_input(path, document.limits), depth);
        open_files.pop_back();
    }

    void parse_scene(const std::string& path, const std::string& text, uint64_t depth) {
        document.files.push_back({path, std::make_shared<const std::string>(text)});
        parse_text(path, text, depth, document.scene);
    }

    /// Into `to`, which is made if it is null. What is not the document's scene stands in no file.
    void parse_text(const std::string& path, const std::string& text, uint64_t depth, Object*& to) {
        const std::string bytes = expand_entities(document, path, plain_text_of_utf16(path, text));
        XmlSource source;
        source.path = path;
        source.has_lines = &to == &document.scene;
        for (size_t i = 0; i < bytes.size(); ++i)
            if (bytes[i] == '\n') source.line_ends.push_back(ptrdiff_t(i));
        pugi::xml_document xml;
        const pugi::xml_parse_result result = xml.load_buffer(bytes.data(), bytes.size());
        if (!result) fail(where(source, result.offset), std::string("XML error: ") + result.description());
        const pugi::xml_node root = xml.document_element();
        if (!root || std::string(root.name()) != "scene")
            fail(where(source, root ? root.offset_debug() : 0), "the outermost element is not <scene>");
        for (pugi::xml_node next = root.next_sibling(); next; next = next.next_sibling())
            if (next.type() == pugi::node_element)
                fail(where(source, next), std::string("<") + next.name() + "> stands behind the end of the scene");
        ValueParser::allow(source, root, {"version", "type", "id"});
        if (root.attribute("version")) {
            const std::string version = root.attribute("version").value();
            TextCursor cursor(version);
            if (!cursor.number(source.version) || source.version < 0 || source.version > kNewestVersion)
                fail(where(source, root),
                     "'" + version + "' is no version that is known (0.5 to " + std::to_string(kNewestVersion) + ".x)");
        }
        if (!to) {
            to = &add_object(document, "scene", "", where(source, root));
            to->version = source.version;
        }
        parse_children(source, root, *to, depth);
    }

    void resolve_references() {
        for (const auto& object : document.storage)
            for (Child& child : object->children)
                if (!child.object) {
                    const auto it = document.ids.find(child.ref);
                    if (it == document.ids.end())
                        fail(child.where,
                             "reference to unknown id '" + child.ref + "'" + suggestion(document.ids, child.ref));
                    child.object = it->second;
                }
        check_references(document);
    }
};

}  // namespace

void parse_document(Document& document, const std::string& path,
                    const std::vector<std::pair<std::string, std::string>>& parameters, const std::string* text) {
    Parser parser{document, ValueParser(document), {}};
    std::set<std::string> given;
    for (const auto& [name, value] : parameters) {
        parser.values.set_parameter(name, value);
        given.insert(name);
    }
    if (text)
        parser.parse_scene(path, *text, 1);
    else
        parser.parse_file(path, {path, 0}, 1);
    for (const std::string& name : given)
        if (!parser.values.is_used(name)) throw input_error(path, 0, "the scene has no parameter '$" + name + "'");
    parser.resolve_references();
}

Object& parse_elements(Document& document, const std::string& name, const std::string& elements, int version) {
    Parser parser{document, ValueParser(document), {}};
    Object* holder = nullptr;
    parser.parse_text(name, fmt::format("<scene version=\"{}.0.0\">{}</scene>", version, elements), 1, holder);
    parser.resolve_references();
    return *holder;
}

}  // namespace ambilux::mitsuba
