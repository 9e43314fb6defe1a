#include "formats/pbrt/parameters.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "formats/document/plugins.h"

namespace ambilux::pbrt {

namespace {

/// Types of pbrt-v4 and, behind them, their older names.
const std::map<std::string, std::string>& type_names() {
    static const std::map<std::string, std::string> names = {
        {"float", "float"},     {"integer", "integer"}, {"string", "string"},     {"bool", "bool"},
        {"point2", "point2"},   {"vector2", "vector2"}, {"point3", "point3"},     {"vector3", "vector3"},
        {"normal", "normal"},   {"rgb", "rgb"},         {"spectrum", "spectrum"}, {"blackbody", "blackbody"},
        {"texture", "texture"}, {"point", "point3"},    {"vector", "vector3"},    {"normal3", "normal"},
        {"color", "rgb"},
    };
    return names;
}

bool holds_strings(const std::string& type) { return type == "string" || type == "texture" || type == "bool"; }

void add_value(Parameter& p, const Token& token, const Where& where) {
    const bool is_bool = p.type == "bool";
    if (is_bool && (token.text == "true" || token.text == "false")) return p.strings.push_back(token.text);
    if (token.kind == TokenKind::quoted && !is_bool && (holds_strings(p.type) || p.type == "spectrum"))
        return p.strings.push_back(token.text);
    double value = 0;
    if (token.kind != TokenKind::word || holds_strings(p.type) || !parse_number(token.text, value))
        fail(where, "'" + token.text + "' is no value of type " + p.type + ", which '" + p.name + "' has");
    if (p.type == "integer" && (value != std::floor(value) || std::fabs(value) > 2147483648.0))
        fail(where, "'" + token.text + "' is no integer of 32 bits, which '" + p.name + "' is");
    p.numbers.push_back(value);
}

std::vector<std::string> words_of(const std::string& text) {
    std::vector<std::string> words;
    for (size_t at = 0; at < text.size();) {
        const size_t begin = text.find_first_not_of(" \t", at);
        if (begin == std::string::npos) break;
        at = std::min(text.find_first_of(" \t", begin), text.size());
        words.push_back(text.substr(begin, at - begin));
    }
    return words;
}

}  // namespace

std::vector<Parameter> read_parameters(Tokenizer& tokens, FileBudget& budget) {
    std::vector<Parameter> list;
    while (tokens.peek().kind == TokenKind::quoted) {
        const Token declaration = tokens.next();
        Parameter p;
        p.where = tokens.where(declaration);
        const std::vector<std::string> words = words_of(declaration.text);
        if (words.size() != 2)
            fail(p.where, "'" + declaration.text + "' is no parameter: its type and its name are needed");
        const auto type = type_names().find(words[0]);
        if (type == type_names().end())
            fail(p.where, "parameter '" + words[1] + "' has the unknown type '" + words[0] + "'");
        p.type = type->second;
        p.name = words[1];
        Token value = tokens.next();
        if (value.kind == TokenKind::open) {
            for (value = tokens.next(); value.kind != TokenKind::close; value = tokens.next()) {
                if (value.kind == TokenKind::end || value.kind == TokenKind::open)
                    fail(p.where, "the list of '" + p.name + "' that begins here has no end");
                add_value(p, value, tokens.where(value));
                budget.tick();
            }
        } else if (value.kind == TokenKind::end) {
            fail(p.where, "parameter '" + p.name + "' has no value");
        } else {
            add_value(p, value, tokens.where(value));
        }
        for (const Parameter& other : list)
            if (other.name == p.name) fail(p.where, "parameter '" + p.name + "' is given twice");
        list.push_back(std::move(p));
    }
    return list;
}

Parameter read_option(Tokenizer& tokens) {
    const Token name = tokens.next();
    const std::vector<std::string> words = words_of(name.text);
    Parameter p;
    p.where = tokens.where(name);
    if (name.kind != TokenKind::quoted || words.empty() || words.size() > 2)
        fail(p.where, "the name of an Option must be a string in quotes");
    p.name = words.back();
    Token value = tokens.next();
    const bool in_list = value.kind == TokenKind::open;
    if (in_list) value = tokens.next();
    if ((value.kind != TokenKind::word && value.kind != TokenKind::quoted) ||
        (in_list && tokens.next().kind != TokenKind::close))
        fail(p.where, "option '" + p.name + "' must have one value");
    p.strings = {value.text};
    return p;
}

const Parameter* Parameters::find(const std::string& name) const {
    for (const Parameter& p : list)
        if (p.name == name) {
            p.used = true;
            return &p;
        }
    absent.push_back(name);
    return nullptr;
}

Where Parameters::where_of(const std::string& name) const {
    const Parameter* p = find(name);
    return p ? p->where : where;
}

const Parameter* Parameters::typed(const std::string& name, std::initializer_list<const char*> types) const {
    const Parameter* p = find(name);
    if (p && std::find(types.begin(), types.end(), p->type) == types.end())
        fail(p->where, "parameter '" + name + "' of " + directive + " '" + type + "' is of type " + p->type + ", not " +
                           *types.begin());
    return p;
}

double Parameters::number(const std::string& name, double fallback) const {
    const Parameter* p = typed(name, {"float", "integer"});
    if (p && p->numbers.size() != 1) fail(p->where, "parameter '" + name + "' must be one number");
    return p ? p->numbers[0] : fallback;
}

int64_t Parameters::integer(const std::string& name, int64_t fallback) const {
    const Parameter* p = typed(name, {"integer"});
    if (p && p->numbers.size() != 1) fail(p->where, "parameter '" + name + "' must be one integer");
    return p ? int64_t(p->numbers[0]) : fallback;
}

bool Parameters::boolean(const std::string& name, bool fallback) const {
    const Parameter* p = typed(name, {"bool"});
    if (p && p->strings.size() != 1) fail(p->where, "parameter '" + name + "' must be true or false");
    return p ? p->strings[0] == "true" : fallback;
}

std::string Parameters::text(const std::string& name, const std::string& fallback) const {
    const Parameter* p = typed(name, {"string"});
    if (p && p->strings.size() != 1) fail(p->where, "parameter '" + name + "' must be one string");
    return p ? p->strings[0] : fallback;
}

Vec3d Parameters::point(const std::string& name, Vec3d fallback) const {
    const Parameter* p = typed(name, {"point3", "vector3", "normal"});
    if (p && p->numbers.size() != 3) fail(p->where, "parameter '" + name + "' must be three numbers");
    return p ? Vec3d{p->numbers[0], p->numbers[1], p->numbers[2]} : fallback;
}

const std::vector<double>& Parameters::numbers(const std::string& name, size_t size) const {
    static const std::vector<double> none;
    const Parameter* p = typed(name, {"float", "integer", "point2", "point3", "vector2", "vector3", "normal"});
    if (p && (p->numbers.size() % size != 0 || p->numbers.empty()))
        fail(p->where, "parameter '" + name + "' has " + std::to_string(p->numbers.size()) +
                           " numbers, no multiple of " + std::to_string(size));
    return p ? p->numbers : none;
}

void Parameters::ignore(std::initializer_list<const char*> names) const {
    for (const char* name : names) find(name);
}

void Parameters::leave(Report& report, std::initializer_list<const char*> names, const std::string& why) const {
    for (const char* name : names)
        if (const Parameter* p = find(name))
            report.note(p->where, "'" + p->name + "' of " + directive + " '" + type + "' is not followed: " + why);
}

std::string Parameters::filename() const {
    const std::string name = text("filename", "");
    if (!name.empty()) return name;
    for (const Parameter& p : list)
        if (!p.used && nearest_name({"filename"}, p.name) == "filename") fail(p.where, unknown(p, {"filename"}));
    fail(where, directive + " '" + type + "' has no filename");
}

std::string Parameters::unknown(const Parameter& p, const std::vector<std::string>& known) const {
    return "unknown parameter '" + p.name + "' of " + directive + " '" + type + "'" + suggestion(known, p.name);
}

void Parameters::finish(Report& report) const {
    for (const Parameter& p : list)
        if (!p.used) report.refuse(p.where, unknown(p, absent), "it is ignored");
}

}  // namespace ambilux::pbrt
