// Spectra that are objects: <spectrum type="..."> of format 3 and <blackbody> of the older generation.
#include <cmath>

#include "formats/document/plugins.h"
#include "formats/document/spectrum.h"
#include "formats/mitsuba/xml_values.h"

namespace ambilux::mitsuba {
namespace {

Value spectrum_value() {
    Value out;
    out.kind = ValueKind::spectrum;
    return out;
}

double positive(const Value& value) {
    if (!(value.number > 0 && std::isfinite(value.number)))
        fail(value.where, "'" + value.name + "' of a spectrum must be positive");
    return value.number;
}

/// A spectrum of format 3 and the values that it was given, each of which is taken once.
struct SpectrumPlugin {
    Where at;
    std::string type;
    std::map<std::string, Value> given;

    Value value() {
        Value out = value_of_type();
        for (const char* name : {"wavelength_min", "wavelength_max"}) given.erase(name);
        if (!given.empty())
            fail(given.begin()->second.where,
                 "unknown parameter '" + given.begin()->first + "' of a spectrum of type '" + type + "'");
        return out;
    }

private:
    Value value_of_type() {
        if (type == "uniform" || type == "rawconstant") return constant();
        if (type == "d65" || type == "srgb") return scaled_white();
        if (type == "irregular" || type == "regular") return tabulated();
        if (type != "blackbody") fail(at, "spectrum type '" + type + "' is not supported");
        Value out = spectrum_value();
        const double scale = number("scale", 1);
        out.samples = planck(positive(take("temperature")), scale);
        return out;
    }

    Value constant() {
        const Value value = take("value");
        Value out;
        out.kind = value.kind == ValueKind::rgb ? ValueKind::rgb : ValueKind::spectrum;
        out.rgb = value.rgb;
        out.number = value.number;
        if (value.kind == ValueKind::vector) {
            out.kind = ValueKind::rgb;
            out.rgb = rounded(value.vector);
        }
        return out;
    }

    /// D65, or a colour under it.
    Value scaled_white() {
        const double scale = number("scale", 1);
        const char* name = given.contains("value") ? "value" : "color";
        Value out = spectrum_value();
        out.number = scale;
        if (!given.contains(name)) return out;
        out = take(name);
        out.rgb = (out.kind == ValueKind::rgb ? out.rgb : splat(float(out.number))) * float(scale);
        out.kind = ValueKind::rgb;
        return out;
    }

    Value tabulated() {
        const std::vector<double> values = numbers("values");
        std::vector<double> waves;
        if (type == "irregular") {
            waves = numbers("wavelengths");
        } else {
            const double first = number("wavelength_min", 360), last = number("wavelength_max", 830);
            for (size_t i = 0; i < values.size(); ++i)
                waves.push_back(first + (last - first) * double(i) / std::max<double>(double(values.size()) - 1, 1));
        }
        if (waves.size() != values.size() || waves.size() < 2)
            fail(at, "a spectrum needs as many wavelengths as values, and two at least");
        Value out = spectrum_value();
        for (size_t i = 0; i < waves.size(); ++i) {
            if (i > 0 && !(waves[i] > waves[i - 1])) fail(at, "wavelengths of <spectrum> must rise");
            out.samples.push_back({waves[i], values[i]});
        }
        return out;
    }

    Value take(const char* name) {
        const auto entry = given.extract(name);
        if (!entry) fail(at, "a spectrum of type '" + type + "' has no '" + name + "'");
        return entry.mapped();
    }
    double number(const char* name, double fallback) { return given.contains(name) ? take(name).number : fallback; }
    std::vector<double> numbers(const char* name) {
        const Value value = take(name);
        return value.kind == ValueKind::text ? parse_list(value.text, value.where, name)
                                             : std::vector<double>{value.number};
    }
};

}  // namespace

bool ValueParser::is_spectrum_plugin(const std::string& type) {
    return is_one_of({"uniform", "rawconstant", "d65", "srgb", "blackbody", "regular", "irregular"}, type);
}

Value ValueParser::parse_blackbody(const XmlSource& source, const pugi::xml_node& node) {
    const Where at = where(source, node);
    std::string text = attribute(source, node, "temperature");
    while (!text.empty() && (text.back() == 'K' || text.back() == 'k' || text.back() == ' ')) text.pop_back();
    Value kelvin, out = spectrum_value();
    kelvin.name = "temperature";
    kelvin.where = at;
    kelvin.number = parse_number(text, at, "temperature");
    out.samples = planck(positive(kelvin), number_or(source, node, "scale", 1));
    return out;
}

Value ValueParser::parse_spectrum_plugin(const XmlSource& source, const pugi::xml_node& node) {
    allow(source, node, {"name", "type", "id"});
    SpectrumPlugin plugin{where(source, node), attribute(source, node, "type"), {}};
    for (const pugi::xml_node& child : node.children()) {
        if (child.type() != pugi::node_element) continue;
        if (!is_value_tag(child.name()) || child.attribute("type"))
            fail(where(source, child), "a spectrum holds values only");
        Value value = parse_value(source, child, child.name());
        const std::string name = value.name;
        plugin.given.insert_or_assign(name, std::move(value));
    }
    return plugin.value();
}

}  // namespace ambilux::mitsuba
