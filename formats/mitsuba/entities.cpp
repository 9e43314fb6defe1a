// Entities that an XML file declares itself (<!DOCTYPE scene [<!ENTITY name "text"> ...]>).
#include "formats/mitsuba/xml.h"

#include <algorithm>
#include <map>

#include "core/error.h"
#include "core/text.h"
#include "formats/file_budget.h"

namespace ambilux::mitsuba {

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
bool ends_name(char c) { return is_blank(c) || c == '"' || c == '\'' || c == '>' || c == '[' || c == ';' || c == '<'; }

struct Entity {
    std::string text;  ///< or the name of a file
    bool is_file = false, is_read = false, is_open = false;
    int line = 0;
};

struct Expander {
    Document& document;
    const std::string& path;
    const std::string& text;
    std::map<std::string, Entity> entities;
    std::string out;

    [[noreturn]] void fail(size_t at, const std::string& message) const {
        const auto lines = std::count(text.begin(), text.begin() + ptrdiff_t(std::min(at, text.size())), '\n');
        throw input_error(path, int(lines) + 1, message);
    }

    /// The end of what starts at `at` with `open`, if it does; otherwise `at`.
    static size_t behind(const std::string& s, size_t at, const char* open, const std::string& close) {
        if (s.compare(at, std::char_traits<char>::length(open), open) != 0) return at;
        const size_t end = s.find(close, at);
        return end == std::string::npos ? s.size() : end + close.size();
    }
    /// The end of the comment, the instruction or the CDATA at `at`.
    static size_t behind_opaque(const std::string& s, size_t at) {
        size_t end = behind(s, at, "<!--", "-->");
        if (end == at) end = behind(s, at, "<?", "?>");
        return end == at ? behind(s, at, "<![CDATA[", "]]>") : end;
    }

    void skip_blanks(size_t& at) const {
        while (at < text.size() && is_blank(text[at])) ++at;
    }
    std::string word(size_t& at) const {
        skip_blanks(at);
        const size_t start = at;
        while (at < text.size() && !ends_name(text[at])) ++at;
        return text.substr(start, at - start);
    }
    std::string quoted(size_t& at) const {
        skip_blanks(at);
        if (at >= text.size() || (text[at] != '"' && text[at] != '\'')) fail(at, "expected text in quotes");
        const size_t end = text.find(text[at], at + 1);
        if (end == std::string::npos) fail(at, "the quotes are not closed");
        const std::string result = text.substr(at + 1, end - at - 1);
        at = end + 1;
        return result;
    }
    /// Up to one of these characters outside of quotes.
    void skip_to(size_t& at, std::string_view ends) const {
        while (at < text.size() && ends.find(text[at]) == std::string_view::npos)
            if (text[at] == '"' || text[at] == '\'')
                quoted(at);
            else
                ++at;
    }

    void read_entity(size_t& at) {
        const size_t start = at;
        at += 8;
        Entity entity;
        entity.line = int(std::count(text.begin(), text.begin() + ptrdiff_t(start), '\n')) + 1;
        const std::string name = word(at);
        if (name == "%") fail(start, "entities with % are not supported");
        skip_blanks(at);
        if (at < text.size() && text[at] != '"' && text[at] != '\'') {
            const std::string kind = word(at);
            if (kind != "SYSTEM" && kind != "PUBLIC") fail(start, "expected the text of entity '" + name + "'");
            if (kind == "PUBLIC") quoted(at);
            entity.is_file = true;
        }
        entity.text = quoted(at);
        skip_to(at, ">"), ++at;
        entities.emplace(name, std::move(entity));  // the first one counts
    }

    /// Reads the declarations; `at` is behind "<!DOCTYPE" and then behind the whole of it.
    void read_doctype(size_t& at) {
        const size_t start = at;
        skip_to(at, "[>");
        if (at < text.size() && text[at] == '[') {
            for (++at; at < text.size() && text[at] != ']';) {
                if (const size_t end = behind_opaque(text, at); end != at)
                    at = end;
                else if (text.compare(at, 8, "<!ENTITY") == 0)
                    read_entity(at);
                else if (text[at] == '<')
                    skip_to(at, ">"), ++at;
                else
                    ++at;
            }
            while (at < text.size() && text[at] != '>') ++at;
        }
        if (at >= text.size()) fail(start, "<!DOCTYPE> is not closed");
        ++at;
    }

