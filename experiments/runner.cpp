#include "experiments/runner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "backends/cuda_device.h"
#include "core/atomic_file.h"
#include "core/log.h"
#include "core/progress.h"
#include "experiments/batches.h"
#include "experiments/disturbed.h"
#include "experiments/drive.h"
#include "experiments/experiment_folder.h"
#include "experiments/gpu_watch.h"
#include "experiments/load.h"
#include "experiments/machine.h"
#include "experiments/peers/peer_runs.h"
#include "experiments/prepare.h"
#include "experiments/reference_store.h"
#include "experiments/render_task.h"
#include "experiments/results.h"
#include "experiments/state.h"
#include "experiments/stats_sum.h"
#include "experiments/technique_files.h"
#include "experiments/work_estimate.h"
#include "film/png_io.h"

namespace ambilux {
namespace {

namespace fs = std::filesystem;

class Experiment {
public:
    Experiment(const ExperimentRequest& request, const Hooks& hooks)
        : request_(request), hooks_(hooks), prepared_(prepare_experiment(request.config, request.reduced, hooks)),
          config_(prepared_.config), checkpoints_(config_.checkpoints()),
          folder_(request.output, request.references, request.resume, prepared_), own_(config_, hooks_),
          peers_(request, config_), nvml_(prepared_.backends.contains("cuda") ? cuda_device_bus_id() : "") {}

    ExitCode run() {
        folder_.add_clocks(folder_.is_resumed() ? "resumed" : "start");
        folder_.write_manifest(false);
        plan();
        Progress progress("experiment " + config_.name);
        progress_ = &progress;
        for (size_t i = 0; i < prepared_.scenes.size(); ++i)
            if (!make_scene_reference(i) || !examine_peers(i)) return stopped();
        folder_.write_manifest(false);
        for (const uint64_t seed : config_.seeds)
            for (const auto& [scene, run] :
                 render_order(prepared_.scenes.size(), config_.runs.size(), seed, config_.random_order))
                if (!render(scene, config_.runs[run], seed)) return stopped();
        if (!repeat_disturbed()) return stopped();
        folder_.remove_states();
        folder_.add_clocks("end");
        folder_.write_manifest(true);
        return ExitCode::done;
    }

private:
    ExitCode stopped() {
        folder_.add_clocks("interrupted");
        folder_.write_manifest(false);
        return ExitCode::interrupted;
    }

    /// Makes disturbed renders again, when all others are done: whoever held the machine may have left it.
    bool repeat_disturbed() {
        for (;;) {
            const std::vector<Disturbed> found = find_disturbed(folder_, prepared_);
            folder_.describe_disturbed(to_json(found, config_));
            const auto next = std::min_element(found.begin(), found.end(), [](const Disturbed& a, const Disturbed& b) {
                return a.attempts.size() < b.attempts.size();
            });
            if (next == found.end() || next->attempts.size() > config_.repeats) return true;
            if (!repeat(*next)) return false;
        }
    }

    bool repeat(const Disturbed& d) {
        const RunEntry& run = config_.runs[d.run];
        RenderTask task = task_of(d.scene, run, d.seed);
        log_info(fmt::format("{} {} is made again: {}", task.scene.entry->name, task.name, d.why));
        task.state.notes["attempts"] = d.attempts;
        // The state comes first: a process that is killed now goes on with it.
        make_folders(folder_.file("state", task.scene, ""));
        write_state(task.state_path, task.state);
        forget(task);
        work_.plan(task.work, 1, work_after(task.scene, {}));
        return render(d.scene, run, d.seed);
    }

    /// What is left of a render that stands at `p`.
    Work work_after(const LoadedEntry& scene, const RenderPosition& p) const {
        const double samples = config_.spp.empty() ? 0 : double(config_.spp.back()) - double(p.samples),
                     seconds = config_.seconds.empty() ? 0 : config_.seconds.back() - p.seconds;
        return {std::max(0.0, samples) * double(scene.pixels()), std::max(0.0, seconds)};
    }

