#include "experiments/runner.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/log.h"
#include "core/progress.h"
#include "core/ranks.h"
#include "experiments/batches.h"
#include "experiments/disturbed.h"
#include "experiments/task_dealer.h"
#include "experiments/task_runner.h"
#include "film/png_io.h"

namespace ambilux {
namespace {

class Experiment {
public:
    Experiment(const ExperimentRequest& request, const Hooks& hooks)
        : request_(request), hooks_(hooks), prepared_(prepare_experiment(request.config, request.reduced, hooks)),
          config_(prepared_.config), checkpoints_(config_.checkpoints()),
          folder_(request.output, request.references, request.resume, prepared_), own_(config_, hooks_),
          peers_(request, config_), dealer_(folder_),
          task_runner_({request_, hooks_, prepared_, checkpoints_, folder_, own_, peers_, references_made_, work_,
                        [this](const std::string& what) { show(what); }}) {}

    ExitCode run() { return ranks().rank() > 0 ? serve() : lead(); }

private:
    /// Deals out what is to be done, and does its share.
    ExitCode lead() {
        folder_.add_clocks(folder_.is_resumed() ? "resumed" : "start");
        dealer_.greet(prepared_, request_, folder_);
        folder_.write_manifest(false);
        plan();
        Progress progress("experiment " + config_.name);
        progress_ = &progress;
        std::vector<ExperimentTask> references, renders;
        for (size_t i = 0; i < prepared_.scenes.size(); ++i) references.push_back({true, i, 0, 0});
        for (const uint64_t seed : config_.seeds)
            for (const auto& [scene, run] :
                 render_order(prepared_.scenes.size(), config_.runs.size(), seed, config_.random_order))
                renders.push_back({false, scene, run, seed});
        if (ranks().size() > 1 && !deal(references)) return stopped();
        for (size_t i = 0; i < prepared_.scenes.size(); ++i)
            if (!make_scene_reference(i) || !examine_peers(i)) return stopped();
        folder_.write_manifest(false);
        if (!deal(renders) || !repeat_disturbed()) return stopped();
        dealer_.stop();
        folder_.remove_states();
        folder_.add_clocks("end");
        folder_.write_manifest(true);
        return ExitCode::done;
    }

    bool deal(const std::vector<ExperimentTask>& tasks) {
        return dealer_.deal(tasks, [&](const ExperimentTask& t, bool here) { return work_or_send(t, here); });
    }

    bool work_or_send(const ExperimentTask& t, bool here) {
        if (here) return work_on(t);
        // Others have no table to look it up in.
        if (!t.reference && task_runner_.is_done(t.scene, config_.runs[t.run], t.seed)) return false;
        work_.skip(work_kind(prepared_.scenes[t.scene], t.reference ? nullptr : &config_.runs[t.run]));
        return true;
    }

    /// Makes disturbed renders again, when all others are done: whoever held the machine may have left it. Ranks that
    /// share devices or cores would only disturb each other again.
    bool repeat_disturbed() {
        for (;;) {
            std::vector<Disturbed> found = disturbed();
            std::erase_if(found, [&](const Disturbed& d) { return d.attempts.size() > config_.repeats; });
            if (found.empty() || dealer_.has_shares()) return true;
            std::stable_sort(found.begin(), found.end(), [](const Disturbed& a, const Disturbed& b) {
                return a.attempts.size() < b.attempts.size();
            });
            std::vector<ExperimentTask> again;
            for (const Disturbed& d : found) again.push_back({false, d.scene, d.run, d.seed});
            if (!dealer_.deal(again, [&](const ExperimentTask& t, bool here) {
                    return begin_again(t) ? work_or_send(t, here) : here;
                }))
                return false;
        }
    }

    std::vector<Disturbed> disturbed() {
        std::vector<Disturbed> found = find_disturbed(folder_, prepared_);
        folder_.describe_disturbed(to_json(found, config_));
        return found;
    }

    /// False if nothing speaks against it any more, since the one that it was compared with has been made again.
    bool begin_again(const ExperimentTask& t) {
        for (const Disturbed& d : disturbed())
            if (d.scene == t.scene && d.run == t.run && d.seed == t.seed) {
                task_runner_.begin_again(d);
                return true;
            }
        return false;
    }

    /// Does what the first rank deals out.
    ExitCode serve() {
        serve_tasks(prepared_, request_, [&](const ExperimentTask& t) { return work_on(t); });
        return ExitCode::done;
    }

    /// False if interrupted.
    bool work_on(const ExperimentTask& t) {
        if (t.reference) return make_scene_reference(t.scene);
        if (references_made_[t.scene].image.samples == 0 && !make_scene_reference(t.scene)) return false;
        return task_runner_.render(t.scene, config_.runs[t.run], t.seed);
    }

    ExitCode stopped() {
        dealer_.wait_for_others();
        folder_.add_clocks("interrupted");
        folder_.write_manifest(false);
        return ExitCode::interrupted;
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
                work_.plan(work_kind(scene, &run), double(config_.seeds.size()), work_after(config_, scene, {}));
        }
    }

    void show(const std::string& what) {
        dealer_.listen();
        if (progress_) progress_->update(work_.fraction(), what, work_.seconds_left());
        if (request_.on_progress) request_.on_progress({work_.fraction(), what, work_.seconds_left()});
    }

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

    const ExperimentRequest& request_;
    const Hooks& hooks_;
    const Prepared prepared_;
    const ExperimentConfig& config_;
    const std::vector<Checkpoint> checkpoints_;
    ExperimentFolder folder_;
    OwnRuns own_;
    PeerRuns peers_;
    std::vector<SceneReference> references_made_ = std::vector<SceneReference>(prepared_.scenes.size());
    WorkEstimate work_;
    TaskDealer dealer_;
    TaskRunner task_runner_;
    Progress* progress_ = nullptr;
};

}  // namespace

ExitCode run_experiment(const ExperimentRequest& request, const Hooks& hooks) {
    Experiment experiment(request, hooks);
    if (request.on_prepared) request.on_prepared();
    return experiment.run();
}

}  // namespace ambilux