    /// What a file of an entity holds, without what may only stand at its beginning.
    std::string external(const Entity& entity) {
        const Where from{path, entity.line};
        const std::string file = document.resolve(entity.text, from);
        if (document.files.size() > document.limits.includes)
            document::fail(from, "more files than --limits includes=" + std::to_string(document.limits.includes));
        std::string content = read_input(file, document.limits);
        document.files.push_back({file, std::make_shared<const std::string>(content)});
        content = plain_text_of_utf16(file, content);
        content.erase(0, behind(content, 0, "<?xml", "?>"));
        // A file that is no XML stays out of values, and so out of messages.
        const auto first = std::find_if_not(content.begin(), content.end(), is_blank);
        if (first != content.end() && *first != '<')
            document::fail(from, "file '" + entity.text + "' of an entity does not begin with an element");
        return content;
    }

    void put(const std::string& s, size_t from, size_t to) {
        if (to - from > document.limits.bytes - std::min<uint64_t>(out.size(), document.limits.bytes))
            fail(0,
                 "with its entities the file is longer than --limits bytes=" + std::to_string(document.limits.bytes));
        out.append(s, from, to - from);
    }

    /// Appends s from `at` on; `place`: in the file, where it stands.
    void expand(const std::string& s, size_t at, bool outermost, size_t place, uint64_t depth) {
        size_t done = at;
        while ((at = s.find_first_of("&<", at)) != std::string::npos) {
            if (outermost) place = at;
            if (s[at] == '<') {
                at = std::max(at + 1, behind_opaque(s, at));
                continue;
            }
            size_t end = at + 1;
            while (end < s.size() && !ends_name(s[end]) && s[end] != '&') ++end;
            const std::string name = s.substr(at + 1, end - at - 1);
            const auto found = entities.find(name);
            // Others are the parser's: of characters, or what XML does not allow and it takes as it stands.
            if (end >= s.size() || s[end] != ';' || found == entities.end()) {
                if (end < s.size() && s[end] == ';' && !is_of_xml(name))
                    fail(place, "entity '&" + name + ";' is not declared");
                at = end;
                continue;
            }
            put(s, done, at);
            replace(found->second, name, place, depth);
            done = at = end + 1;
        }
        put(s, done, s.size());
    }

    static bool is_of_xml(const std::string& name) {
        return name.empty() || name[0] == '#' || name == "lt" || name == "gt" || name == "amp" || name == "quot" ||
               name == "apos";
    }

    void replace(Entity& entity, const std::string& name, size_t place, uint64_t depth) {
        if (entity.is_open) fail(place, "entity '&" + name + ";' holds itself");
        if (depth >= document.limits.nesting)
            fail(place, "entities are nested deeper than --limits nesting=" + std::to_string(document.limits.nesting));
        if (entity.is_file && !entity.is_read) entity.text = external(entity), entity.is_read = true;
        entity.is_open = true;
        const size_t start = out.size();
        expand(entity.text, 0, false, place, depth + 1);
        std::replace(out.begin() + ptrdiff_t(start), out.end(), '\n', ' ');  // lines keep their numbers
        entity.is_open = false;
        expansion += 1 + out.size() - start;
        if (expansion > document.limits.expansion)
            fail(place, "entities expand to more than --limits expansion=" + std::to_string(document.limits.expansion) +
                            " characters");
    }

    uint64_t expansion = 0;
};

}  // namespace

std::string expand_entities(Document& document, const std::string& path, const std::string& text) {
    Expander expander{document, path, text, {}, {}};
    // A DOCTYPE stands before the outermost element.
    size_t at = 0;
    while ((at = text.find('<', at)) != std::string::npos) {
        if (const size_t end = Expander::behind_opaque(text, at); end != at) {
            at = end;
            continue;
        }
        if (text.compare(at, 9, "<!DOCTYPE") != 0) break;
        at += 9;
        expander.read_doctype(at);
    }
    if (at == std::string::npos || (expander.entities.empty() && text.find('&', at) == std::string::npos)) return text;
    expander.put(text, 0, at);
    expander.expand(text, at, true, at, 0);
    return expander.out;
}

}  // namespace ambilux::mitsuba
