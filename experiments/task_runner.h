// One render of an experiment through all of its checkpoints.
#pragma once

#include "experiments/disturbed.h"
#include "experiments/experiment_folder.h"
#include "experiments/peers/peer_runs.h"
#include "experiments/render_task.h"
#include "experiments/runner.h"
#include "experiments/work_estimate.h"
#include "session/gpu_watch.h"

namespace ambilux {

/// What the renders of an experiment have in common.
struct ExperimentParts {
    const ExperimentRequest& request;
    const Hooks& hooks;
    const Prepared& prepared;
    const std::vector<Checkpoint>& checkpoints;
    ExperimentFolder& folder;
    RunMaker& own;
    PeerRuns& peers;
    std::vector<SceneReference>& references;  ///< by scene
    WorkEstimate& work;
    std::function<void(const std::string&)> show;  ///< progress
};

/// What is left of a render that stands at `p`.
Work work_after(const ExperimentConfig& config, const LoadedEntry& scene, const RenderPosition& p);

class TaskRunner {
public:
    explicit TaskRunner(const ExperimentParts& parts);

    /// That nothing of it is left to do.
    bool is_done(size_t scene, const RunEntry& run, uint64_t seed) const;
    /// Forgets a render that is done, all but why: it is to be made again.
    void begin_again(const Disturbed& disturbed);
    /// False if interrupted. A peer that fails is left out and said.
    bool render(size_t scene, const RunEntry& run, uint64_t seed);

private:
    RunMaker& maker(const RunEntry& run) const;
    RenderTask task_of(size_t index, const RunEntry& run, uint64_t seed) const;
    bool try_render(size_t index, const RunEntry& run, uint64_t seed);
    void forget(const RenderTask& task) const;
    void restore(RenderTask& task);
    bool pass_checkpoints(RenderTask& task, Renderer& renderer);
    void record_batch(RenderTask& task, const FilmMoments& film, double seconds, double others) const;
    RenderPosition drive_showing(const RenderTask& task, Renderer& renderer, const RenderPosition& from,
                                 const Budget& budget);
    void record_checkpoints(RenderTask& task, const RenderPosition& position, const Budget& budget);
    ResultRow row(const RenderTask& task, size_t k) const;
    void write_images(const RenderTask& task) const;
    void finish(const RenderTask& task) const;

    const ExperimentParts p_;
    const ExperimentConfig& config_;
    const Nvml nvml_;
    GpuReadings gpu_;  ///< of the render in work
};

}  // namespace ambilux
