#include "session/statistics.h"

#include <fmt/format.h>

#include <cmath>

#include "core/sha256.h"
#include "core/version.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

nlohmann::json invalid_json(const InvalidCounts& invalid) {
    return {
        {"nan", invalid.nan}, {"inf", invalid.inf}, {"negative", invalid.negative}, {"underflow", invalid.underflow}};
}

nlohmann::json to_json(const SettingValue& value) {
    return std::visit([](const auto& v) { return nlohmann::json(v); }, value);
}

/// Null where nothing was chosen.
nlohmann::json selection_json(const SelectionStats& selection) {
    if (selection.name.empty()) return nullptr;
    nlohmann::json candidates = nlohmann::json::array(), settings = nlohmann::json::object();
    for (const SelectionStats::Candidate& c : selection.candidates)
        candidates.push_back(
            {{"name", c.name},
             {"settings", c.settings},
             {"variance", std::isfinite(c.variance) ? nlohmann::json(c.variance) : nlohmann::json(nullptr)},
             {"work", c.work},
             {"seconds_per_sample", c.seconds > 0 ? nlohmann::json(c.seconds) : nlohmann::json(nullptr)},
             {"efficiency", c.efficiency},
             {"excluded", c.excluded.empty() ? nlohmann::json(nullptr) : nlohmann::json(c.excluded)}});
    for (const auto& [key, value] : selection.settings) settings[key] = value;
    return {{"name", selection.name},
            {"settings", settings},
            {"seconds", selection.seconds},
            {"pilot_samples", selection.pilot_samples},
            {"expected_samples", selection.expected_samples},
            {"candidates", candidates}};
}

}  // namespace

std::string selection_line(const SelectionStats& selection) {
    std::string line;
    for (const auto& [key, value] : selection.settings) line += " --set " + key + "=" + value;
    return line.empty() ? line : line.substr(1);
}

std::string scene_hash(const Scene& scene) { return to_hex(scene.content_hash); }

RenderSettings used_settings(const RenderSettings& asked, const RenderStats& stats) {
    RenderSettings used = asked;
    if (!stats.selection.name.empty()) used.automatic = false;
    for (const auto& [key, value] : stats.selection.settings) apply_setting(used, key, value);
    // What was left open is what the renderer made of it.
    for (const Setting& s : general_settings())
        if (s.text(used) == "auto") s.what.set(used, s.text(stats.settings));
    return used;
}

std::string method_text(const RenderSettings& used) {
    const Variant* const variant = find_variant(used.integrator, used.variant);
    const VariantTraits traits = variant ? variant->traits : VariantTraits{};
    RenderSettings plain;
    plain.integrator = used.integrator;
    plain.variant = used.variant;
    std::string text = used.integrator + (used.variant.empty() ? "" : " " + used.variant);
    const auto add = [&](const Setting& s, bool always) {
        if (s.place != InExperiment::experiment && s.in_images && s.what.key != "integrator" &&
            s.what.key != "variant" && s.applies_to(traits, used.backend == Backend::cuda) &&
            (always || s.text(used) != s.text(plain)))
            text += " " + s.what.key + "=" + s.text(used);
    };
    // How many connections a vertex makes is part of a method's name in the literature, its default included.
    for (const Setting& s : general_settings()) add(s, s.place == InExperiment::run_key || s.what.key == "connections");
    if (variant)
        for (const Setting& s : variant->own) add(s, true);
    return text;
}

nlohmann::json settings_json(const RenderSettings& settings) {
    nlohmann::json json = nlohmann::json::object();
    for (const Setting& s : general_settings())
        json[s.what.key] = to_json(s.shown ? s.shown(settings) : s.what.get(settings));
    if (const Variant* v = find_variant(settings.integrator, settings.variant))
        for (const Setting& s : v->own) json[s.what.key] = to_json(s.what.get(settings));
    return json;
}

/// How next event estimation picks emitters: power, uniform or tree.
static std::string light_picking_text(const Scene& scene, const RenderSettings& used) {
    if (used.light_picking == LightPicks::tree) return "tree";
    return scene.light_picking == "tree" ? "power" : scene.light_picking;
}

