#include "experiments/peers/peer_entry.h"

#include <filesystem>

#include "experiments/peers/peer.h"

namespace ambilux {
namespace {

constexpr const char* kOwn = "ambilux";

std::string known_kinds() {
    std::string names = kOwn;
    for (const PeerKind& kind : peer_kinds()) names += ", " + kind.name;
    return names;
}

void add(RunEntry& run, const std::string& key, const std::string& value, int line) {
    run.settings.emplace_back(key, value);
    run.lines.push_back(line);
}

/// One of `choices`, the first without a key.
void add_choice(const TomlReader& r, const toml::table& t, RunEntry& run, const char* key,
                const std::vector<std::string>& choices) {
    if (choices.empty()) return;
    const toml::node* node = t.get(key);
    const std::string value = node ? r.text(*node, key) : choices[0];
    if (std::find(choices.begin(), choices.end(), value) == choices.end())
        throw r.error(
            *node, fmt::format("{} '{}' of {}: must be one of {}", key, value, run.renderer, fmt::join(choices, ", ")));
    add(run, key, value, node ? TomlReader::line_of(*node) : run.line);
}

/// Names of files are relative to the configuration.
std::string place_of(const TomlReader& r, const std::string& key, const std::string& text) {
    namespace fs = std::filesystem;
    return key == "files" || key == "module" ? (fs::absolute(r.file).parent_path() / text).lexically_normal().string()
                                             : text;
}

}  // namespace

bool is_peer_run(const TomlReader& r, const toml::table& run) {
    const toml::node* node = run.get("renderer");
    if (!node) return false;
    const std::string name = r.text(*node, "renderer");
    if (name == kOwn) return false;
    if (!find_peer_kind(name))
        throw r.error(*node, fmt::format("renderer '{}' is not known; known are: {}", name, known_kinds()));
    return true;
}

RunEntry read_peer_run(const TomlReader& r, const toml::table& t) {
    RunEntry run;
    run.line = TomlReader::line_of(t);
    run.name = run.base = r.name(t, "[[run]]");
    run.renderer = r.text(*t.get("renderer"), "renderer");
    const PeerKind& kind = *find_peer_kind(run.renderer);
    std::vector<std::string> keys = {"name", "renderer", "set"};
    if (!kind.integrators.empty() || kind.own_settings) keys.emplace_back("integrator");
    if (!kind.variants.empty() || kind.own_settings) keys.emplace_back("variant");
    if (kind.own_settings) keys.emplace_back("estimator");
    keys.insert(keys.end(), kind.texts.begin(), kind.texts.end());
    keys.insert(keys.end(), kind.lists.begin(), kind.lists.end());
    r.check_keys(t, fmt::format("[[run]] of {}", run.renderer), keys);
    add_choice(r, t, run, "integrator", kind.integrators);
    add_choice(r, t, run, "variant", kind.variants);
    if (kind.own_settings)
        for (const char* key : {"integrator", "variant", "estimator"})
            if (const toml::node* node = t.get(key)) add(run, key, r.text(*node, key), TomlReader::line_of(*node));
    for (const std::string& key : kind.texts) {
        const toml::node& node = r.need(t, key, "[[run]]");
        add(run, key, place_of(r, key, r.text(node, key)), TomlReader::line_of(node));
    }
    for (const std::string& key : kind.lists) {
        const toml::node& node = r.need(t, key, "[[run]]");
        std::vector<std::string> values;
        for (const toml::node& value : r.array(node, key)) values.push_back(r.plain(value, key));
        add(run, key, fmt::format("{}", fmt::join(values, " ")), TomlReader::line_of(node));
    }
    if (kind.check)
        if (const std::string wrong = kind.check(run.settings); !wrong.empty())
            throw r.error(t, fmt::format("run '{}': {}", run.name, wrong));
    if (const toml::node* set = t.get("set")) {
        const toml::table& table = r.table(*set, "set");
        if (!kind.own_settings) r.check_keys(table, fmt::format("'set' of {}", run.renderer), {"rr_depth"});
        for (const auto& [key, value] : table)
            add(run, std::string(key.str()), r.plain(value, key.str()), TomlReader::line_of(value));
    }
    return run;
}

}  // namespace ambilux
