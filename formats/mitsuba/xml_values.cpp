#include "formats/mitsuba/xml_values.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/srgb.h"
#include "core/text.h"
#include "core/text_cursor.h"
#include "formats/document/plugins.h"
#include "formats/file_budget.h"

namespace ambilux::mitsuba {
namespace {

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

/// Up vector of a <lookat> without one: the second tangent of Duff et al. 2017 about the view direction, as Mitsuba 3.
Vec3d any_up(Vec3d d) {
    const auto [x, y, z] = unit(d);
    const double sign = std::copysign(1.0, z), a = -1 / (sign + z);
    return {1 + sign * x * x * a, sign * x * y * a, -sign * x};
}

}  // namespace

Where where(const XmlSource& source, ptrdiff_t offset) {
    const auto it = std::lower_bound(source.line_ends.begin(), source.line_ends.end(), offset);
    return {source.path, source.has_lines ? int(it - source.line_ends.begin()) + 1 : 0};
}
Where where(const XmlSource& source, const pugi::xml_node& node) { return where(source, node.offset_debug()); }

std::string ValueParser::substitute(const std::string& text, const Where& at) {
    std::string out;
    for (size_t i = 0; i < text.size();) {
        if (text[i] != '$') {
            out += text[i++];
            continue;
        }
        size_t end = i + 1;
        while (end < text.size() && (std::isalnum(static_cast<unsigned char>(text[end])) || text[end] == '_')) ++end;
        size_t stop = end;
        while (stop > i + 1 && !parameters_.count(text.substr(i + 1, stop - i - 1))) --stop;
        // Labels of films name what is known after rendering ($scene['renderTime']): no parameters, as in Mitsuba 0.6.
        if (stop == i + 1 && end > stop && end < text.size() && text[end] == '[') {
            out += text.substr(i, end - i);
            i = end;
            continue;
        }
        if (stop == i + 1) fail(at, "parameter '" + text.substr(i, end - i) + "' has no value and no <default>");
        const std::string name = text.substr(i + 1, stop - i - 1);
        used_.insert(name);
        const std::string& value = parameters_[name];
        expanded_ += value.size();
        if (expanded_ > document_.limits.expansion)
            fail(at, "parameters expand to more characters than --limits expansion=" +
                         std::to_string(document_.limits.expansion));
        out += value;
        i = stop;
    }
    return out;
}

std::string ValueParser::attribute(const XmlSource& source, const pugi::xml_node& node, const char* name) {
    const pugi::xml_attribute a = node.attribute(name);
    const Where at = where(source, node);
    if (!a) fail(at, std::string("<") + node.name() + "> has no attribute '" + name + "'");
    return substitute(a.value(), at);
}

void ValueParser::allow(const XmlSource& source, const pugi::xml_node& node, std::initializer_list<const char*> names) {
    for (const pugi::xml_attribute& a : node.attributes())
        if (std::none_of(names.begin(), names.end(), [&](const char* n) { return std::string(n) == a.name(); }))
            fail(where(source, node), std::string("unexpected attribute '") + a.name() + "' in <" + node.name() + ">" +
                                          suggestion({names.begin(), names.end()}, a.name()));
}

std::string ValueParser::parameter_name(const XmlSource& source, const pugi::xml_node& node) {
    std::string name = node.attribute("name") ? attribute(source, node, "name") : "";
    return source.version < 2 ? snake_case(name) : name;
}

double ValueParser::number_or(const XmlSource& source, const pugi::xml_node& node, const char* name, double fallback) {
    return node.attribute(name) ? parse_number(attribute(source, node, name), where(source, node), name) : fallback;
}

Vec3d ValueParser::triple(const XmlSource& source, const pugi::xml_node& node, double fallback, bool allow_single) {
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

Matrix ValueParser::parse_transform(const XmlSource& source, const pugi::xml_node& node) {
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
                if (i == 2 && !step.attribute("up")) continue;
                const std::vector<double> list = parse_list(attribute(source, step, names[i]), at, names[i]);
                if (list.size() != 3) fail(at, std::string("'") + names[i] + "' of <lookat> needs three numbers");
                v[i] = {list[0], list[1], list[2]};
            }
            if (!(length(v[2]) > 0)) v[2] = any_up(v[1] - v[0]);
            bool valid = true;
            m = look_at(v[0], v[1], v[2], valid);
            if (!valid) fail(at, "<lookat> is degenerate: target equals origin, or up is along the view direction");
        } else if (tag == "matrix") {
            allow(source, step, {"value"});
            const std::vector<double> v = parse_list(attribute(source, step, "value"), at, "matrix");
            if (v.size() != 16 && v.size() != 9)
                fail(at, "<matrix> needs 16 or 9 numbers, not " + std::to_string(v.size()));
            const size_t n = v.size() == 16 ? 4 : 3;
            for (size_t i = 0; i < v.size(); ++i) m.m[i / n][i % n] = v[i];
            if (!is_affine(m)) fail(at, "<matrix> is not affine: its last row must be 0 0 0 1");
        } else {
            fail(at, std::string("unknown element <") + step.name() + "> in <transform>" +
                         suggestion({"translate", "scale", "rotate", "lookat", "matrix"}, tag));
        }
        total = m * total;
    }
    return total;
}

Value ValueParser::parse_color(const XmlSource& source, const pugi::xml_node& node, const std::string& tag) {
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
        value.rgb = {float(srgb_to_linear(c[0])), float(srgb_to_linear(c[1])), float(srgb_to_linear(c[2]))};
    else
        value.rgb = {float(c[0]), float(c[1]), float(c[2])};
    return value;
}

Value ValueParser::parse_spectrum(const XmlSource& source, const pugi::xml_node& node) {
    Value value;
    value.kind = ValueKind::spectrum;
    const Where at = where(source, node);
    std::string text;
    if (node.attribute("filename")) {
        const std::string path = document_.resolve(attribute(source, node, "filename"), at);
        const std::string bytes = read_input(path, document_.limits);
        document_.files.push_back({path, std::make_shared<const std::string>(bytes)});
        const std::string plain = plain_text(path, bytes);
        TextCursor cursor(plain);
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
                value.rgb = {float(list[0]), float(list[1]), float(list[2])};
            } else if (list.size() == 1) {
                value.number = list[0];
                value.equal_energy = source.version >= 2;
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

Value ValueParser::parse_value(const XmlSource& source, const pugi::xml_node& node, const std::string& tag) {
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
        value.vector = triple(source, node, 0, false);
    } else if (tag == "spectrum" && node.attribute("type")) {
        value = parse_spectrum_plugin(source, node);
    } else if (tag == "spectrum") {
        allow(source, node, {"name", "value", "filename", "intent"});
        value = parse_spectrum(source, node);
    } else if (tag == "blackbody") {
        allow(source, node, {"name", "temperature", "scale"});
        value = parse_blackbody(source, node);
    } else if (tag == "rgb" || tag == "srgb") {
        allow(source, node, {"name", "value", "intent"});  // the use of the colour tells the intent
        value = parse_color(source, node, tag);
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
        } else {
            value.kind = ValueKind::text;
            value.text = text();
        }
    }
    value.name = parameter_name(source, node);
    value.where = at;
    if (value.name.empty()) fail(at, "<" + tag + "> has no name");
    return value;
}

bool ValueParser::is_value_tag(const std::string& tag) {
    static const std::set<std::string> tags = {"boolean", "integer", "float",    "string",    "point",    "vector",
                                               "rgb",     "srgb",    "spectrum", "transform", "blackbody"};
    return tags.contains(tag);
}

}  // namespace ambilux::mitsuba
