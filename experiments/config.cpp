#include "experiments/config.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "core/atomic_file.h"
#include "core/log.h"
#include "core/text.h"
#include "experiments/config_runs.h"
#include "experiments/sweep.h"
#include "experiments/toml_depth.h"
#include "experiments/toml_reader.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

constexpr int64_t kMaxSpp = 4294967295;

using Reader = TomlReader;
using TakenNames = std::set<std::string>;

/// The ground truth: `t` over `inherited`.
ReferenceEntry read_reference(const Reader& r, const toml::table& t, const std::string& where,
                              ReferenceEntry inherited) {
    if (const toml::node* spp = t.get("spp")) inherited.spp = uint64_t(r.integer(*spp, "spp", 2, kMaxSpp));
    if (!t.get("integrator") && !t.get("variant") && !t.get("set")) return inherited;
    ReferenceEntry reference{inherited.spp, {}};
    reference.how.name = "reference";
    reference.how.line = Reader::line_of(t);
    const std::string integrator = r.text(r.need(t, "integrator", where), "integrator");
    // Light tracing does not see what mirrors show to the camera: it is no ground truth.
    if (!makes_references(integrator))
        throw r.error(*t.get("integrator"),
                      fmt::format("integrator '{}': a reference is made by {}, which find all light", integrator,
                                  fmt::join(reference_integrators(), " or ")));
    add_settings(r, reference.how, t);
    for (size_t i = 0; i < reference.how.settings.size(); ++i)
        if (const Setting* s = find_general_setting(reference.how.settings[i].first); s && s->partial)
            throw input_error(
                r.file, reference.how.lines[i],
                fmt::format("'{}' in {}: a reference uses all that its integrator has", s->what.key, where));
    return reference;
}

/// What --reduced replaces.
struct Reduction {
    double scale = 1;            ///< of width and height
    uint64_t reference_spp = 0;  ///< of all scenes; 0: as it is
};

/// File of a scene: relative to the configuration, or to the folder of the published scenes.
std::string scene_file(const Reader& r, const toml::node& path, const std::string& scene) {
    namespace fs = std::filesystem;
    const fs::path folder = fs::absolute(fs::path(r.file)).parent_path();
    std::string file = r.text(path, "path");
    const std::string data = "$AMBILUX_DATA";
    if (file.starts_with(data + "/")) {
        const char* place = std::getenv("AMBILUX_DATA");
        if (!place || !*place)
            throw r.error(path, fmt::format("scene '{}': the environment variable AMBILUX_DATA is not set; it names "
                                            "the folder of the published scenes (docs/building.md)",
                                            scene));
        file = fs::absolute(place).string() + file.substr(data.size());
    }
    const std::string found = (folder / file).lexically_normal().string();
    std::error_code ignored;  // such as a name that is too long
    if (!fs::is_regular_file(found, ignored))
        throw r.error(path, fmt::format("scene '{}': there is no file {}", scene, found));
    return found;
}

/// A scene with `optional = true` that is not there; says so.
bool is_left_out(const Reader& r, const toml::table& t) {
    const toml::node* optional = t.get("optional");
    if (!optional || !r.flag(*optional, "optional")) return false;
    const std::string name = r.name(t, "[[scene]]");
    try {
        scene_file(r, r.need(t, "path", "[[scene]]"), name);
        return false;
    } catch (const Error& e) {
        log_warning(fmt::format("left out: {}", e.what()));
        return true;
    }
}

constexpr const char* kSweptSceneKeys[] = {"size", "max_depth"};
/// Before the name of a parameter of the scene, and before that of a $parameter of its file.
constexpr std::string_view kParams = "params.", kParameters = "parameters.";

bool is_named(std::string_view key) { return key.starts_with(kParams) || key.starts_with(kParameters); }

/// A value, or numbers such as those of a colour, joined by `between`.
std::string scene_value(const Reader& r, const toml::node& value, std::string_view key, const char* between) {
    if (!value.is_array()) return r.plain(value, key);
    std::vector<std::string> texts;
    for (const toml::node& number : r.array(value, key)) texts.push_back(r.plain(number, key));
    return fmt::format("{}", fmt::join(texts, between));
}

void set_named(Settings& all, std::string_view name, const std::string& value) {
    std::erase_if(all, [&](const auto& known) { return known.first == name; });
    all.emplace_back(std::string(name), value);
}

