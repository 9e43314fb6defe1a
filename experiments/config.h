// Experiment configurations (TOML). Docs of every key: experiments/demo.toml and docs/experiments.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ambilux {

using Settings = std::vector<std::pair<std::string, std::string>>;

/// One way to render.
struct RunEntry {
    std::string name;        ///< of a sweep's run: "lvc[connections=4]"
    Settings settings;       ///< for apply_setting, in order
    std::vector<int> lines;  ///< of each setting
    int line = 0;
    std::string base;    ///< of a sweep's run: the name before the bracket; else the name
    Settings swept;      ///< what the bracket says
    int techniques = 0;  ///< longest paths whose single strategies get images; 0: none
    int techniques_line = 0;
    std::string renderer;  ///< a kind of peer (experiments/peers); empty: this program
};

/// How a scene's ground truth is made.
struct ReferenceEntry {
    uint64_t spp = 0;
    RunEntry how;  ///< settings only; without any: the path tracer
};

/// One scene of an experiment.
struct SceneEntry {
    std::string name;  ///< also the name of its folders; of a sweep's scene: "cornell[max_depth=4]"
    std::string base;
    std::string path;                ///< absolute
    uint32_t width = 0, height = 0;  ///< 0: the scene's own
    std::optional<int> max_depth;    ///< none: the scene's own
    ReferenceEntry reference;        ///< the experiment's, or what the scene replaces of it
    bool lenient = false;
    bool box_filter = false;  ///< in the place of the scene's own
    Settings parameters;
    Settings params;  ///< parameters by the names of their objects, and their values (formats/edits.h)
    int line = 0;
};

/// Where renders are measured. Each checkpoint is a number of samples or a time; a render passes through all of them
/// and never restarts.
struct Checkpoint {
    uint64_t samples = 0;  ///< per pixel, or
    double seconds = 0;    ///< of render time
};

struct ExperimentConfig {
    std::string file;  ///< where it came from
    std::string name;
    std::string backend = "auto";
    uint64_t reference_seed = 0;
    std::vector<SceneEntry> scenes;
    std::vector<RunEntry> runs;
    std::vector<uint64_t> seeds;
    std::vector<uint64_t> spp;     ///< checkpoints, rising
    std::vector<double> seconds;   ///< checkpoints in seconds of render time, rising. One of both is set, or both
    std::string ablation_default;  ///< run that an ablation compares with; empty: no ablation
    bool random_order = true;  ///< of runs and scenes within a seed, so that a machine that changes treats all alike
    uint64_t repeats = 1;  ///< times that a render is made again whose time others disturbed (experiments/disturbed.h)
    uint64_t agreement_spp = 1024;  ///< of a peer's image that is compared with the reference before it is timed
    std::string metric = "relmse";  ///< error that leads the report: "relmse" or "mse"

    /// All checkpoints, those in samples first. Their places in this list are the column `checkpoint` of runs.csv.
    std::vector<Checkpoint> checkpoints() const;
};

/// Reads and checks a configuration as far as that needs no scene; sweeps become single runs and scenes. Throws
/// Error(bad_input) with file, line and the offending key or value. `reduced`: with what the section [reduced]
/// replaces, for small machines; refused where there is no such section.
ExperimentConfig read_experiment(const std::string& path, bool reduced = false);

/// The configuration with every default filled in and every sweep expanded, as TOML; equal experiments give equal text.
/// It is a configuration itself.
std::string resolved_toml(const ExperimentConfig& config);

}  // namespace ambilux