    void plan() {
        for (size_t i = 0; i < prepared_.scenes.size(); ++i) {
            const LoadedEntry& scene = prepared_.scenes[i];
            ReferencePlace& place = references_made_[i].place;
            place = find_reference(folder_.references(), config_, *scene.entry, scene.scene, scene.max_depth, hooks_);
            const uint64_t wanted = scene.entry->reference.spp;
            if (place.cached < wanted)
                work_.plan(work_kind(scene, nullptr), 1, {double(wanted - place.cached) * double(scene.pixels()), 0});
            for (const RunEntry& run : config_.runs)
                work_.plan(work_kind(scene, &run), double(config_.seeds.size()), work_after(scene, {}));
        }
    }

    void show(const std::string& what) { progress_->update(work_.fraction(), what, work_.seconds_left()); }

    bool make_scene_reference(size_t index) {
        const LoadedEntry& scene = prepared_.scenes[index];
        SceneReference& made = references_made_[index];
        const std::string work = work_kind(scene, nullptr);
        // Looked for again: another scene of this experiment may have been the same.
        made.place = find_reference(folder_.references(), config_, *scene.entry, scene.scene, scene.max_depth, hooks_);
        const ReferenceLock lock(made.place.path, request_.interrupt);
        if (!lock.held()) return false;
        ReferenceRequest request;
        request.path = made.place.path;
        request.spp = scene.entry->reference.spp;
        request.settings = made.place.settings;
        request.settings_text = made.place.settings_text;
        request.checkpoint_seconds = request_.reference_checkpoint_seconds;
        request.interrupt = request_.interrupt;
        RenderPosition last;
        bool started = false;
        work_.begin(work, {double(request.spp - std::min(request.spp, made.place.cached)) * double(scene.pixels()), 0});
        request.on_batch = [&](const RenderPosition& p) {
            // The first call after a continued file has no predecessor: it counts little.
            if (started)
                work_.progress(work, double(p.samples - last.samples) * double(scene.pixels()),
                               p.seconds - last.seconds);
            started = true;
            last = p;
            show(fmt::format("reference of {}: {} of {} spp", scene.entry->name, p.samples, request.spp));
        };
        const ReferenceResult result = make_reference(scene.scene, request, hooks_);
        work_.end(work);
        if (result.interrupted) return false;
        made.image = result.reference;
        if (result.stats.invalid.total())
            log_warning(fmt::format("reference of {}: {} invalid values dropped", scene.entry->name,
                                    result.stats.invalid.total()));
        write_png(folder_.file("images", scene, "reference.png"), made.image.mean);
        folder_.describe_reference(index, describe_reference(made.place, made.image, result.attributes, folder_.path(),
                                                             config_.reference_seed));
        return true;
    }

    /// Only peers whose images agree with the reference are timed.
    bool examine_peers(size_t index) {
        const LoadedEntry& scene = prepared_.scenes[index];
        for (const RunEntry& run : config_.runs) {
            if (run.renderer.empty()) continue;
            show(fmt::format("agreement of {} on {}", run.name, scene.entry->name));
            const RenderSettings settings = settings_for(config_, scene, run, 0, hooks_);
            if (!peers_.examine({scene, run, settings}, references_made_[index].image)) return false;
        }
        return true;
    }

    RunMaker& maker(const RunEntry& run) { return run.renderer.empty() ? static_cast<RunMaker&>(own_) : peers_; }

    RenderTask task_of(size_t index, const RunEntry& run, uint64_t seed) const {
        return make_task(index, prepared_.scenes[index], run, seed, folder_);
    }

    /// One render through all of its checkpoints; false if interrupted. A peer that fails is left out and said.
    bool render(size_t index, const RunEntry& run, uint64_t seed) {
        try {
            return try_render(index, run, seed);
        } catch (const PeerRefusal& e) {
            const RenderTask task = task_of(index, run, seed);
            peers_.lose(task.scene, run, seed, e.what());
            forget(task);
            work_.end(task.work);
            std::error_code ignored;
            fs::remove(task.state_path, ignored);
            fs::remove(folder_.file("stats", task.scene, task.name + ".json"), ignored);
            return true;
        }
    }

