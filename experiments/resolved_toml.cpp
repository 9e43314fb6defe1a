#include <toml++/toml.h>
#include <algorithm>
#include <sstream>

#include "experiments/config.h"
#include "experiments/peers/peer.h"
#include "integrators/setting.h"

namespace ambilux {
namespace {

bool is_key_of_runs(const std::string& key) {
    const Setting* s = find_general_setting(key);
    return s && s->place == InExperiment::run_key;
}

toml::table table_of(const Settings& pairs) {
    toml::table t;
    for (const auto& [key, value] : pairs) t.insert_or_assign(key, value);
    return t;
}

/// Numbers of a text with blanks between them.
toml::array list_of(const std::string& text) {
    std::istringstream in(text);
    toml::array list;
    for (double value = 0; in >> value;) list.push_back(value);
    return list;
}

bool is_in(const std::vector<std::string>& keys, const std::string& key) {
    return std::find(keys.begin(), keys.end(), key) != keys.end();
}

void insert_settings(toml::table& t, const RunEntry& run) {
    toml::table set;
    const PeerKind* const peer = find_peer_kind(run.renderer);
    for (const auto& [key, value] : run.settings) {
        if (peer && is_in(peer->lists, key))
            t.insert_or_assign(key, list_of(value));
        else
            (is_key_of_runs(key) || (peer && is_in(peer->texts, key)) ? t : set).insert_or_assign(key, value);
    }
    if (!set.empty()) t.insert("set", set);
}

toml::table budget_table(const ExperimentConfig& config) {
    toml::array spp, seconds;
    for (const uint64_t samples : config.spp) spp.push_back(int64_t(samples));
    for (const double time : config.seconds) seconds.push_back(time);
    toml::table budget;
    if (!spp.empty()) budget.insert("spp", spp);
    if (!seconds.empty()) budget.insert("seconds", seconds);
    return budget;
}

toml::table scene_table(const SceneEntry& s) {
    toml::table reference{{"spp", int64_t(s.reference.spp)}};
    insert_settings(reference, s.reference.how);
    toml::table t{{"name", s.name}, {"path", s.path}, {"reference", reference}};
    if (s.width) t.insert("size", toml::array{int64_t(s.width), int64_t(s.height)});
    if (s.max_depth) t.insert("max_depth", int64_t(*s.max_depth));
    if (s.lenient) t.insert("lenient", true);
    if (!s.parameters.empty()) t.insert("parameters", table_of(s.parameters));
    if (!s.params.empty()) t.insert("params", table_of(s.params));
    return t;
}

toml::table run_table(const RunEntry& run) {
    toml::table t{{"name", run.name}};
    if (!run.renderer.empty()) t.insert("renderer", run.renderer);
    insert_settings(t, run);
    if (run.techniques) t.insert("techniques", int64_t(run.techniques));
    return t;
}

}  // namespace

std::string resolved_toml(const ExperimentConfig& config) {
    toml::table root;
    root.insert("name", config.name);
    root.insert("metric", config.metric);
    root.insert("order", config.random_order ? "random" : "listed");
    root.insert("repeats", int64_t(config.repeats));
    root.insert("backend", config.backend);
    const bool has_peers =
        std::any_of(config.runs.begin(), config.runs.end(), [](const RunEntry& run) { return !run.renderer.empty(); });
    if (has_peers) root.insert("agreement_spp", int64_t(config.agreement_spp));
    if (config.scenes[0].box_filter) root.insert("filter", "box");
    toml::array seeds, scenes, runs;
    for (const uint64_t seed : config.seeds) seeds.push_back(int64_t(seed));
    root.insert("seeds", seeds);
    // What a scene replaces of this stands with the scene, so that all scenes state theirs in full.
    root.insert("reference", toml::table{{"spp", int64_t(config.scenes[0].reference.spp)},
                                         {"seed", int64_t(config.reference_seed)}});
    root.insert("budget", budget_table(config));
    if (!config.ablation_default.empty()) root.insert("ablation", toml::table{{"default", config.ablation_default}});
    for (const SceneEntry& scene : config.scenes) scenes.push_back(scene_table(scene));
    root.insert("scene", scenes);
    for (const RunEntry& run : config.runs) runs.push_back(run_table(run));
    root.insert("run", runs);
    std::ostringstream out;
    out << root << "\n";
    return out.str();
}

}  // namespace ambilux
