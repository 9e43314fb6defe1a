// Values in Mitsuba's XML: attributes with parameters put in, numbers, transforms, colours and spectra.
#pragma once

#include <map>
#include <pugixml.hpp>
#include <set>
#include <string>
#include <vector>

#include "formats/document/numbers.h"
#include "formats/mitsuba/xml.h"

namespace ambilux::mitsuba {

/// A file that is being parsed.
struct XmlSource {
    std::string path;
    std::vector<ptrdiff_t> line_ends;
    bool has_lines = true;  ///< which messages name
    int version = 3;
};

Where where(const XmlSource& source, ptrdiff_t offset);
Where where(const XmlSource& source, const pugi::xml_node& node);

class ValueParser {
public:
    explicit ValueParser(Document& document) : document_(document) {}

    void set_parameter(const std::string& name, const std::string& value) { parameters_[name] = value; }
    /// The value of a $parameter that has none.
    void set_default(const std::string& name, const std::string& value) { parameters_.try_emplace(name, value); }
    bool is_used(const std::string& parameter) const { return used_.contains(parameter); }

    /// Refuses attributes of other names.
    static void allow(const XmlSource& source, const pugi::xml_node& node, std::initializer_list<const char*> names);
    /// Attribute with parameters put in; an error if it is missing.
    std::string attribute(const XmlSource& source, const pugi::xml_node& node, const char* name);
    /// The attribute 'name' in the spelling of format 2 and later; may be empty.
    std::string parameter_name(const XmlSource& source, const pugi::xml_node& node);

    static bool is_value_tag(const std::string& tag);
    /// Of <spectrum type="...">.
    static bool is_spectrum_plugin(const std::string& type);
    Value parse_value(const XmlSource& source, const pugi::xml_node& node, const std::string& tag);

private:
    /// Puts the values of $parameters into the text; the longest known name wins.
    std::string substitute(const std::string& text, const Where& at);
    double number_or(const XmlSource& source, const pugi::xml_node& node, const char* name, double fallback);
    Vec3d triple(const XmlSource& source, const pugi::xml_node& node, double fallback, bool allow_single);
    Matrix parse_transform(const XmlSource& source, const pugi::xml_node& node);
    Value parse_color(const XmlSource& source, const pugi::xml_node& node, const std::string& tag);
    Value parse_spectrum(const XmlSource& source, const pugi::xml_node& node);
    Value parse_spectrum_plugin(const XmlSource& source, const pugi::xml_node& node);
    Value parse_blackbody(const XmlSource& source, const pugi::xml_node& node);

    Document& document_;
    std::map<std::string, std::string> parameters_;
    std::set<std::string> used_;
    uint64_t expanded_ = 0;  ///< characters that parameters became
};

}  // namespace ambilux::mitsuba