    bool try_render(size_t index, const RunEntry& run, uint64_t seed) {
        if (!run.renderer.empty() && !peers_.agrees(prepared_.scenes[index], run)) {
            work_.skip(work_kind(prepared_.scenes[index], &run));
            return true;
        }
        RenderTask task = task_of(index, run, seed);
        if (folder_.runs().count(task.prefix) == checkpoints_.size() && !fs::exists(task.state_path)) {
            work_.skip(task.work);
            return true;
        }
        restore(task);
        task.settings = settings_for(config_, task.scene, run, seed, hooks_);
        const std::unique_ptr<Renderer> renderer = maker(run).make(task.what(), task.total);
        const bool cuda = prepared_.backends.contains("cuda");
        gpu_ = {};
        const LoadReading load = hooks_.load();
        const bool whole = pass_checkpoints(task, *renderer);
        nlohmann::json machine = load_json(load, hooks_.load());
        machine["gpu"] = gpu_.json();
        machine["clocks"] = describe_clocks("after", cuda);
        task.state.notes["machine"].push_back(machine);
        if (!whole) {
            if (task.state.moments.samples && !run.techniques) write_state(task.state_path, task.state);
            return false;
        }
        work_.end(task.work);
        finish(task);
        if (run.techniques) {
            write_technique_images(folder_.file("techniques", task.scene, task.name), task.scene.scene, task.settings,
                                   task.stated(), renderer->strategy_images());
            folder_.runs().add(task.state.notes["rows"].get<std::vector<std::string>>());
        }
        folder_.batches().add(task.state.notes["batches"].get<std::vector<std::string>>());
        if (!run.renderer.empty()) peers_.found_again(task.scene, run, seed);
        std::error_code ignored;
        fs::remove(task.state_path, ignored);
        return true;
    }

    /// Rows of a render that begins anew.
    void forget(const RenderTask& task) {
        folder_.runs().remove(task.prefix);
        folder_.batches().remove(task.prefix);
    }

    /// What an earlier part saved.
    void restore(RenderTask& task) {
        RenderState& state = task.state;
        if (auto saved = read_state(task.state_path)) {
            state = std::move(*saved);
            if (state.notes.contains("stats")) task.total = restore_stats(state.notes["stats"]);
            for (const auto& line : state.notes["rows"]) folder_.runs().add(line.get<std::string>());
            if (task.run.techniques && state.notes["attempts"].empty())
                log_info(fmt::format("{} {}: starts over, because the sums of its single strategies are not saved",
                                     task.scene.entry->name, task.name));
        }
        if (task.run.techniques) write_state(task.state_path, state);
        // Rows whose state is lost are made anew.
        if (state.notes["rows"].empty()) forget(task);
        const auto& done = state.notes["done"];
        for (size_t k = 0; k < checkpoints_.size(); ++k)
            if (std::find(done.begin(), done.end(), k) == done.end()) task.pending.push_back(k);
    }

    /// Renders from checkpoint to checkpoint; false if interrupted.
    bool pass_checkpoints(RenderTask& task, Renderer& renderer) {
        RenderState& state = task.state;
        RenderPosition position{state.moments.samples, state.notes["seconds"].get<double>(), false};
        // Choosing is part of the method: its time counts.
        position.seconds += renderer.stats().choice.seconds;
        work_.begin(task.work, work_after(task.scene, position));
        RenderStats counted = renderer.stats();
        while (!task.pending.empty()) {
            const Budget budget = next_budget(config_, task.pending, position);
            const RenderPosition before = position;
            const LoadReading load = hooks_.load();
            position = drive_showing(task, renderer, position, budget);
            const LoadReading after = hooks_.load();
            add_part(task.total, counted, renderer.stats());
            state.notes["seconds"] = position.seconds;
            // The film restarts at each checkpoint and with each batch, so that a resumed render adds the same numbers
            // in the same order as an uninterrupted one.
            if (position.samples > before.samples) {
                const FilmMoments film = renderer.film();
                if (!position.interrupted)
                    record_batch(task, film, position.seconds - before.seconds, other_cores(load, after));
                state.moments.add(film);
                renderer.clear_film();
            }
            counted = renderer.stats();  // a renderer may or may not restart its counters with its film
            state.notes["stats"] = save_stats(task.total);
            if (position.interrupted) return false;
            record_checkpoints(task, position, budget);
        }
        return true;
    }

    void record_batch(RenderTask& task, const FilmMoments& film, double seconds, double others) const {
        nlohmann::json& lines = task.state.notes["batches"];
        BatchRow b = measure_batch(film, references_made_[task.scene_index].image, seconds);
        b.scene = task.scene.entry->name;
        b.run = task.run.name;
        b.seed = task.settings.seed;
        b.batch = lines.size();
        b.other_cores = others;
        lines.push_back(batch_line(b));
    }

