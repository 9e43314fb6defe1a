#include "integrators/settings_help.h"

#include "integrators/registry.h"

namespace ambilux {
namespace {

/// Where a general setting, and each of its values that is limited, has an effect.
std::string where_text(const Setting& s, bool in_tree) {
    std::string text = s.applies ? applies_text(s.applies, in_tree) : "everywhere";
    for (const Setting::Limit& limit : s.limits)
        text += fmt::format("; {} on {}", limit.value, applies_text(limit.applies, in_tree));
    return text;
}

struct Row {
    std::string key, values, standard, where, help;
};

/// Of all variants, or of those in the tree.
std::vector<Row> rows(bool in_tree) {
    std::vector<Row> all;
    const auto add = [&](const Setting& s, const std::string& where) {
        all.push_back({s.what.key, s.what.allowed, s.default_text(), where, s.what.help});
    };
    for (const Setting& s : general_settings()) {
        add(s, where_text(s, in_tree));
        if (s.what.key == "integrator")
            all.back().values = fmt::format("{}", fmt::join(integrator_names(in_tree), ", "));
        if (s.what.key == "variant") all.back().values = fmt::format("{}", fmt::join(variant_names(in_tree), ", "));
    }
    for (const Variant& v : variants())
        for (const Setting& s : v.own)
            if (!(in_tree && v.outside)) add(s, v.name());
    return all;
}

}  // namespace

std::string settings_help() {
    std::string text = "Settings, as --set KEY=VALUE or in an experiment:\n\n";
    for (const Row& r : rows(false))
        text += fmt::format("{}={}\n    {}\n    values: {}\n    has an effect on: {}\n\n", r.key, r.standard, r.help,
                            r.values, r.where);
    text += "Integrators and their variants:\n\n";
    for (const Variant& v : variants()) text += fmt::format("{:<18} {}\n", v.name(), v.help);
    return text;
}

std::string settings_reference() {
    std::string text =
        "# Settings\n\n"
        "Made by `ambilux help settings --markdown` from the declarations in `integrators/settings.cpp` and in the "
        "folders of\nvariants; do not edit it. Each is set by `--set KEY=VALUE`, or in a run of an experiment. "
        "A value without an effect\nwhere it is set is refused.\n\n"
        "| key | values | default | what it is | has an effect on |\n| --- | --- | --- | --- | --- |\n";
    for (const Row& r : rows(true))
        text += fmt::format("| `{}` | {} | `{}` | {} | {} |\n", r.key, r.values, r.standard, r.help, r.where);
    text += "\n## Integrators and variants\n\n| integrator | variant | what it is |\n| --- | --- | --- |\n";
    for (const Variant& v : variants())
        if (!v.outside) text += fmt::format("| {} | {} | {} |\n", v.integrator, v.variant, v.help);
    return text;
}

}  // namespace ambilux
