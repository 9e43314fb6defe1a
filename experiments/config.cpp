#include "experiments/config.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <set>
#include <sstream>

#include "core/atomic_file.h"
#include "core/error.h"

namespace ambilux {
namespace {

/// Reads nodes of one file and says where a wrong one stands.
struct Reader {
    std::string file;

    static int line_of(const toml::node& node) { return int(node.source().begin.line); }
    Error error(const toml::node& node, const std::string& message) const { return input_error(file, line_of(node), message); }

    void check_keys(const toml::table& table, const std::string& where, std::initializer_list<std::string_view> known) const {
        for (const auto& [key, node] : table)
            if (std::find(known.begin(), known.end(), key.str()) == known.end())
                throw input_error(file, int(key.source().begin.line),
                                  fmt::format("unknown key '{}' in {}; known are: {}", key.str(), where, fmt::join(known, ", ")));
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
        if (!node.is_array() || node.as_array()->empty()) throw error(node, fmt::format("'{}' must be a list that is not empty", key));
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
    /// Name that is a file name everywhere and needs no quotes in CSV.
    std::string name(const toml::table& parent, const std::string& where, std::set<std::string>& taken) const {
        const toml::node& node = need(parent, "name", where);
        const std::string value = text(node, "name");
        const bool allowed = !value.empty() && value.size() <= 64 && value[0] != '.' && std::all_of(value.begin(), value.end(), [](unsigned char c) {
            return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
        });
        if (!allowed) throw error(node, fmt::format("name '{}': use 1 to 64 letters, digits, '.', '_' or '-', not beginning with '.'", value));
        if (!taken.insert(value).second) throw error(node, fmt::format("name '{}' of {} is used twice", value, where));
        return value;
    }
};

constexpr int64_t kMaxSpp = 4294967295;

SceneEntry read_scene(const Reader& r, const toml::table& t, std::set<std::string>& names) {
    r.check_keys(t, "[[scene]]", {"name", "path", "size", "max_depth", "reference_spp", "lenient", "parameters"});
    SceneEntry scene;
    scene.line = Reader::line_of(t);
    scene.name = r.name(t, "[[scene]]", names);
    const toml::node& path = r.need(t, "path", "[[scene]]");
    namespace fs = std::filesystem;
    const fs::path folder = fs::absolute(fs::path(r.file)).parent_path();
    scene.path = (folder / r.text(path, "path")).lexically_normal().string();
    if (!fs::is_regular_file(scene.path)) throw r.error(path, fmt::format("scene '{}': there is no file {}", scene.name, scene.path));
    if (const toml::node* size = t.get("size")) {
        const toml::array& a = r.array(*size, "size");
        if (a.size() != 2) throw r.error(*size, "'size' must be [width, height]");
        scene.width = uint32_t(r.integer(a[0], "size", 1, 65536));
        scene.height = uint32_t(r.integer(a[1], "size", 1, 65536));
    }
    if (const toml::node* depth = t.get("max_depth")) scene.max_depth = int(r.integer(*depth, "max_depth", -1, 1 << 20));
    if (const toml::node* spp = t.get("reference_spp")) scene.reference_spp = uint64_t(r.integer(*spp, "reference_spp", 2, kMaxSpp));
    if (const toml::node* lenient = t.get("lenient")) scene.lenient = r.flag(*lenient, "lenient");
    if (const toml::node* parameters = t.get("parameters"))
        for (const auto& [key, value] : r.table(*parameters, "parameters")) scene.parameters.emplace_back(std::string(key.str()), r.plain(value, key.str()));
    return scene;
}

RunEntry read_run(const Reader& r, const toml::table& t, std::set<std::string>& names) {
    r.check_keys(t, "[[run]]", {"name", "integrator", "variant", "estimator", "set"});
    RunEntry run;
    run.line = Reader::line_of(t);
    run.name = r.name(t, "[[run]]", names);
    const auto add = [&](std::string_view key, const toml::node& value) {
        run.settings.emplace_back(std::string(key), r.plain(value, key));
        run.lines.push_back(Reader::line_of(value));
    };
    add("integrator", r.need(t, "integrator", "[[run]]"));
    for (const char* key : {"variant", "estimator"})
        if (const toml::node* value = t.get(key)) add(key, *value);
    if (const toml::node* set = t.get("set"))
        for (const auto& [key, value] : r.table(*set, "set")) {
            if (key.str() == "seed" || key.str() == "max_depth")
                throw r.error(value, fmt::format("'{}' belongs to the experiment (seeds) or to a scene (max_depth), not to a run", key.str()));
            add(key.str(), value);
        }
    return run;
}

void read_budget(const Reader& r, const toml::table& t, ExperimentConfig& config) {
    r.check_keys(t, "[budget]", {"spp", "seconds"});
    const toml::node *spp = t.get("spp"), *seconds = t.get("seconds");
    if (!spp == !seconds) throw r.error(t, "[budget] needs either 'spp' or 'seconds'");
    if (spp)
        for (const toml::node& node : r.array(*spp, "spp")) {
            const auto value = uint64_t(r.integer(node, "spp", 1, kMaxSpp));
            if (!config.spp.empty() && value <= config.spp.back()) throw r.error(node, fmt::format("'spp' must rise; {} does not", value));
            config.spp.push_back(value);
        }
    if (seconds)
        for (const toml::node& node : r.array(*seconds, "seconds")) {
            const auto value = node.value<double>();
            if (!node.is_number() || !value || !(*value > 0) || !std::isfinite(*value)) throw r.error(node, "'seconds' must be positive numbers");
            if (!config.seconds.empty() && *value <= config.seconds.back()) throw r.error(node, fmt::format("'seconds' must rise; {} does not", *value));
            config.seconds.push_back(*value);
        }
}

}  // namespace

ExperimentConfig read_experiment(const std::string& path) {
    const std::string content = read_file(path);
    toml::table root;
    try {
        root = toml::parse(content, path);
    } catch (const toml::parse_error& e) {
        throw input_error(path, int(e.source().begin.line), std::string(e.description()));
    }
    const Reader r{path};
    r.check_keys(root, "the configuration", {"name", "backend", "seeds", "reference", "budget", "scene", "run"});
    const auto need = [&](std::string_view key) -> const toml::node& {
        if (const toml::node* node = root.get(key)) return *node;
        throw input_error(path, 0, fmt::format("lacks the key '{}'", key));
    };
    ExperimentConfig config;
    config.file = path;
    std::set<std::string> none, scene_names, run_names;
    config.name = root.contains("name") ? r.name(root, "the configuration", none) : std::filesystem::path(path).stem().string();
    if (const toml::node* backend = root.get("backend")) {
        config.backend = r.text(*backend, "backend");
        if (config.backend != "auto" && config.backend != "cpu" && config.backend != "cuda")
            throw r.error(*backend, fmt::format("backend '{}': auto, cpu and cuda are known", config.backend));
    }
    std::set<uint64_t> seeds;
    for (const toml::node& node : r.array(need("seeds"), "seeds")) {
        const auto seed = uint64_t(r.integer(node, "seeds", 0, INT64_MAX));
        if (!seeds.insert(seed).second) throw r.error(node, fmt::format("seed {} is listed twice", seed));
        config.seeds.push_back(seed);
    }
    const toml::table& reference = r.table(need("reference"), "reference");
    r.check_keys(reference, "[reference]", {"spp", "seed"});
    config.reference_spp = uint64_t(r.integer(r.need(reference, "spp", "[reference]"), "spp", 2, kMaxSpp));
    if (const toml::node* seed = reference.get("seed")) config.reference_seed = uint64_t(r.integer(*seed, "seed", 0, INT64_MAX));
    read_budget(r, r.table(need("budget"), "budget"), config);
    for (const toml::node& node : r.array(need("scene"), "scene")) config.scenes.push_back(read_scene(r, r.table(node, "scene"), scene_names));
    for (const toml::node& node : r.array(need("run"), "run")) config.runs.push_back(read_run(r, r.table(node, "run"), run_names));
    return config;
}

std::string resolved_toml(const ExperimentConfig& config) {
    const auto table_of = [](const std::vector<std::pair<std::string, std::string>>& pairs) {
        toml::table t;
        for (const auto& [key, value] : pairs) t.insert_or_assign(key, value);
        return t;
    };
    toml::table root;
    root.insert("name", config.name);
    root.insert("backend", config.backend);
    toml::array seeds, scenes, runs, budget;
    for (const uint64_t seed : config.seeds) seeds.push_back(int64_t(seed));
    root.insert("seeds", seeds);
    root.insert("reference", toml::table{{"spp", int64_t(config.reference_spp)}, {"seed", int64_t(config.reference_seed)}});
    for (const uint64_t spp : config.spp) budget.push_back(int64_t(spp));
    for (const double seconds : config.seconds) budget.push_back(seconds);
    root.insert("budget", toml::table{{config.spp.empty() ? "seconds" : "spp", budget}});
    for (const SceneEntry& s : config.scenes) {
        toml::table t{{"name", s.name}, {"path", s.path}, {"reference_spp", int64_t(s.reference_spp.value_or(config.reference_spp))}};
        if (s.width) t.insert("size", toml::array{int64_t(s.width), int64_t(s.height)});
        if (s.max_depth) t.insert("max_depth", int64_t(*s.max_depth));
        if (s.lenient) t.insert("lenient", true);
        if (!s.parameters.empty()) t.insert("parameters", table_of(s.parameters));
        scenes.push_back(t);
    }
    root.insert("scene", scenes);
    for (const RunEntry& run : config.runs) {
        toml::table t{{"name", run.name}}, set;
        for (const auto& [key, value] : run.settings)
            if (key == "integrator" || key == "variant" || key == "estimator")
                t.insert_or_assign(key, value);
            else
                set.insert_or_assign(key, value);
        if (!set.empty()) t.insert("set", set);
        runs.push_back(t);
    }
    root.insert("run", runs);
    std::ostringstream out;
    out << root << "\n";
    return out.str();
}

}  // namespace ambilux
