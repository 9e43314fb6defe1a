#include "cli/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iostream>

#include "core/flag.h"
#include "core/log.h"
#include "integrators/registry.h"
#include "render/replay/print.h"
#include "session/replays.h"

namespace ambilux {
namespace {

/// Invalid values that are listed of every stage; with --outliers.
constexpr uint32_t kInvalidPerStage = 1, kInvalidPerStageAsked = 3;

/// A word as a shell reads it.
std::string shell_word(const std::string& text) {
    const auto plain = [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) ||
               std::string_view("_-./=,:+@%").find(c) != std::string_view::npos;
    };
    if (!text.empty() && std::all_of(text.begin(), text.end(), plain)) return text;
    std::string quoted = "'";
    for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
    return quoted + "'";
}

/// `ambilux trace SCENE ...` with all options that the sample depends on.
std::string trace_command(const FinishedRender& render, const std::string& what) {
    const SceneOptions& o = render.options;
    const RenderSettings& used = render.used;
    std::string line = "ambilux trace " + shell_word(o.path) + what;
    if (!o.size.empty()) line += " --size " + o.size;
    if (o.lenient) line += " --lenient";
    for (const std::string& p : o.parameters) line += " -D " + shell_word(p);
    if (o.light_picking != "power") line += " --light-picking " + o.light_picking;
    const RenderSettings plain = RenderOptions{}.settings(render.scene);
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
            line += " --set " + shell_word(fmt::format("{}={}", s.what.key, s.text(used)));
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

void report_outlier(const Outlier& o, const std::string& command, std::string& text, nlohmann::json& list) {
    const WatchedPixel& p = o.pixel;
    text += fmt::format("pixel {},{} sample {}: ({:.6g}, {:.6g}, {:.6g}), {:.6g} above the mean of its other samples\n",
                        p.x, p.y, p.sample, p.value[0], p.value[1], p.value[2], p.excess);
    if (o.largest.fate == ReplayFate::arrived)
        text += fmt::format("  largest contribution: {}, {}, {}: ({:.6g}, {:.6g}, {:.6g})\n",
                            strategy_text({o.largest.strategy, o.largest.merged}), o.largest.kind, ends_of(o.largest),
                            o.largest.contribution.x, o.largest.contribution.y, o.largest.contribution.z);
    bool differs = false;
    for (int c = 0; c < 3; ++c) differs |= std::abs(o.replayed[c] - p.value[c]) > 1e-3 * std::abs(p.value[c]) + 1e-9;
    if (differs)
        text += fmt::format("  the replay on the CPU gives ({:.6g}, {:.6g}, {:.6g}){}\n", o.replayed[0], o.replayed[1],
                            o.replayed[2],
                            o.complete ? ": the paths differ; trace with --compare shows where"
                                       : ", without connections from the cache");
    text += fmt::format("  {}\n", command);
    list.push_back(outlier_json(o));
    list.back()["command"] = command;
}

void report_invalid(const InvalidRecord& r, const std::string& command, nlohmann::json& list) {
    const bool eye = r.light_subpath == kNone;
    const std::string where =
        eye ? fmt::format("pixel {},{}", r.x, r.y) : fmt::format("light subpath {}", r.light_subpath);
    log_warning(fmt::format("stage {} dropped a value ({}) of {} sample {}{}; to replay it:\n  {}", r.drop.stage,
                            r.drop.what, where, r.sample,
                            r.candidate.kind[0]
                                ? fmt::format(", {}, {}, {}", strategy_text({r.candidate.strategy, r.candidate.merged}),
                                              r.candidate.kind, ends_of(r.candidate))
                            : eye ? ", a ray, a throughput or the sum"
                                  : ", a ray or a throughput",
                            command));
    list.push_back({{"stage", r.drop.stage},
                    {"what", r.drop.what},
                    {"pixel", eye ? nlohmann::json{r.x, r.y} : nlohmann::json(nullptr)},
                    {"light_subpath", eye ? nlohmann::json(nullptr) : nlohmann::json(r.light_subpath)},
                    {"sample", r.sample},
                    {"found", contribution_json(r.candidate)},
                    {"command", command}});
}

nlohmann::json report_invalid_values(const FinishedRender& render, const Replay& replay, uint32_t per_stage,
                                     const volatile bool* interrupt) {
    nlohmann::json list = nlohmann::json::array();
    std::vector<std::string> missing;
    for (const auto& [stage, counts] : render.watch.by_stage())
        if (counts.total()) missing.push_back(stage);
    if (missing.empty()) return list;
    log_info("looking for the values that stages dropped, by replaying samples on the CPU (Ctrl-C ends the search)");
    const FoundInvalid search = find_invalid(render.watch, replay, render.scene, per_stage, interrupt);
    for (const InvalidRecord& r : search.found) {
        const std::string what = r.light_subpath == kNone ? fmt::format(" --pixel {},{}", r.x, r.y)
                                                          : fmt::format(" --light-subpath {}", r.light_subpath);
        report_invalid(r, trace_command(render, fmt::format("{} --sample {}", what, r.sample)), list);
        missing.erase(std::remove(missing.begin(), missing.end(), r.drop.stage), missing.end());
    }
    if (is_set(interrupt)) return list;
    for (const std::string& stage : missing)
        log_warning(fmt::format(
            "the replay on the CPU did not find the values that stage {} dropped, in the first samples that "
            "had invalid ones: {} (docs/replay.md)",
            stage, fmt::join(search.samples, ", ")));
    return list;
}

}  // namespace

nlohmann::json report_findings(const FinishedRender& render, uint32_t count, bool quiet,
                               const volatile bool* interrupt) {
    SharedAccels accels(render.scene);
    const std::unique_ptr<Replay> replay = make_replay(render.scene, render.used, accels);
    std::string text;
    nlohmann::json json = nlohmann::json::object();
    if (render.samples) {
        nlohmann::json& outliers = json["outliers"] = nlohmann::json::array();
        for (const Outlier& o : find_outliers(*render.samples, *replay, count)) {
            const std::string what = fmt::format(" --pixel {},{} --sample {}", o.pixel.x, o.pixel.y, o.pixel.sample);
            report_outlier(o, trace_command(render, what), text, outliers);
        }
        if (!quiet) std::cout << text << std::flush;
    }
    json["invalid_values"] =
        report_invalid_values(render, *replay, render.samples ? kInvalidPerStageAsked : kInvalidPerStage, interrupt);
    return json;
}

}  // namespace ambilux