    RenderPosition drive_showing(const RenderTask& task, Renderer& renderer, const RenderPosition& from,
                                 const Budget& budget) {
        RenderPosition last = from;
        return drive(renderer, from, budget, request_.interrupt, [&](const RenderPosition& p) {
            work_.progress(task.work, double(p.samples - last.samples) * double(task.scene.pixels()),
                           p.seconds - last.seconds);
            last = p;
            if (nvml_.is_there()) gpu_.add(nvml_.read());
            show(fmt::format("{} {} seed {}: {} spp", task.scene.entry->name, task.run.name, task.settings.seed,
                             p.samples));
        });
    }

    /// Rows, state and images of the checkpoints that `budget` ended at.
    void record_checkpoints(RenderTask& task, const RenderPosition& position, const Budget& budget) {
        const bool ended_by_time = budget.seconds > 0 && (budget.samples == 0 || position.samples < budget.samples);
        const auto reached = [&](size_t k) {
            const Checkpoint& c = checkpoints_[k];
            return c.samples ? position.samples >= c.samples
                             : position.seconds >= c.seconds || (ended_by_time && c.seconds <= budget.seconds);
        };
        std::vector<std::string> lines;
        for (const size_t k : task.pending)
            if (reached(k)) {
                lines.push_back(result_line(row(task, k)));
                task.state.notes["rows"].push_back(lines.back());
                task.state.notes["done"].push_back(k);
                if (k + 1 == checkpoints_.size()) write_images(task);
            }
        std::erase_if(task.pending, reached);
        if (task.run.techniques) return;  // its rows wait until all of its files are there
        if (lines.empty()) return;
        write_state(task.state_path, task.state);
        for (const std::string& line : lines) folder_.runs().add(line);
    }

    ResultRow row(const RenderTask& task, size_t k) {
        ResultRow r;
        r.scene = task.scene.entry->name;
        r.run = task.run.name;
        r.seed = task.settings.seed;
        r.checkpoint = k;
        r.budget = checkpoints_[k].samples ? "spp" : "seconds";
        const MethodNames names = maker(task.run).names(task.what(), task.total);
        r.integrator = names.integrator;
        r.variant = names.variant;
        r.estimator = names.estimator;
        r.method = names.method;
        r.backend = task.total.backend;
        r.spp = task.state.moments.samples;
        r.time = task.state.notes["seconds"].get<double>();
        r.metrics = compare_images(task.state.moments, references_made_[task.scene_index].image);
        r.rays = task.total.rays_extend + task.total.rays_occlude;
        r.invalid = task.total.invalid.total();
        return r;
    }

    /// At the last checkpoint of the list: where there are some in seconds, all images have had the same time.
    void write_images(const RenderTask& task) {
        const Image image = mean_image(task.state.moments);
        write_exr(folder_.file("images", task.scene, task.name + ".exr"), image,
                  maker(task.run).attributes(task.what(), task.stated()));
        write_png(folder_.file("images", task.scene, task.name + ".png"), image);
    }

    void finish(const RenderTask& task) {
        if (task.total.invalid.total())
            log_warning(fmt::format("{} {}: {} invalid values dropped", task.scene.entry->name, task.name,
                                    task.total.invalid.total()));
        nlohmann::json json = maker(task.run).statistics(task.what(), task.stated());
        json["machine"] = task.state.notes["machine"];
        json["attempts"] = task.state.notes.value("attempts", nlohmann::json::array());
        write_file_atomic(folder_.file("stats", task.scene, task.name + ".json"),
                          json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    }

    const ExperimentRequest& request_;
    const Hooks& hooks_;
    const Prepared prepared_;
    const ExperimentConfig& config_;
    const std::vector<Checkpoint> checkpoints_;
    ExperimentFolder folder_;
    OwnRuns own_;
    PeerRuns peers_;
    const Nvml nvml_;
    GpuReadings gpu_;  ///< of the render in work
    std::vector<SceneReference> references_made_ = std::vector<SceneReference>(prepared_.scenes.size());
    WorkEstimate work_;
    Progress* progress_ = nullptr;
};

}  // namespace

ExitCode run_experiment(const ExperimentRequest& request, const Hooks& hooks) {
    Experiment experiment(request, hooks);
    if (request.on_prepared) request.on_prepared();
    return experiment.run();
}

}  // namespace ambilux
