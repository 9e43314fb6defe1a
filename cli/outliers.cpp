#include "cli/outliers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "integrators/registry.h"
#include "render/replay/print.h"

namespace ambilux {
namespace {

/// Invalid values that are listed of every stage.
constexpr uint32_t kInvalidPerStage = 3;

/// `ambilux trace SCENE ...` with all options that the sample depends on.
std::string trace_command(const SceneOptions& o, const Scene& scene, const RenderSettings& used,
                          const std::string& what) {
    std::string line = "ambilux trace " + o.path + what;
    if (!o.size.empty()) line += " --size " + o.size;
    if (o.lenient) line += " --lenient";
    for (const std::string& p : o.parameters) line += fmt::format(" -D '{}'", p);
    if (o.light_picking != "power") line += " --light-picking " + o.light_picking;
    const RenderSettings plain = RenderOptions{}.settings(scene);
    const std::vector<std::string> options = {"integrator", "variant", "backend", "seed"};
    line += fmt::format(" -i {} --variant {} --backend {} --seed {}", used.integrator, used.variant,
                        setting_text(used, "backend"), used.seed);
    const bool cuda = used.backend == Backend::cuda;
    const Variant& variant = variant_of(used);
    const auto add = [&](const Setting& s) {
        const bool option = std::find(options.begin(), options.end(), s.what.key) != options.end();
        // The order of a queue is none unless asked for otherwise; the renderer has put that in the place of auto.
        const bool unordered = s.what.key == "ordering" && s.text(used) == "none";
        if (!option && !unordered && s.applies_to(variant.traits, cuda) && s.text(used) != s.text(plain))
            line += fmt::format(" --set {}={}", s.what.key, s.text(used));
    };
    for (const Setting& s : general_settings()) add(s);
    for (const Setting& s : variant.own) add(s);
    return line;
}

std::string ends_of(const ReplayCandidate& c) {
    if (c.light_subpath == kNone) return fmt::format("eye vertex {}", c.eye_depth);
    const std::string light = fmt::format("light subpath {} vertex {}", c.light_subpath, c.light_depth);
    return c.eye_depth ? fmt::format("eye vertex {}, {}", c.eye_depth, light) : light;
}

nlohmann::json contribution_json(const ReplayCandidate& c) {
    if (c.fate != ReplayFate::arrived && c.fate != ReplayFate::invalid) return nullptr;
    if (c.kind[0] == '\0') return nullptr;
    return {{"kind", c.kind},
            {"strategy", strategy_text(c.strategy)},
            {"eye_depth", c.eye_depth},
            {"light_depth", c.light_depth},
            {"light_subpath", c.light_subpath == kNone ? nlohmann::json(nullptr) : nlohmann::json(c.light_subpath)},
            {"contribution", {c.contribution.x, c.contribution.y, c.contribution.z}}};
}

void report_outlier(const Outlier& o, const std::string& command, std::string& text, nlohmann::json& list) {
    const WatchedPixel& p = o.pixel;
    text += fmt::format("pixel {},{} sample {}: ({:.6g}, {:.6g}, {:.6g}), {:.6g} above the mean of its other samples\n",
                        p.x, p.y, p.sample, p.value[0], p.value[1], p.value[2], p.excess);
    if (o.largest.fate == ReplayFate::arrived)
        text += fmt::format("  most of it by {}, {}, {}: ({:.6g}, {:.6g}, {:.6g})\n", strategy_text(o.largest.strategy),
                            o.largest.kind, ends_of(o.largest), o.largest.contribution.x, o.largest.contribution.y,
                            o.largest.contribution.z);
    bool differs = false;
    for (int c = 0; c < 3; ++c) differs |= std::abs(o.replayed[c] - p.value[c]) > 1e-3 * std::abs(p.value[c]) + 1e-9;
    if (differs)
        text += fmt::format("  the replay on the CPU brings ({:.6g}, {:.6g}, {:.6g}){}\n", o.replayed[0], o.replayed[1],
                            o.replayed[2],
                            o.complete ? ": paths parted by rounding" : ", without connections from the cache");
    text += fmt::format("  {}\n", command);
    list.push_back({{"pixel", {p.x, p.y}},
                    {"sample", p.sample},
                    {"value", {p.value[0], p.value[1], p.value[2]}},
                    {"excess", p.excess},
                    {"replayed", {o.replayed[0], o.replayed[1], o.replayed[2]}},
                    {"complete", o.complete},
                    {"largest", contribution_json(o.largest)},
                    {"command", command}});
}

void report_invalid(const InvalidRecord& r, const std::string& command, std::string& text, nlohmann::json& list) {
    const bool eye = r.light_subpath == kNone;
    const std::string where =
        eye ? fmt::format("pixel {},{}", r.x, r.y) : fmt::format("light subpath {}", r.light_subpath);
    text += fmt::format("stage {} dropped a value of {} sample {}{}\n  {}\n", r.stage, where, r.sample,
                        r.candidate.kind[0] ? fmt::format(", {}, {}, {}", strategy_text(r.candidate.strategy),
                                                          r.candidate.kind, ends_of(r.candidate))
                                            : ", a ray or throughput",
                        command);
    list.push_back({{"stage", r.stage},
                    {"pixel", eye ? nlohmann::json{r.x, r.y} : nlohmann::json(nullptr)},
                    {"light_subpath", eye ? nlohmann::json(nullptr) : nlohmann::json(r.light_subpath)},
                    {"sample", r.sample},
                    {"found", contribution_json(r.candidate)},
                    {"command", command}});
}

}  // namespace

void report_outliers(const SampleWatch& watch, const SceneOptions& options, const Scene& scene,
                     const RenderSettings& used, uint32_t count, bool quiet, nlohmann::json& statistics) {
    SharedAccels accels(scene);
    const std::unique_ptr<Replay> replay = make_replay(scene, used, accels);
    std::string text;
    nlohmann::json outliers = nlohmann::json::array(), invalid = nlohmann::json::array();
    for (const Outlier& o : find_outliers(watch, *replay, count)) {
        const std::string what = fmt::format(" --pixel {},{} --sample {}", o.pixel.x, o.pixel.y, o.pixel.sample);
        report_outlier(o, trace_command(options, scene, used, what), text, outliers);
    }
    for (const InvalidRecord& r : find_invalid(watch, *replay, scene, kInvalidPerStage)) {
        const std::string what = r.light_subpath == kNone ? fmt::format(" --pixel {},{}", r.x, r.y)
                                                          : fmt::format(" --light-subpath {}", r.light_subpath);
        report_invalid(r, trace_command(options, scene, used, fmt::format("{} --sample {}", what, r.sample)), text,
                       invalid);
    }
    if (!watch.invalid().empty() && invalid.empty())
        text += fmt::format(
            "stages dropped invalid values in sample {} and perhaps later; the replay on the CPU has "
            "none there\n",
            watch.invalid()[0].sample);
    if (!quiet) std::cout << text << std::flush;
    statistics["outliers"] = outliers;
    statistics["invalid_values"] = invalid;
}

}  // namespace ambilux
