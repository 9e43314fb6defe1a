// runs.csv: one row per (scene, run, seed, checkpoint). batches.csv: one per (scene, run, seed, batch of passes).
#pragma once

#include <cstdint>
#include <functional>
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
    std::string method;       ///< what ran (method_text)
    std::string stated_bias;  ///< bias_text
    std::string device, host;
};

/// Whole passes of one render, apart from its others: a sample of how much its errors scatter.
struct BatchRow {
    std::string scene, run;
    uint64_t seed = 0;
    size_t batch = 0;
    uint64_t spp = 0;
    double time = 0;
    double other_cores = 0;      ///< cores that other processes held meanwhile
    double mse = 0, relmse = 0;  ///< of the batch's own image, corrected for the reference's noise where that is known
};

/// Column names; the first line of the file.
extern const char* const kResultHeader;
extern const char* const kBatchHeader;

/// One line without its end. Names with commas (of sweeps) are quoted; none holds a quote (the configuration sees to
/// that).
std::string result_line(const ResultRow& row);
std::string batch_line(const BatchRow& row);

/// "scene,run,seed,": what the lines of one render begin with.
std::string result_prefix(const std::string& scene, const std::string& run, uint64_t seed);

/// The lines of a results file with the columns `header`, without them. A last line that a killed process left
/// unfinished is dropped; so are repeated lines. Nothing if the file does not exist. Throws Error(bad_input) if the
/// header is another.
std::vector<std::string> read_results(const std::string& path, const char* header = kResultHeader);

/// One of both files, which grows by whole lines.
class ResultTable {
public:
    /// Of another process, which is told: what to do ("add", "remove"), and the lines or the prefix.
    using Tell = std::function<void(const char* what, const std::vector<std::string>& lines)>;
    explicit ResultTable(Tell tell) : header_(nullptr), tell_(std::move(tell)) {}
    /// With the lines that the file holds.
    ResultTable(const std::string& path, const char* header);
    /// Lines that begin with `prefix`.
    size_t count(const std::string& prefix) const;
    /// Appends a line unless the file has it.
    void add(const std::string& line);
    /// The same for several at once: a process that is killed leaves all or none.
    void add(const std::vector<std::string>& lines);
    void remove(const std::string& prefix);

private:
    void write() const;

    const std::string path_;
    const char* const header_;
    const Tell tell_;
    std::vector<std::string> lines_;
};

}  // namespace ambilux