/// Sets one of kSweptSceneKeys, or what is_named(); returns the value as text.
std::string set_scene_key(const Reader& r, const Reduction& reduction, SceneEntry& entry, const std::string& key,
                          const toml::node& value) {
    if (key == "max_depth") {
        entry.max_depth = int(r.integer(value, key, -1, 1 << 20));
        return std::to_string(*entry.max_depth);
    }
    if (is_named(key)) {
        const bool by_name = key.starts_with(kParams);
        set_named(by_name ? entry.params : entry.parameters, key.substr((by_name ? kParams : kParameters).size()),
                  scene_value(r, value, key, " "));
        return scene_value(r, value, key, "_");
    }
    const toml::array& a = r.array(value, key);
    if (a.size() != 2) throw r.error(value, "'size' must be [width, height]");
    const auto pixels = [&](const toml::node& node) {
        return uint32_t(std::max(1.0, std::round(reduction.scale * double(r.integer(node, key, 1, 65536)))));
    };
    entry.width = pixels(a[0]);
    entry.height = pixels(a[1]);
    return fmt::format("{}x{}", entry.width, entry.height);
}

ReferenceEntry read_scene_reference(const Reader& r, const toml::table& t, ReferenceEntry reference,
                                    const Reduction& reduction) {
    if (const toml::node* own = t.get("reference")) {
        const toml::table& table = r.table(*own, "reference");
        r.check_keys(table, "'reference' of [[scene]]", {"spp", "integrator", "variant", "set"});
        reference = read_reference(r, table, "'reference' of [[scene]]", reference);
    }
    if (const toml::node* spp = t.get("reference_spp")) {
        if (t.at_path("reference.spp"))
            throw r.error(*spp, "'reference_spp' and 'reference.spp' say the same: leave one out");
        reference.spp = uint64_t(r.integer(*spp, "reference_spp", 2, kMaxSpp));
    }
    if (reduction.reference_spp) reference.spp = reduction.reference_spp;
    return reference;
}

/// `scene` once for each combination of the values in its 'sweep'.
std::vector<SceneEntry> swept_scenes(const Reader& r, const toml::table& t, const SceneEntry& scene,
                                     const Reduction& reduction) {
    const toml::node* sweep = t.get("sweep");
    if (!sweep) return {scene};
    for (const auto& [key, list] : r.table(*sweep, "sweep"))
        if (!is_named(key.str()))
            r.check_keys(toml::table{{key.str(), true}}, "'sweep' of [[scene]]", {"size", "max_depth"},
                         int(key.source().begin.line));
    for (const char* key : kSweptSceneKeys)
        if (t.get(key) && sweep->as_table()->get(key))
            throw r.error(*sweep, fmt::format("'{}' is set and in 'sweep': leave one out", key));
    const Sweep lists =
        read_sweep(r, *sweep, "'sweep' of [[scene]]", [&](const std::string& key, const toml::node& value) {
            SceneEntry ignored;
            return set_scene_key(r, reduction, ignored, key, value);
        });
    std::vector<SceneEntry> scenes;
    for (const auto& values : combinations(lists)) {
        scenes.push_back(scene);
        scenes.back().name = swept_name(scene.base, values);
        for (const SweepValue& value : values) set_scene_key(r, reduction, scenes.back(), value.key, *value.node);
    }
    return scenes;
}

std::vector<SceneEntry> read_scene(const Reader& r, const toml::table& t, const ReferenceEntry& reference,
                                   const Reduction& reduction, TakenNames& names) {
    r.check_keys(t, "[[scene]]",
                 {"name", "path", "size", "max_depth", "reference_spp", "reference", "lenient", "optional",
                  "parameters", "params", "sweep"});
    SceneEntry scene;
    scene.line = Reader::line_of(t);
    scene.name = scene.base = r.name(t, "[[scene]]");
    scene.path = scene_file(r, r.need(t, "path", "[[scene]]"), scene.name);
    for (const char* key : kSweptSceneKeys)
        if (const toml::node* value = t.get(key)) set_scene_key(r, reduction, scene, key, *value);
    const bool sized = t.contains("size") || t.at_path("sweep.size");
    if (reduction.scale != 1 && !sized)
        throw r.error(t, fmt::format("scene '{}': 'scale' of [reduced] needs a 'size' here", scene.name));
    scene.reference = read_scene_reference(r, t, reference, reduction);
    if (const toml::node* lenient = t.get("lenient")) scene.lenient = r.flag(*lenient, "lenient");
    if (const toml::node* parameters = t.get("parameters"))
        for (const auto& [key, value] : r.table(*parameters, "parameters"))
            scene.parameters.emplace_back(std::string(key.str()), r.plain(value, key.str()));
    if (const toml::node* params = t.get("params"))
        for (const auto& [key, value] : r.table(*params, "params"))
            set_named(scene.params, key.str(), scene_value(r, value, key.str(), " "));
    const std::vector<SceneEntry> scenes = swept_scenes(r, t, scene, reduction);
    for (const SceneEntry& entry : scenes) r.claim(*t.get("name"), entry.name, "[[scene]]", names);
    return scenes;
}

