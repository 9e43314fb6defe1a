// Spectra that are objects: <spectrum type="..."> of format 3 and <blackbody> of the older generation.
#include <cmath>

#include "formats/document/plugins.h"
#include "formats/document/spectrum.h"
#include "formats/mitsuba/xml_values.h"

namespace ambilux::mitsuba {
namespace {

double positive(const Value& value) {
    if (!(value.number > 0 && std::isfinite(value.number)))
        fail(value.where, "'" + value.name + "' of a spectrum must be positive");
    return value.number;
}

}  // namespace

bool ValueParser::is_spectrum_plugin(const std::string& type) {
    return is_one_of({"uniform", "rawconstant", "d65", "srgb", "blackbody", "regular", "irregular"}, type);
}

Value ValueParser::parse_blackbody(const XmlSource& source, const pugi::xml_node& node) {
    const Where at = where(source, node);
    std::string text = attribute(source, node, "temperature");
    while (!text.empty() && (text.back() == 'K' || text.back() == 'k' || text.back() == ' ')) text.pop_back();
    Value kelvin, out;
    kelvin.name = "temperature";
    kelvin.where = at;
    kelvin.number = parse_number(text, at, "temperature");
    out.kind = ValueKind::spectrum;
    out.samples = planck(positive(kelvin), number_or(source, node, "scale", 1));
    return out;
}

Value ValueParser::parse_spectrum_plugin(const XmlSource& source, const pugi::xml_node& node) {
    allow(source, node, {"name", "type", "id"});
    const Where at = where(source, node);
    const std::string type = attribute(source, node, "type");
    std::map<std::string, Value> given;
    for (const pugi::xml_node& child : node.children()) {
        if (child.type() != pugi::node_element) continue;
        if (!is_value_tag(child.name()) || child.attribute("type"))
            fail(where(source, child), "a spectrum holds values only");
        Value value = parse_value(source, child, child.name());
        const std::string name = value.name;
        given.insert_or_assign(name, std::move(value));
    }
    const auto take = [&](const char* name) {
        const auto entry = given.extract(name);
        if (!entry) fail(at, "a spectrum of type '" + type + "' has no '" + name + "'");
        return entry.mapped();
    };
    const auto number_of = [&](const char* name, double fallback) {
        return given.contains(name) ? take(name).number : fallback;
    };
    const auto list_of = [&](const char* name) {
        const Value value = take(name);
        return value.kind == ValueKind::text ? parse_list(value.text, value.where, name)
                                             : std::vector<double>{value.number};
    };

    Value out;
    out.kind = ValueKind::spectrum;
    if (type == "uniform" || type == "rawconstant") {
        const Value value = take("value");
        out.kind = value.kind == ValueKind::rgb ? ValueKind::rgb : ValueKind::spectrum;
        out.rgb = value.rgb;
        out.number = value.number;
        if (value.kind == ValueKind::vector) {
            out.kind = ValueKind::rgb;
            out.rgb = {float(value.vector.x), float(value.vector.y), float(value.vector.z)};
        }
    } else if (type == "d65" || type == "srgb") {
        const double scale = number_of("scale", 1);
        const char* name = given.contains("value") ? "value" : "color";
        if (given.contains(name)) {
            out = take(name);
            out.rgb = (out.kind == ValueKind::rgb ? out.rgb : splat(float(out.number))) * float(scale);
            out.kind = ValueKind::rgb;
        } else {
            out.number = scale;
        }
    } else if (type == "blackbody") {
        const double scale = number_of("scale", 1);
        out.samples = planck(positive(take("temperature")), scale);
    } else if (type == "irregular" || type == "regular") {
        const std::vector<double> values = list_of("values");
        std::vector<double> waves;
        if (type == "irregular") {
            waves = list_of("wavelengths");
        } else {
            const double first = number_of("wavelength_min", 360), last = number_of("wavelength_max", 830);
            for (size_t i = 0; i < values.size(); ++i)
                waves.push_back(first + (last - first) * double(i) / std::max<double>(double(values.size()) - 1, 1));
        }
        if (waves.size() != values.size() || waves.size() < 2)
            fail(at, "a spectrum needs as many wavelengths as values, and two at least");
        for (size_t i = 0; i < waves.size(); ++i) {
            if (i > 0 && !(waves[i] > waves[i - 1])) fail(at, "wavelengths of <spectrum> must rise");
            out.samples.push_back({waves[i], values[i]});
        }
    } else {
        fail(at, "spectrum type '" + type + "' is not supported");
    }
    for (const char* name : {"wavelength_min", "wavelength_max"}) given.erase(name);
    if (!given.empty())
        fail(given.begin()->second.where,
             "unknown parameter '" + given.begin()->first + "' of a spectrum of type '" + type + "'");
    return out;
}

}  // namespace ambilux::mitsuba
