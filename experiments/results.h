// runs.csv: one row per (scene, run, seed, checkpoint).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "film/metrics.h"

namespace ambilux {

struct ResultRow {
    std::string scene, run;
    uint64_t seed = 0;
    size_t checkpoint = 0;  ///< place in ExperimentConfig::checkpoints()
    std::string budget;     ///< "spp" or "seconds": what the checkpoint is given in
    std::string integrator, variant, estimator, backend;
    uint64_t spp = 0;
    double time = 0;  ///< seconds inside the renderer, wall clock
    Metrics metrics;
    uint64_t rays = 0, invalid = 0;
};

/// Column names; the first line of the file.
extern const char* const kResultHeader;

/// One line without its end. Names with commas (of sweeps) are quoted; none holds a quote (the configuration sees to
/// that).
std::string result_line(const ResultRow& row);

/// "scene,run,seed,": what the lines of one render begin with.
std::string result_prefix(const std::string& scene, const std::string& run, uint64_t seed);

/// The lines of a results file, without its header. A last line that a killed process left unfinished is dropped; so
/// are repeated lines. Nothing if the file does not exist. Throws Error(bad_input) if the header is another.
std::vector<std::string> read_results(const std::string& path);
/// The same of a file with another header.
std::vector<std::string> read_rows(const std::string& path, const std::string& header);

}  // namespace ambilux
