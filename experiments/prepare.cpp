#include "experiments/prepare.h"
#include "formats/load.h"

#include <fmt/format.h>

#include <chrono>
#include <tuple>

#include "core/error.h"
#include "core/log.h"
#include "core/sha256.h"
#include "experiments/reference_store.h"
#include "session/drive.h"

namespace ambilux {
namespace {

/// The content is another then: references of the scene with its own filter are not this scene's.
void use_box_filter(Scene& scene) {
    if (scene.sensor.filter == FilterType::box && scene.sensor.filter_radius == 0.5f) return;
    scene.sensor.filter = FilterType::box;
    scene.sensor.filter_radius = 0.5f;
    scene.content_hash = sha256(to_hex(scene.content_hash) + " filter=box");
}

LoadedEntry load_entry(const ExperimentConfig& config, const SceneEntry& entry, const Hooks& hooks) {
    try {
        LoadOptions options;
        options.width = entry.width;
        options.height = entry.height;
        options.lenient = entry.lenient;
        options.parameters = entry.parameters;
        for (const auto& [name, value] : entry.params) options.edits.push_back({name, value, {}, {}});
        const auto start = std::chrono::steady_clock::now();
        LoadedEntry loaded;
        loaded.entry = &entry;
        loaded.scene = hooks.load_scene(entry.path, options);
        if (entry.box_filter) use_box_filter(loaded.scene);
        loaded.load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        RenderSettings probe;
        loaded.max_depth = entry.max_depth.value_or(loaded.scene.integrator.max_depth);
        hooks.apply_setting(probe, "max_depth", std::to_string(loaded.max_depth));
        for (const std::string& warning : loaded.scene.warnings)
            log_warning(fmt::format("scene '{}': {}", entry.name, warning));
        return loaded;
    } catch (const Error& e) {
        if (e.code == ExitCode::device) throw;
        throw input_error(config.file, entry.line, fmt::format("scene '{}': {}", entry.name, e.what()));
    }
}

/// The line of the setting that a message of the renderer begins with, such as "variant=lvc: ...", else `line`.
int line_of(const RunEntry& run, const std::string& message, int line) {
    if (run.techniques && message.starts_with("technique_depth=")) return run.techniques_line;
    for (size_t i = 0; i < run.settings.size(); ++i)
        if (message.starts_with(run.settings[i].first + "=")) return run.lines[i];
    return line;
}

/// Makes a renderer and lets it go; what it refuses, and numbers of `samples` that are no whole iterations, is refused
/// with the line of `run`.
RenderStats try_settings(const ExperimentConfig& config, const LoadedEntry& scene, const RunEntry& run,
                         const RenderSettings& settings, const std::vector<uint64_t>& samples, const std::string& who,
                         int line, const Hooks& hooks) {
    try {
        const std::unique_ptr<Renderer> renderer = hooks.make_renderer(scene.scene, settings);
        const RenderStats stats = renderer->stats();
        for (const uint64_t spp : samples) check_iterations("spp", spp, renderer->iteration_samples(), stats.settings);
        return stats;
    } catch (const Error& e) {
        if (e.code != ExitCode::usage) throw;
        throw input_error(config.file, line_of(run, e.what(), line), fmt::format("{}: {}", who, e.what()));
    }
}

}  // namespace

RenderSettings settings_for(const ExperimentConfig& config, const LoadedEntry& scene, const RunEntry& run,
                            uint64_t seed, const Hooks& hooks) {
    RenderSettings s;
    s.backend = config.backend;
    s.max_depth = scene.max_depth;
    s.rr_depth = scene.scene.integrator.rr_depth;
    const auto apply = [&](const std::string& key, const std::string& value, int line) {
        try {
            hooks.apply_setting(s, key, value);
        } catch (const Error& e) {
            throw input_error(config.file, line, fmt::format("run '{}': {}", run.name, e.what()));
        }
    };
    for (size_t i = 0; i < run.settings.size(); ++i)
        if (run.renderer.empty() || run.settings[i].first == "rr_depth")  // the others are the peer's own
            apply(run.settings[i].first, run.settings[i].second, run.lines[i]);
    if (run.techniques) apply("technique_depth", std::to_string(run.techniques), run.techniques_line);
    s.seed = seed;
    return s;
}

Prepared prepare_experiment(const std::string& path, bool reduced, const Hooks& hooks) {
    Prepared p;
    p.config = read_experiment(path, reduced);
    // Settings need no scene: a wrong one is told before minutes of loading.
    for (const RunEntry& run : p.config.runs) settings_for(p.config, {}, run, 0, hooks);
    for (const SceneEntry& entry : p.config.scenes) p.scenes.push_back(load_entry(p.config, entry, hooks));
    for (const LoadedEntry& scene : p.scenes) {
        std::set<std::tuple<std::string, std::string, Backend>> tried;
        for (const RunEntry& run : p.config.runs) {
            if (!run.renderer.empty()) continue;  // tried when it is examined: what is not there is no mistake
            const RenderSettings settings = settings_for(p.config, scene, run, 0, hooks);
            if (&scene != &p.scenes[0] &&
                !tried.insert({settings.integrator, settings.variant, settings.backend}).second)
                continue;
            const RenderStats stats =
                try_settings(p.config, scene, run, settings, p.config.spp,
                             fmt::format("run '{}' on scene '{}'", run.name, scene.entry->name), run.line, hooks);
            p.devices.insert(stats.device);
            p.backends.insert(stats.backend);
        }
        const RunEntry& how = scene.entry->reference.how;
        if (how.settings.empty()) continue;
        const RenderSettings settings = reference_settings(p.config, *scene.entry, scene.scene, scene.max_depth, hooks);
        try_settings(p.config, scene, how, settings, {scene.entry->reference.spp},
                     fmt::format("reference of '{}'", scene.entry->name), how.line, hooks);
    }
    return p;
}

}  // namespace ambilux
