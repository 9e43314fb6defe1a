// An experiment with its scenes loaded and all of its settings tried, before anything is written or rendered.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "experiments/config.h"
#include "session/hooks.h"

namespace ambilux {

struct LoadedEntry {
    const SceneEntry* entry = nullptr;
    Scene scene;
    double load_seconds = 0;
    int max_depth = -1;
    uint64_t pixels() const { return uint64_t(scene.sensor.crop_width) * scene.sensor.crop_height; }
};

struct Prepared {
    ExperimentConfig config;
    std::vector<LoadedEntry> scenes;  ///< in the order of config.scenes
    std::set<std::string> devices, backends;
};

/// Reads the configuration, loads its scenes and makes the renderer of every run once, so that nothing is refused after
/// hours of work: every run on the first scene, and every integrator and variant on the others. Throws Error(bad_input)
/// with file, line and the offending name.
Prepared prepare_experiment(const std::string& path, bool reduced, const Hooks& hooks);

/// All settings of one render. Throws Error(bad_input) that names the line of the setting.
RenderSettings settings_for(const ExperimentConfig& config, const LoadedEntry& scene, const RunEntry& run,
                            uint64_t seed, const Hooks& hooks);

}  // namespace ambilux