/// What tells the error of a mean: the scatter of samples, or renders of several seeds alone, where samples of a render
/// depend on each other.
static const char* errors_from(const RenderSettings& used) {
    return used.sampler == Sampler::sobol ? "seeds" : "samples";
}

nlohmann::json seconds_json(const RenderStats& stats, double load_seconds) {
    return {{"load", load_seconds},
            {"device", stats.device_seconds},
            {"build", stats.build_seconds},
            {"structure", stats.structure_seconds},
            {"kernels", stats.kernel_seconds},
            {"render", stats.render_seconds}};
}

nlohmann::json stats_json(const Scene& scene, const RenderSettings& asked, const RenderStats& stats,
                          double load_seconds) {
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
    const RenderSettings used = used_settings(asked, stats);
    nlohmann::json json = settings_json(used);
    json.update({{"asked", settings_json(asked)},
                 {"method", method_text(used)},
                 {"bias", bias_text(used)},
                 {"errors_from", errors_from(used)},
                 {"scene", scene.path},
                 {"scene_hash", scene_hash(scene)},
                 {"warnings", scene.warnings},
                 {"backend", stats.backend},
                 {"device", stats.device},
                 {"accel", stats.accel},
                 {"size", {scene.sensor.crop_width, scene.sensor.crop_height}},
                 {"light_picking", light_picking_text(scene, used)},
                 {"spp", stats.samples},
                 {"wave_paths", stats.wave_paths},
                 {"seconds", seconds_json(stats, load_seconds)},
                 {"rays", {{"extend", stats.rays_extend}, {"occlude", stats.rays_occlude}}},
                 {"rays_per_second", stats.render_seconds > 0 ? rays / stats.render_seconds : 0.0},
                 {"stages", stages},
                 {"queues", queues},
                 {"invalid", invalid},
                 {"memory_bytes", stats.memory_bytes},
                 {"memory_bytes_predicted", stats.memory_bytes_predicted},
                 {"memory_bytes_peak", stats.memory_bytes_peak},
                 {"features", stats.features},
                 {"skipped", stats.skipped},
                 {"selection", selection_json(stats.selection)},
                 {"version", version()},
                 {"git_revision", git_revision()}});
    return json;
}

Attributes image_attributes(const Scene& scene, const RenderSettings& asked, const RenderStats& stats) {
    Attributes attributes = {{"scene", scene.path},
                             {"scene_hash", scene_hash(scene)},
                             {"light_picking", light_picking_text(scene, stats.settings)},
                             {"spp", stats.samples},
                             {"wave_paths", uint64_t(stats.wave_paths)},
                             {"backend", stats.backend},
                             {"device", stats.device},
                             {"seconds", stats.render_seconds},
                             {"memory_bytes", stats.memory_bytes_predicted},
                             {"memory_bytes_peak", stats.memory_bytes_peak},
                             {"software", fmt::format("ambilux {}", version())},
                             {"git_revision", git_revision()}};
    const RenderSettings settings = used_settings(asked, stats);
    attributes["method"] = method_text(settings);
    attributes["errors_from"] = errors_from(settings);
    if (const std::string bias = bias_text(settings); !bias.empty()) attributes["bias"] = bias;
    attributes["settings"] = settings_json(settings).dump();
    std::string kernels;
    for (const std::string& f : stats.features) kernels += (kernels.empty() ? "" : " ") + f;
    attributes["features"] = kernels;
    const Variant* const variant = find_variant(settings.integrator, settings.variant);
    const VariantTraits traits = variant ? variant->traits : VariantTraits{};
    const auto add = [&](const Setting& s) {
        if (s.in_images && s.applies_to(traits, settings.backend == Backend::cuda))
            attributes[s.what.key] = to_json(s.what.get(settings));
    };
    for (const Setting& s : general_settings()) add(s);
    if (variant)
        for (const Setting& s : variant->own) add(s);
    if (!stats.selection.name.empty()) attributes["selection"] = selection_line(stats.selection);
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
