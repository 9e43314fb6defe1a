#include "experiments/statistics.h"

#include <fmt/format.h>

#include <cmath>

#include "core/version.h"

namespace ambilux {
namespace {

nlohmann::json invalid_json(const InvalidCounts& invalid) {
    return {{"nan", invalid.nan}, {"inf", invalid.inf}, {"negative", invalid.negative}};
}

/// Null where nothing was chosen.
nlohmann::json choice_json(const SelectionStats& choice) {
    if (choice.name.empty()) return nullptr;
    nlohmann::json candidates = nlohmann::json::array(), settings = nlohmann::json::object();
    for (const SelectionStats::Candidate& c : choice.candidates)
        candidates.push_back(
            {{"name", c.name},
             {"settings", c.settings},
             {"variance", std::isfinite(c.variance) ? nlohmann::json(c.variance) : nlohmann::json(nullptr)},
             {"work", c.work},
             {"seconds_per_sample", c.seconds > 0 ? nlohmann::json(c.seconds) : nlohmann::json(nullptr)},
             {"efficiency", c.efficiency}});
    for (const auto& [key, value] : choice.settings) settings[key] = value;
    return {{"name", choice.name},
            {"settings", settings},
            {"seconds", choice.seconds},
            {"pilot_samples", choice.pilot_samples},
            {"expected_samples", choice.expected_samples},
            {"candidates", candidates}};
}

}  // namespace

std::string choice_line(const SelectionStats& choice) {
    std::string line;
    for (const auto& [key, value] : choice.settings) line += " --set " + key + "=" + value;
    return line.empty() ? line : line.substr(1);
}

std::string scene_hash(const Scene& scene) {
    std::string hex;
    for (const uint8_t byte : scene.content_hash) hex += fmt::format("{:02x}", byte);
    return hex;
}

const char* estimator_name(Estimator estimator) {
    constexpr const char* kNames[] = {"naive", "nee", "mis"};
    return kNames[uint32_t(estimator)];
}

const char* fuse_name(Fuse fuse) {
    const char* names[] = {"auto", "none"};
    return names[size_t(fuse)];
}

const char* draws_name(CacheDraws draws) {
    const char* names[] = {"auto", "coherent", "independent"};
    return names[size_t(draws)];
}

const char* heuristic_name(MisHeuristic heuristic) { return Heuristics::kNames[uint32_t(heuristic)]; }

/// The settings that the estimator ran with: bdpt.auto replaces some of those asked for.
RenderSettings used_settings(const RenderSettings& asked, const SelectionStats& choice) {
    RenderSettings settings = asked;
    for (const auto& [key, value] : choice.settings) apply_setting(settings, key, value);
    return settings;
}

nlohmann::json stats_json(const Scene& scene, const RenderSettings& asked, const RenderStats& stats,
                          double load_seconds) {
    const RenderSettings settings = used_settings(asked, stats.choice);
    nlohmann::json stages = nlohmann::json::array(), queues = nlohmann::json::array();
    for (const StageStats& s : stats.stages)
        stages.push_back({{"name", s.name},
                          {"launches", s.launches},
                          {"items", s.items},
                          {"seconds", s.seconds},
                          {"items_by_depth", s.items_by_depth}});
    for (const QueueStats& q : stats.queues)
        queues.push_back({{"name", q.name}, {"capacity", q.capacity}, {"peak", q.peak}, {"overflow", q.overflow}});
    nlohmann::json invalid = invalid_json(stats.invalid);
    invalid["by_stage"] = nlohmann::json::object();
    for (const auto& [stage, counts] : stats.invalid_by_stage) invalid["by_stage"][stage] = invalid_json(counts);
    const double rays = double(stats.rays_extend) + double(stats.rays_occlude);
    return {{"scene", scene.path},
            {"scene_hash", scene_hash(scene)},
            {"warnings", scene.warnings},
            {"integrator", settings.integrator},
            {"variant", settings.variant},
            {"estimator", estimator_name(settings.estimator)},
            {"heuristic", heuristic_name(settings.heuristic)},
            {"backend", stats.backend},
            {"device", stats.device},
            {"accel", stats.accel},
            {"seed", settings.seed},
            {"size", {scene.sensor.crop_width, scene.sensor.crop_height}},
            {"spp", stats.samples},
            {"max_depth", settings.max_depth},
            {"rr_depth", settings.rr_depth},
            {"strategies", strategies_text(settings)},
            {"connections", settings.connections},
            {"light_paths", double(settings.light_subpaths_per_tile) / kTilePixels},
            {"deterministic", settings.deterministic},
            {"specialise", settings.specialise},
            {"fuse", fuse_name(settings.fuse)},
            {"draws", draws_name(stats.settings.draws)},
            {"cull", settings.cull},
            {"tail", settings.tail},
            {"compaction", compaction_name(settings.queues.compaction)},
            {"ordering", ordering_name(stats.settings.queues.ordering)},
            {"seconds", {{"load", load_seconds}, {"build", stats.build_seconds}, {"render", stats.render_seconds}}},
            {"rays", {{"extend", stats.rays_extend}, {"occlude", stats.rays_occlude}}},
            {"rays_per_second", stats.render_seconds > 0 ? rays / stats.render_seconds : 0.0},
            {"stages", stages},
            {"queues", queues},
            {"invalid", invalid},
            {"memory_bytes", stats.memory_bytes},
            {"memory_bytes_predicted", stats.memory_bytes_predicted},
            {"features", stats.features},
            {"skipped", stats.skipped},
            {"choice", choice_json(stats.choice)},
            {"version", version()},
            {"git_revision", git_revision()}};
}

Attributes image_attributes(const Scene& scene, const RenderSettings& asked, const RenderStats& stats) {
    const RenderSettings settings = used_settings(asked, stats.choice);
    Attributes attributes = {{"scene", scene.path},
                             {"scene_hash", scene_hash(scene)},
                             {"integrator", settings.integrator},
                             {"variant", settings.variant},
                             {"spp", stats.samples},
                             {"seed", settings.seed},
                             {"max_depth", settings.max_depth},
                             {"rr_depth", settings.rr_depth},
                             {"backend", stats.backend},
                             {"device", stats.device},
                             {"seconds", stats.render_seconds},
                             {"software", fmt::format("ambilux {}", version())},
                             {"git_revision", git_revision()}};
    if (settings.integrator == "path") attributes["estimator"] = estimator_name(settings.estimator);
    attributes["heuristic"] = heuristic_name(settings.heuristic);
    if (!stats.choice.name.empty()) {
        attributes["choice"] = choice_line(stats.choice);
    } else if (settings.integrator != "path") {
        attributes["strategies"] = strategies_text(settings);
        attributes["light_paths"] = double(settings.light_subpaths_per_tile) / kTilePixels;
        if (settings.variant == "lvc") attributes["connections"] = settings.connections;
    }
    return attributes;
}

std::string stage_table(const RenderStats& stats) {
    double total = 0;
    for (const StageStats& s : stats.stages) total += s.seconds;
    std::string table = fmt::format("{:<16} {:>10} {:>7} {:>10} {:>14} {:>10}\n", "stage", "seconds", "share",
                                    "launches", "items", "ns/item");
    for (const StageStats& s : stats.stages)
        table += fmt::format("{:<16} {:>10.4f} {:>6.1f}% {:>10} {:>14} {:>10.2f}\n", s.name, s.seconds,
                             total > 0 ? 100 * s.seconds / total : 0, s.launches, s.items,
                             s.items ? 1e9 * s.seconds / double(s.items) : 0);
    table += fmt::format("{:<16} {:>10.4f}\n{:<16} {:>10.4f}\n", "all stages", total, "render", stats.render_seconds);
    return table;
}

}  // namespace ambilux
