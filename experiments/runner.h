// Runs an experiment: every run on every scene with every seed, measured against the scene's reference at every
// checkpoint.
#pragma once

#include <functional>
#include <string>

#include "core/error.h"
#include "core/progress.h"
#include "session/hooks.h"

namespace ambilux {

struct ExperimentRequest {
    std::string config;      ///< TOML file
    std::string output;      ///< folder
    std::string references;  ///< folder of the references; empty: OUTPUT/references. Shared by experiments, it saves
                             ///< making them again
    bool resume = false;
    const volatile bool* interrupt = nullptr;
    std::function<void()> on_prepared = {};  ///< called once all is checked, before the first render; may be empty
    std::function<void(const ProgressReport&)> on_progress = {};  ///< called after each batch; may be empty
    bool shared_devices = false;               ///< ranks may share devices or cores, budgets in seconds included
    bool reduced = false;                      ///< as the section [reduced] of the configuration says
    double reference_checkpoint_seconds = 30;  ///< how often a reference is saved
};

/// Writes into the output folder: config.resolved.toml, manifest.json, runs.csv, images/SCENE/RUN_SEED.{exr,png},
/// stats/SCENE/RUN_SEED.json, techniques/SCENE/RUN_SEED/, references/. All that can be wrong with the configuration is
/// refused before anything is rendered. Seeds are the outer loop, so that an experiment that is stopped early has fewer
/// seeds of every run, not fewer runs. A render passes through all checkpoints, those in samples and those in seconds,
/// without restarting. After each checkpoint its state is saved; with `resume` a stopped or killed experiment loses no
/// more than the work since the last checkpoint, or since the start of a render that gathers images of single
/// strategies. Returns done or interrupted. Throws Error. With several ranks (core/ranks.h) all call it: references and
/// renders are dealt out one by one, and the first rank alone holds the folder.
ExitCode run_experiment(const ExperimentRequest& request, const Hooks& hooks);

}  // namespace ambilux
