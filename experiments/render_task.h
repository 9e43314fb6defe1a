// What the runner keeps of a scene and of a render in progress.
#pragma once

#include <string>
#include <vector>

#include "experiments/experiment_folder.h"
#include "experiments/reference_store.h"
#include "experiments/run_maker.h"
#include "session/state.h"

namespace ambilux {

/// The ground truth of a scene.
struct SceneReference {
    ReferencePlace place;
    Reference image;
};

/// One render on its way through the checkpoints.
struct RenderTask {
    size_t scene_index;
    const LoadedEntry& scene;
    const RunEntry& run;
    RenderSettings settings;
    std::string name, work, prefix, state_path;
    RenderState state;            ///< up to the last checkpoint
    RenderStats total;            ///< of all parts
    std::vector<size_t> pending;  ///< checkpoints that are not reached

    RenderOf what() const { return {scene, run, settings}; }

    /// Statistics of all parts.
    RenderStats stated() const {
        RenderStats stats = total;
        stats.samples = state.moments.samples;
        stats.render_seconds = state.notes["seconds"].get<double>();
        return stats;
    }
};

/// Before its first sample. `scene` is the experiment's at `index`.
RenderTask make_task(size_t index, const LoadedEntry& scene, const RunEntry& run, uint64_t seed,
                     const ExperimentFolder& folder);

/// What estimates of time put together: renders of one run, or with null the reference, of one scene.
std::string work_kind(const LoadedEntry& scene, const RunEntry* run);

}  // namespace ambilux
