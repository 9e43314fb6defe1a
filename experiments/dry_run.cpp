#include "experiments/dry_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "core/progress.h"
#include "experiments/experiment_folder.h"
#include "experiments/prepare.h"
#include "experiments/reference_store.h"
#include "experiments/render_task.h"
#include "experiments/results.h"
#include "experiments/work_estimate.h"
#include "session/drive.h"

namespace ambilux {
namespace {

constexpr double kPilotSeconds = 0.25;

struct Pilot {
    double samples = 0, seconds = 0;
    uint64_t memory = 0;
};

/// Renders for a moment. The first iteration warms up caches and is not measured, unless it takes long enough alone.
Pilot measure(const Scene& scene, const RenderSettings& settings, const volatile bool* interrupt, const Hooks& hooks) {
    const auto renderer = hooks.make_renderer(scene, settings);
    Pilot pilot;
    RenderPosition p = drive(*renderer, {}, {renderer->iteration_samples(), 0}, interrupt);
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
    std::string text = run.renderer;
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

/// How many of an experiment's renders of one run on one scene have all of their rows.
size_t finished_renders(const ExperimentConfig& config, const LoadedEntry& scene, const RunEntry& run,
                        const std::vector<std::string>& lines) {
    return size_t(std::count_if(config.seeds.begin(), config.seeds.end(), [&](uint64_t seed) {
        const std::string prefix = result_prefix(scene.entry->name, run.name, seed);
        const auto ours = [&](const std::string& line) { return line.starts_with(prefix); };
        return size_t(std::count_if(lines.begin(), lines.end(), ours)) == config.checkpoints().size();
    }));
}

/// Gathers what each reference and each render would cost, then describes it.
class DryRun {
public:
    DryRun(const ExperimentRequest& request, const Hooks& hooks)
        : request_(request), hooks_(hooks), prepared_(prepare_experiment(request.config, request.reduced, hooks)),
          config_(prepared_.config) {
        if (!request.output.empty() && std::filesystem::exists(request.output + "/config.resolved.toml")) {
            check_same_experiment(request.output, config_);
            lines_ = read_results(request.output + "/runs.csv");
        }
    }

    std::string describe() {
        for (const LoadedEntry& scene : prepared_.scenes) add_reference(scene);
        for (const LoadedEntry& scene : prepared_.scenes)
            for (const RunEntry& run : config_.runs) add_renders(scene, run);
        return size_text() + tables_text() + cost_text();
    }

private:
    void remember(uint64_t bytes, const std::string& what) {
        if (bytes <= memory_) return;
        memory_ = bytes;
        memory_of_ = what;
    }

    std::string references() const {
        if (!request_.references.empty() || request_.output.empty()) return request_.references;
        return request_.output + "/references";
    }

    void add_reference(const LoadedEntry& scene) {
        const double pixels = double(scene.pixels());
        const ReferencePlace place =
            find_reference(references(), config_, *scene.entry, scene.scene, scene.max_depth, hooks_);
        const uint64_t wanted = scene.entry->reference.spp;
        std::string state = fmt::format("cached with {} spp", place.cached);
        if (place.cached < wanted) {
            const std::string work = work_kind(scene, nullptr);
            const Pilot pilot = measure(scene.scene, place.settings, request_.interrupt, hooks_);
            remember(pilot.memory, "the reference of " + scene.entry->name);
            work_.measured(work, pilot.samples * pixels, pilot.seconds);
            work_.plan(work, 1, {double(wanted - place.cached) * pixels, 0});
            const double seconds = work_.seconds_left(work);
            reference_seconds_ += seconds;
            disk_ += pixels * 24;
            state = place.cached ? fmt::format("to extend from {} spp, {}", place.cached, about(seconds))
                                 : "to make, " + about(seconds);
        }
        const std::string making = place.settings_text.empty() ? place.settings.integrator : place.settings_text;
        scene_rows_ +=
            fmt::format("  {:<28} {:>11} {:>6}  {} spp by {}: {}\n", scene.entry->name,
                        fmt::format("{}x{}", scene.scene.sensor.crop_width, scene.scene.sensor.crop_height),
                        scene.max_depth < 0 ? "none" : std::to_string(scene.max_depth), wanted, making, state);
    }

    /// All seeds of a run on a scene.
    void add_renders(const LoadedEntry& scene, const RunEntry& run) {
        const double pixels = double(scene.pixels());
        const size_t left = config_.seeds.size() - finished_renders(config_, scene, run, lines_);
        if (left == 0) {
            times_[run.name] += fmt::format("    {:<28} done\n", scene.entry->name);
            return;
        }
        measure_render(scene, run);
        const double samples = config_.spp.empty() ? 0 : double(config_.spp.back()) * pixels,
                     seconds = config_.seconds.empty() ? 0 : config_.seconds.back();
        const std::string work = work_kind(scene, &run);
        work_.plan(work, double(left), {samples, seconds});
        const double seconds_left = work_.seconds_left(work);
        render_seconds_ += seconds_left;
        disk_ += double(left) * (pixels * 15 + (run.techniques ? technique_bytes(run.techniques, pixels) : 0));
        times_[run.name] +=
            fmt::format("    {:<28} {} per seed\n", scene.entry->name, about(seconds_left / double(left)));
    }

    /// Without sample budgets the time is known; the renderer still says how much memory it takes.
    void measure_render(const LoadedEntry& scene, const RunEntry& run) {
        if (!run.renderer.empty()) return;  // a peer costs what the others do, for want of better
        const RenderSettings settings = settings_for(config_, scene, run, config_.seeds[0], hooks_);
        const std::string what = fmt::format("run {} on {}", run.name, scene.entry->name);
        if (config_.spp.empty()) {
            const RenderStats stats = hooks_.make_renderer(scene.scene, settings)->stats();
            remember(std::max(stats.memory_bytes, stats.memory_bytes_predicted), what);
            return;
        }
        const Pilot pilot = measure(scene.scene, settings, request_.interrupt, hooks_);
        work_.measured(work_kind(scene, &run), pilot.samples * double(scene.pixels()), pilot.seconds);
        remember(pilot.memory, what);
    }

    std::string size_text() const {
        const size_t scenes = prepared_.scenes.size(), runs = config_.runs.size(), seeds = config_.seeds.size(),
                     checkpoints = config_.checkpoints().size(), renders = scenes * runs * seeds;
        std::string text =
            fmt::format("experiment {}: {}\n{} scenes x {} runs x {} seeds = {} renders; {} checkpoints each, {} rows",
                        config_.name, config_.file, scenes, runs, seeds, renders, checkpoints, renders * checkpoints);
        if (!lines_.empty()) text += fmt::format(", {} of them made already", lines_.size());
        text += "\n\ncheckpoints of every render\n";
        if (!config_.spp.empty())
            text += fmt::format("  {} at {} spp\n", config_.spp.size(), fmt::join(config_.spp, ", "));
        if (!config_.seconds.empty())
            text += fmt::format("  {} at {} s\n", config_.seconds.size(), fmt::join(config_.seconds, ", "));
        if (config_.repeats)
            text += fmt::format("\na disturbed render is repeated, at most {} time{}\n", config_.repeats,
                                config_.repeats > 1 ? "s" : "");
        if (!config_.ablation_default.empty())
            text += "\nablation: every run is compared with " + config_.ablation_default + "\n";
        return text;
    }

    std::string tables_text() {
        std::string text =
            fmt::format("\n  {:<28} {:>11} {:>6}  reference\n{}\nruns\n", "scene", "size", "depth", scene_rows_);
        for (const RunEntry& run : config_.runs)
            text += fmt::format("  {}: {}\n{}", run.name, settings_text(run), times_[run.name]);
        return text;
    }

    std::string cost_text() const {
        std::string text = fmt::format("\ndevice  {}\n", fmt::join(prepared_.devices, ", "));
        text += fmt::format("time    {}: references {}, renders {}\n", about(reference_seconds_ + render_seconds_),
                            format_duration(reference_seconds_), format_duration(render_seconds_));
        if (memory_)
            text += fmt::format("memory  {} for the largest render ({})\n", bytes_text(double(memory_)), memory_of_);
        text += fmt::format("disk    up to {}\n", bytes_text(disk_));
        text += "These are estimates. ";
        if (!config_.spp.empty() || reference_seconds_ > 0)
            text += fmt::format(
                "What a sample costs was measured for {} s per scene and run, on this machine as it is now. ",
                kPilotSeconds);
        return text + "Loading, error figures and files come on top. Nothing was written.\n";
    }

    const ExperimentRequest& request_;
    const Hooks& hooks_;
    const Prepared prepared_;
    const ExperimentConfig& config_;
    std::vector<std::string> lines_;  ///< rows that are there already
    WorkEstimate work_;
    std::string scene_rows_;
    std::map<std::string, std::string> times_;  ///< by run
    uint64_t memory_ = 0;
    std::string memory_of_;
    double disk_ = 0, reference_seconds_ = 0, render_seconds_ = 0;
};

}  // namespace

std::string describe_plan(const ExperimentRequest& request, const Hooks& hooks) {
    return DryRun(request, hooks).describe();
}

}  // namespace ambilux