void read_seeds(const Reader& r, const toml::node& list, ExperimentConfig& config) {
    config.seeds.clear();
    std::set<uint64_t> taken;
    for (const toml::node& node : r.array(list, "seeds")) {
        const auto seed = uint64_t(r.integer(node, "seeds", 0, INT64_MAX));
        if (!taken.insert(seed).second) throw r.error(node, fmt::format("seed {} is listed twice", seed));
        config.seeds.push_back(seed);
    }
}

/// The lists 'spp' and 'seconds' of a table that may hold more; they replace what the configuration has.
void read_budget(const Reader& r, const toml::table& t, ExperimentConfig& config) {
    const toml::node *spp = t.get("spp"), *seconds = t.get("seconds");
    if (spp || seconds) {
        config.spp.clear();
        config.seconds.clear();
    }
    if (spp)
        for (const toml::node& node : r.array(*spp, "spp")) {
            const auto value = uint64_t(r.integer(node, "spp", 1, kMaxSpp));
            if (!config.spp.empty() && value <= config.spp.back())
                throw r.error(node, fmt::format("'spp' must rise; {} does not", value));
            config.spp.push_back(value);
        }
    if (seconds)
        for (const toml::node& node : r.array(*seconds, "seconds")) {
            const auto value = node.value<double>();
            if (!node.is_number() || !value || !(*value > 0) || !std::isfinite(*value))
                throw r.error(node, "'seconds' must be positive numbers");
            if (!config.seconds.empty() && *value <= config.seconds.back())
                throw r.error(node, fmt::format("'seconds' must rise; {} does not", *value));
            config.seconds.push_back(*value);
        }
}

toml::table parse_toml(const std::string& path) {
    constexpr uint64_t kMostBytes = 16 << 20;
    const std::string content = plain_text(path, read_file(path, kMostBytes));
    check_key_depth(path, content);
    try {
        return toml::parse(content, path);
    } catch (const toml::parse_error& e) {
        throw input_error(path, int(e.source().begin.line), std::string(e.description()));
    }
}

std::string read_backend(const Reader& r, const toml::node& node) {
    const std::string backend = r.text(node, "backend");
    try {
        RenderSettings parsed;
        apply_setting(parsed, "backend", backend);
    } catch (const Error& e) {
        throw r.error(node, e.what());
    }
    return backend;
}

/// Fewer have no variance worth the name (ZTestOptions::min_samples).
uint64_t read_agreement_spp(const Reader& r, const toml::node& node) {
    return uint64_t(r.integer(node, "agreement_spp", 256, kMaxSpp));
}

/// The section [reduced]: what it replaces for all scenes, and in `config` its seeds and budgets.
Reduction read_reduction(const Reader& r, const toml::table& t, ExperimentConfig& config) {
    r.check_keys(t, "[reduced]", {"scale", "reference_spp", "agreement_spp", "seeds", "spp", "seconds"});
    if (const toml::node* spp = t.get("agreement_spp")) config.agreement_spp = read_agreement_spp(r, *spp);
    Reduction reduction;
    if (const toml::node* scale = t.get("scale")) {
        const auto value = scale->value<double>();
        if (!scale->is_number() || !value || !(*value > 0) || !(*value <= 1))
            throw r.error(*scale, "'scale' must be a number above 0, up to 1");
        reduction.scale = *value;
    }
    if (const toml::node* spp = t.get("reference_spp"))
        reduction.reference_spp = uint64_t(r.integer(*spp, "reference_spp", 2, kMaxSpp));
    if (const toml::node* seeds = t.get("seeds")) read_seeds(r, *seeds, config);
    read_budget(r, t, config);
    config.name += "-reduced";
    return reduction;
}

