#include "experiments/config_runs.h"

#include "experiments/peers/peer_entry.h"
#include "experiments/sweep.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

using Reader = TomlReader;
using TakenNames = std::set<std::string>;

/// Adds a setting of a run, unless it belongs elsewhere.
void add_setting(const Reader& r, RunEntry& run, const std::string& key, const toml::node& value) {
    if (const Setting* s = find_general_setting(key); s && s->place == InExperiment::experiment)
        throw r.error(value, fmt::format("'{}' belongs to {}, not to the settings of a run", key, s->place_text));
    for (const auto& [taken, text] : run.settings)
        if (taken == key) throw r.error(value, fmt::format("'{}' of run '{}' is set twice", key, run.name));
    run.settings.emplace_back(key, r.plain(value, key));
    run.lines.push_back(Reader::line_of(value));
}

/// Settings that are keys of a run: integrator, variant and estimator.
std::vector<std::string> keys_of_runs() {
    std::vector<std::string> keys;
    for (const Setting& s : general_settings())
        if (s.place == InExperiment::run_key) keys.push_back(s.what.key);
    return keys;
}

/// `run` with `values` in the place of its own; a value keeps the line of its own list.
RunEntry swept(const Reader& r, RunEntry run, const std::vector<SweepValue>& values) {
    run.name = swept_name(run.base, values);
    for (const SweepValue& value : values) {
        run.swept.emplace_back(value.key, value.text);
        for (size_t i = 0; i < run.settings.size(); ++i)
            if (run.settings[i].first == value.key) {
                run.settings.erase(run.settings.begin() + long(i));
                run.lines.erase(run.lines.begin() + long(i));
                break;
            }
        add_setting(r, run, value.key, *value.node);
    }
    if (run.name.size() > Reader::kMaxName)
        throw r.error(*values[0].node,
                      fmt::format("the name '{}' is longer than {} characters: sweep fewer keys at once", run.name,
                                  Reader::kMaxName));
    return run;
}

}  // namespace

void add_settings(const Reader& r, RunEntry& run, const toml::table& t) {
    for (const std::string& key : keys_of_runs())
        if (const toml::node* value = t.get(key)) add_setting(r, run, key, *value);
    if (const toml::node* set = t.get("set"))
        for (const auto& [key, value] : r.table(*set, "set")) add_setting(r, run, std::string(key.str()), value);
}

std::vector<RunEntry> read_run(const Reader& r, const toml::table& t, TakenNames& names) {
    if (is_peer_run(r, t)) {
        RunEntry peer = read_peer_run(r, t);
        r.claim(*t.get("name"), peer.name, "[[run]]", names);
        return {peer};
    }
    std::vector<std::string> keys = keys_of_runs();
    keys.insert(keys.begin(), {"name", "renderer"});
    keys.insert(keys.end(), {"set", "sweep", "techniques"});
    r.check_keys(t, "[[run]]", keys);
    RunEntry run;
    run.line = Reader::line_of(t);
    run.name = run.base = r.name(t, "[[run]]");
    const toml::node* sweep = t.get("sweep");
    const bool swept_integrator = sweep && sweep->is_table() && sweep->as_table()->contains("integrator");
    if (!swept_integrator) r.need(t, "integrator", "[[run]]");
    add_settings(r, run, t);
    if (const toml::node* depth = t.get("techniques")) {
        run.techniques = int(r.integer(*depth, "techniques", 1, 64));
        run.techniques_line = Reader::line_of(*depth);
    }
    std::vector<RunEntry> runs;
    if (!sweep) {
        runs.push_back(run);
    } else {
        const auto text = [&](const std::string& key, const toml::node& value) { return r.plain(value, key); };
        for (const auto& values : combinations(read_sweep(r, *sweep, "'sweep'", text))) {
            for (const SweepValue& value : values)
                for (const auto& [key, ignored] : run.settings)
                    if (key == value.key)
                        throw r.error(*value.node, fmt::format("'{}' of run '{}' is set and in 'sweep': leave one out",
                                                               key, run.name));
            runs.push_back(swept(r, run, values));
        }
    }
    for (const RunEntry& entry : runs) r.claim(*t.get("name"), entry.name, "[[run]]", names);
    return runs;
}

void read_ablation(const Reader& r, const toml::table& t, ExperimentConfig& config, TakenNames& names) {
    r.check_keys(t, "[ablation]", {"default", "switches"});
    const toml::node& node = r.need(t, "default", "[ablation]");
    config.ablation_default = r.text(node, "default");
    const auto found = std::find_if(config.runs.begin(), config.runs.end(),
                                    [&](const RunEntry& run) { return run.name == config.ablation_default; });
    if (found == config.runs.end()) {
        std::vector<std::string> known;
        for (const RunEntry& run : config.runs) known.push_back(run.name);
        throw r.error(node, fmt::format("[ablation] default '{}' is no run; runs are: {}", config.ablation_default,
                                        fmt::join(known, ", ")));
    }
    const toml::node* switches = t.get("switches");
    if (!switches) return;
    const RunEntry base = *found;
    if (!base.renderer.empty())
        throw r.error(*switches, fmt::format("'switches' change a run of this program, and '{}' is one of {}",
                                             base.name, base.renderer));
    if (!base.swept.empty())
        throw r.error(*switches,
                      fmt::format("'switches' change a run of its own, and '{}' comes from a sweep", base.name));
    const auto text = [&](const std::string& key, const toml::node& value) { return r.plain(value, key); };
    for (const auto& values : one_at_a_time(read_sweep(r, *switches, "'switches'", text))) {
        for (const auto& [key, value] : base.settings)
            if (key == values[0].key && value == values[0].text)
                throw r.error(*values[0].node,
                              fmt::format("{}={} is what the default run has: leave it out", key, value));
        config.runs.push_back(swept(r, base, values));
        r.claim(*values[0].node, config.runs.back().name, "[[run]]", names);
    }
}

}  // namespace ambilux
