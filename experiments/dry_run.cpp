#include "experiments/dry_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "core/progress.h"
#include "experiments/drive.h"
#include "experiments/prepare.h"
#include "experiments/reference_store.h"
#include "experiments/results.h"
#include "experiments/work_estimate.h"

namespace ambilux {
namespace {

constexpr double kPilotSeconds = 0.25;

struct Pilot {
    double samples = 0, seconds = 0;
    uint64_t memory = 0;
};

/// Renders for a moment. The first sample warms up caches and is not measured, unless it takes long enough alone.
Pilot measure(const Scene& scene, const RenderSettings& settings, const volatile bool* interrupt, const Hooks& hooks) {
    const auto renderer = hooks.make_renderer(scene, settings);
    Pilot pilot;
    RenderPosition p = drive(*renderer, {}, {1, 0}, interrupt);
    if (!p.interrupted && p.seconds < kPilotSeconds) {
        const RenderPosition first{p.samples, 0, false};
        p = drive(*renderer, first, {0, kPilotSeconds}, interrupt);
        p.samples -= first.samples;
    }
    if (p.interrupted) throw Error(ExitCode::interrupted, "interrupted: nothing was written");
    pilot.samples = double(p.samples);
    pilot.seconds = p.seconds;
    const RenderStats stats = renderer->stats();
    pilot.memory = std::max(stats.memory_bytes, stats.memory_bytes_predicted);
    return pilot;
}

std::string settings_text(const RunEntry& run) {
    std::string text;
    for (const auto& [key, value] : run.settings) text += (text.empty() ? "" : " ") + key + "=" + value;
    if (run.techniques) text += fmt::format(" techniques={}", run.techniques);
    return text;
}

std::string bytes_text(double bytes) {
    return bytes >= 1073741824.0 ? fmt::format("{:.1f} GiB", bytes / 1073741824.0)
                                 : fmt::format("{:.0f} MiB", std::max(1.0, std::ceil(bytes / 1048576.0)));
}

std::string about(double seconds) {
    return seconds > 0 && seconds < 0.05 ? "under 0.1 s" : "about " + format_duration(seconds);
}

/// Bytes of the images of single strategies of one render, uncompressed: weighted and raw, three floats, for every
/// (s,t) with s+t from 2 to depth+1 and t >= 1.
double technique_bytes(int depth, double pixels) {
    double strategies = 0;
    for (int vertices = 2; vertices <= depth + 1; ++vertices) strategies += vertices;
    return strategies * 2 * 12 * pixels;
}

}  // namespace

std::string describe_plan(const ExperimentRequest& request, const Hooks& hooks) {
    const Prepared prepared = prepare_experiment(request.config, request.reduced, hooks);
    const ExperimentConfig& config = prepared.config;
    const size_t checkpoints = config.checkpoints().size(), seeds = config.seeds.size();
    namespace fs = std::filesystem;

    std::vector<std::string> lines;
    if (!request.output.empty() && fs::exists(request.output + "/config.resolved.toml")) {
        check_same_experiment(request.output, config);
        lines = read_results(request.output + "/runs.csv");
    }
    const std::string references = !request.references.empty() ? request.references
                                   : request.output.empty()    ? ""
                                                               : request.output + "/references";

    WorkEstimate work;
    std::string scene_rows, run_rows;
    const auto kind = [](const LoadedEntry& scene, const RunEntry* run) {
        return scene.entry->name + "/" + (run ? run->name : "");
    };
    double disk = 0;
    uint64_t memory = 0;
    std::string memory_of;
    const auto remember = [&](uint64_t bytes, const std::string& what) {
        if (bytes <= memory) return;
        memory = bytes;
        memory_of = what;
    };
    double reference_seconds = 0, render_seconds = 0;
    for (const LoadedEntry& scene : prepared.scenes) {
        const double pixels = double(scene.pixels());
        const ReferencePlace place =
            find_reference(references, config, *scene.entry, scene.scene, scene.max_depth, hooks);
        const uint64_t wanted = scene.entry->reference.spp;
        std::string state = fmt::format("cached with {} spp", place.cached);
        if (place.cached < wanted) {
            const Pilot pilot = measure(scene.scene, place.settings, request.interrupt, hooks);
            remember(pilot.memory, "the reference of " + scene.entry->name);
            work.measured(kind(scene, nullptr), pilot.samples * pixels, pilot.seconds);
            work.plan(kind(scene, nullptr), 1, {double(wanted - place.cached) * pixels, 0});
            const double seconds = work.seconds_left(kind(scene, nullptr));
            reference_seconds += seconds;
            disk += pixels * 24;
            state = place.cached ? fmt::format("to extend from {} spp, {}", place.cached, about(seconds))
                                 : "to make, " + about(seconds);
        }
        const std::string making = place.settings_text.empty() ? "path" : place.settings_text;
        scene_rows +=
            fmt::format("  {:<28} {:>11} {:>6}  {} spp by {}: {}\n", scene.entry->name,
                        fmt::format("{}x{}", scene.scene.sensor.crop_width, scene.scene.sensor.crop_height),
                        scene.max_depth < 0 ? "none" : std::to_string(scene.max_depth), wanted, making, state);
    }
    std::map<std::string, std::string> times;
    for (const LoadedEntry& scene : prepared.scenes)
        for (const RunEntry& run : config.runs) {
            const double pixels = double(scene.pixels());
            size_t done = 0;
            for (const uint64_t seed : config.seeds) {
                const std::string prefix = result_prefix(scene.entry->name, run.name, seed);
                done += size_t(std::count_if(lines.begin(), lines.end(), [&](const std::string& line) {
                            return line.starts_with(prefix);
                        })) == checkpoints;
            }
            const std::string k = kind(scene, &run);
            if (done == seeds) {
                times[run.name] += fmt::format("    {:<28} done\n", scene.entry->name);
                continue;
            }
            // Without sample budgets the time is known; the renderer still says how much memory it takes.
            const RenderSettings settings = settings_for(config, scene, run, config.seeds[0], hooks);
            if (!config.spp.empty()) {
                const Pilot pilot = measure(scene.scene, settings, request.interrupt, hooks);
                work.measured(k, pilot.samples * pixels, pilot.seconds);
                remember(pilot.memory, fmt::format("run {} on {}", run.name, scene.entry->name));
            } else {
                const RenderStats stats = hooks.make_renderer(scene.scene, settings)->stats();
                remember(std::max(stats.memory_bytes, stats.memory_bytes_predicted),
                         fmt::format("run {} on {}", run.name, scene.entry->name));
            }
            const double samples = config.spp.empty() ? 0 : double(config.spp.back()) * pixels,
                         seconds = config.seconds.empty() ? 0 : config.seconds.back();
            work.plan(k, double(seeds - done), {samples, seconds});
            const double left = work.seconds_left(k);
            render_seconds += left;
            disk +=
                double(seeds - done) * (pixels * 15 + (run.techniques ? technique_bytes(run.techniques, pixels) : 0));
            times[run.name] +=
                fmt::format("    {:<28} {} per seed\n", scene.entry->name, about(left / double(seeds - done)));
        }
    for (const RunEntry& run : config.runs)
        run_rows += fmt::format("  {}: {}\n{}", run.name, settings_text(run), times[run.name]);

    std::string budgets;
    if (!config.spp.empty()) budgets += fmt::format("  {} at {} spp\n", config.spp.size(), fmt::join(config.spp, ", "));
    if (!config.seconds.empty())
        budgets += fmt::format("  {} at {} s\n", config.seconds.size(), fmt::join(config.seconds, ", "));
    const size_t renders = prepared.scenes.size() * config.runs.size() * seeds;
    std::string text = fmt::format(
        "experiment {}: {}\n{} scenes x {} runs x {} seeds = {} renders; {} checkpoints each, {} rows", config.name,
        config.file, prepared.scenes.size(), config.runs.size(), seeds, renders, checkpoints, renders * checkpoints);
    if (!lines.empty()) text += fmt::format(", {} of them made already", lines.size());
    text += "\n\ncheckpoints of every render\n" + budgets;
    if (!config.ablation_default.empty())
        text += "\nablation: every run is compared with " + config.ablation_default + "\n";
    text +=
        fmt::format("\n  {:<28} {:>11} {:>6}  reference\n{}\nruns\n{}", "scene", "size", "depth", scene_rows, run_rows);
    text += fmt::format("\ndevice  {}\n", fmt::join(prepared.devices, ", "));
    text += fmt::format("time    {}: references {}, renders {}\n", about(reference_seconds + render_seconds),
                        format_duration(reference_seconds), format_duration(render_seconds));
    if (memory) text += fmt::format("memory  {} for the largest render ({})\n", bytes_text(double(memory)), memory_of);
    text += fmt::format("disk    up to {}\n", bytes_text(disk));
    text += "These are estimates. ";
    if (!config.spp.empty() || reference_seconds > 0)
        text +=
            fmt::format("What a sample costs was measured for {} s per scene and run, on this machine as it is now. ",
                        kPilotSeconds);
    text += "Loading, error figures and files come on top. Nothing was written.\n";
    return text;
}

}  // namespace ambilux
