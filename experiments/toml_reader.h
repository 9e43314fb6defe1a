// Reads nodes of a TOML file and says where a wrong one stands.
#pragma once

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <initializer_list>
#include <set>
#include <string>

#include "core/error.h"
#include "core/nearest.h"

namespace ambilux {

struct TomlReader {
    std::string file;

    static int line_of(const toml::node& node) { return int(node.source().begin.line); }
    Error error(const toml::node& node, const std::string& message) const {
        return input_error(file, line_of(node), message);
    }

    /// `line`: of keys that stand elsewhere.
    void check_keys(const toml::table& table, const std::string& where, const Names& known, int line = 0) const {
        for (const auto& [key, node] : table)
            if (std::find(known.begin(), known.end(), key.str()) == known.end())
                throw input_error(file, line ? line : int(key.source().begin.line),
                                  fmt::format("unknown key '{}' in {}{}", key.str(), where,
                                              suggestion_or_all(known, std::string(key.str()))));
    }
    const toml::node& need(const toml::table& table, std::string_view key, const std::string& where) const {
        if (const toml::node* node = table.get(key)) return *node;
        throw error(table, fmt::format("{} lacks the key '{}'", where, key));
    }
    std::string text(const toml::node& node, std::string_view key) const {
        if (!node.is_string()) throw error(node, fmt::format("'{}' must be a string", key));
        return node.as_string()->get();
    }
    bool flag(const toml::node& node, std::string_view key) const {
        if (!node.is_boolean()) throw error(node, fmt::format("'{}' must be true or false", key));
        return node.as_boolean()->get();
    }
    int64_t integer(const toml::node& node, std::string_view key, int64_t lowest, int64_t highest) const {
        const auto* value = node.as_integer();
        if (!value || value->get() < lowest || value->get() > highest)
            throw error(node, fmt::format("'{}' must be an integer from {} to {}", key, lowest, highest));
        return value->get();
    }
    const toml::table& table(const toml::node& node, std::string_view key) const {
        if (!node.is_table()) throw error(node, fmt::format("'{}' must be a table", key));
        return *node.as_table();
    }
    const toml::array& array(const toml::node& node, std::string_view key) const {
        if (!node.is_array() || node.as_array()->empty())
            throw error(node, node.is_table() ? fmt::format("one of several: write [[{}]]", key)
                                              : fmt::format("'{}' must be a list that is not empty", key));
        return *node.as_array();
    }
    /// A value of any simple type as the text that --set would take.
    std::string plain(const toml::node& node, std::string_view key) const {
        if (const auto* s = node.as_string()) return s->get();
        if (const auto* i = node.as_integer()) return std::to_string(i->get());
        if (const auto* b = node.as_boolean()) return b->get() ? "true" : "false";
        if (const auto* f = node.as_floating_point()) return fmt::format("{}", f->get());
        throw error(node, fmt::format("'{}' must be a string, a number, true or false", key));
    }
    /// True if all of `s` is letters, digits and what is in `also`.
    static bool within(std::string_view s, std::string_view also) {
        return std::all_of(s.begin(), s.end(), [&](unsigned char c) {
            return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                   also.find(char(c)) != also.npos;
        });
    }
    /// Name that is a file name everywhere: letters, digits, '.', '_', '-', and what a sweep adds, such as
    /// "[connections=4,wave_size=512]".
    std::string name(const toml::table& parent, const std::string& where) const {
        const toml::node& node = need(parent, "name", where);
        const std::string value = text(node, "name");
        const size_t bracket = std::min(value.find('['), value.size());
        const std::string_view base = std::string_view(value).substr(0, bracket),
                               rest = std::string_view(value).substr(bracket);
        const bool plain_base = !base.empty() && base.size() <= 64 && base[0] != '.' && within(base, "._-");
        const bool plain_rest = rest.empty() || (rest.size() > 2 && rest.back() == ']' &&
                                                 within(rest.substr(1, rest.size() - 2), "._-+=,"));
        if (!plain_base || !plain_rest || value.size() > kMaxName)
            throw error(
                node,
                fmt::format("name '{}': use 1 to 64 letters, digits, '.', '_' or '-', not beginning with '.'", value));
        return value;
    }
    /// Throws if `name` is taken already.
    void claim(const toml::node& node, const std::string& name, const std::string& where,
               std::set<std::string>& taken) const {
        if (!taken.insert(name).second) throw error(node, fmt::format("name '{}' of {} is used twice", name, where));
    }

    /// Longest name of a run or a scene; its files add a seed and endings, and no file name has more than 255 bytes.
    static constexpr size_t kMaxName = 180;
};

}  // namespace ambilux
