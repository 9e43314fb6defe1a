// Experiment configurations (TOML). docs of every key: experiments/demo.toml.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ambilux {

/// One scene of an experiment.
struct SceneEntry {
    std::string name;  ///< also the name of its folders: letters, digits, '.', '_', '-'
    std::string path;  ///< absolute
    uint32_t width = 0, height = 0;  ///< 0: the scene's own
    std::optional<int> max_depth;    ///< none: the scene's own
    std::optional<uint64_t> reference_spp;
    bool lenient = false;
    std::vector<std::pair<std::string, std::string>> parameters;
    int line = 0;
};

/// One way to render.
struct RunEntry {
    std::string name;
    std::vector<std::pair<std::string, std::string>> settings;  ///< for apply_setting, in order
    std::vector<int> lines;                                      ///< of each setting
    int line = 0;
};

struct ExperimentConfig {
    std::string file;  ///< where it came from
    std::string name;
    std::string backend = "auto";
    uint64_t reference_spp = 0, reference_seed = 0;
    std::vector<SceneEntry> scenes;
    std::vector<RunEntry> runs;
    std::vector<uint64_t> seeds;
    std::vector<uint64_t> spp;     ///< checkpoints, rising; or
    std::vector<double> seconds;   ///< checkpoints in seconds of render time, rising. Exactly one of both is set

    size_t checkpoints() const { return spp.empty() ? seconds.size() : spp.size(); }
};

/// Reads and checks a configuration as far as that needs no scene. Throws Error(bad_input) with file, line and the offending key or value.
ExperimentConfig read_experiment(const std::string& path);

/// The configuration with every default filled in, as TOML; equal experiments give equal text.
std::string resolved_toml(const ExperimentConfig& config);

}  // namespace ambilux
