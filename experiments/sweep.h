// Sweeps: one line of a configuration that stands for many runs.
#pragma once

#include <string>
#include <vector>

#include "experiments/toml_reader.h"

namespace ambilux {

/// One value of one key of a sweep.
struct SweepValue {
    std::string key, text;
    const toml::node* node = nullptr;
};

/// More than this in one sweep is a mistake.
constexpr size_t kMaxCombinations = 1000;

/// Lists by key, in the order of the file.
using Sweep = std::vector<std::vector<SweepValue>>;

/// Reads { key = [values], ... }. `text_of` turns a value into text. Throws Error(bad_input) for what is no list, for
/// repeated values and for text that cannot be part of a file name.
template <class TextOf>
Sweep read_sweep(const TomlReader& r, const toml::node& node, const std::string& where, TextOf text_of) {
    Sweep sweep;
    for (const auto& [key, list] : r.table(node, where)) {
        std::vector<SweepValue> values;
        std::set<std::string> taken;
        if (!list.is_array() || list.as_array()->empty())
            throw r.error(list, fmt::format("{}: '{}' must be a list of values that is not empty, such as [1, 2, 4]",
                                            where, key.str()));
        for (const toml::node& value : *list.as_array()) {
            values.push_back({std::string(key.str()), text_of(std::string(key.str()), value), &value});
            const std::string& text = values.back().text;
            if (text.empty() || !TomlReader::within(text, "._-+"))
                throw r.error(value,
                              fmt::format("{}: value '{}' of '{}' cannot be part of a name", where, text, key.str()));
            if (!taken.insert(text).second)
                throw r.error(value, fmt::format("{}: value {} of '{}' is listed twice", where, text, key.str()));
        }
        sweep.push_back(std::move(values));
    }
    // Tables come sorted by key; people mean the order in which they wrote.
    std::stable_sort(sweep.begin(), sweep.end(), [](const auto& a, const auto& b) {
        const auto &x = a[0].node->source().begin, &y = b[0].node->source().begin;
        return x.line != y.line ? x.line < y.line : x.column < y.column;
    });
    if (sweep.empty()) throw r.error(node, where + " is empty: leave it out, or name a key and its values");
    size_t count = 1;
    for (const auto& values : sweep) {
        count *= values.size();
        if (count > kMaxCombinations)
            throw r.error(node, fmt::format("{} has more than {} combinations", where, kMaxCombinations));
    }
    return sweep;
}

/// Every combination of one value per key; the last key changes fastest.
std::vector<std::vector<SweepValue>> combinations(const Sweep& sweep);

/// Every single value alone: one switch at a time.
std::vector<std::vector<SweepValue>> one_at_a_time(const Sweep& sweep);

/// "lvc[connections=4,wave_size=512]".
std::string swept_name(const std::string& base, const std::vector<SweepValue>& values);

}  // namespace ambilux