/// A text that is one of two.
std::string one_of(const Reader& r, const toml::node& node, const char* key, const char* a, const char* b) {
    const std::string text = r.text(node, key);
    if (text != a && text != b) throw r.error(node, fmt::format("{} '{}': must be {} or {}", key, text, a, b));
    return text;
}

/// What is said of all runs on all scenes, and has a default.
void read_general(const Reader& r, const toml::table& root, ExperimentConfig& config) {
    if (const toml::node* backend = root.get("backend")) config.backend = read_backend(r, *backend);
    if (const toml::node* metric = root.get("metric")) config.metric = one_of(r, *metric, "metric", "relmse", "mse");
    if (const toml::node* order = root.get("order"))
        config.random_order = one_of(r, *order, "order", "random", "listed") == "random";
    if (const toml::node* repeats = root.get("repeats"))
        config.repeats = uint64_t(r.integer(*repeats, "repeats", 0, 100));
    if (const toml::node* spp = root.get("agreement_spp")) config.agreement_spp = read_agreement_spp(r, *spp);
}

}  // namespace

std::vector<Checkpoint> ExperimentConfig::checkpoints() const {
    std::vector<Checkpoint> all;
    for (const uint64_t samples : spp) all.push_back({samples, 0});
    for (const double time : seconds) all.push_back({0, time});
    return all;
}

ExperimentConfig read_experiment(const std::string& path, bool reduced) {
    const toml::table root = parse_toml(path);
    const Reader r{path};
    r.check_keys(root, "the configuration",
                 {"name", "metric", "order", "repeats", "backend", "filter", "agreement_spp", "seeds", "reference",
                  "budget", "scene", "run", "ablation", "reduced"});
    const auto need = [&](std::string_view key) -> const toml::node& {
        if (const toml::node* node = root.get(key)) return *node;
        throw input_error(path, 0, fmt::format("lacks the key '{}'", key));
    };
    ExperimentConfig config;
    config.file = path;
    config.name =
        root.contains("name") ? r.name(root, "the configuration") : std::filesystem::path(path).stem().string();
    read_general(r, root, config);
    read_seeds(r, need("seeds"), config);
    const toml::table& reference = r.table(need("reference"), "reference");
    r.check_keys(reference, "[reference]", {"spp", "seed", "integrator", "variant", "set"});
    r.need(reference, "spp", "[reference]");
    const ReferenceEntry general = read_reference(r, reference, "[reference]", {});
    if (const toml::node* seed = reference.get("seed"))
        config.reference_seed = uint64_t(r.integer(*seed, "seed", 0, INT64_MAX));
    const toml::table& budget = r.table(need("budget"), "budget");
    r.check_keys(budget, "[budget]", {"spp", "seconds"});
    if (!budget.get("spp") && !budget.get("seconds")) throw r.error(budget, "[budget] needs 'spp', 'seconds' or both");
    read_budget(r, budget, config);
    Reduction reduction;
    if (const toml::node* node = root.get("reduced")) {
        // Read in any case, so that its mistakes show before somebody needs it.
        ExperimentConfig small = config;
        const Reduction smaller = read_reduction(r, r.table(*node, "reduced"), small);
        if (reduced) config = small;
        if (reduced) reduction = smaller;
    } else if (reduced) {
        throw input_error(path, 0, "--reduced: it has no section [reduced] that says what is smaller");
    }
    TakenNames scene_names, run_names;
    for (const toml::node& node : r.array(need("scene"), "scene")) {
        if (is_left_out(r, r.table(node, "scene"))) continue;
        for (SceneEntry& scene : read_scene(r, r.table(node, "scene"), general, reduction, scene_names))
            config.scenes.push_back(std::move(scene));
    }
    if (config.scenes.empty()) throw input_error(path, 0, "none of its scenes is there; all of them are optional");
    if (const toml::node* filter = root.get("filter")) {
        const bool box = one_of(r, *filter, "filter", "scene", "box") == "box";
        for (SceneEntry& scene : config.scenes) scene.box_filter = box;
    }
    for (const toml::node& node : r.array(need("run"), "run"))
        for (RunEntry& run : read_run(r, r.table(node, "run"), run_names)) config.runs.push_back(std::move(run));
    if (const toml::node* ablation = root.get("ablation"))
        read_ablation(r, r.table(*ablation, "ablation"), config, run_names);
    return config;
}

}  // namespace ambilux
