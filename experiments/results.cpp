#include "experiments/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/atomic_file.h"
#include "core/error.h"

namespace ambilux {

const char* const kResultHeader =
    "scene,run,seed,checkpoint,budget,integrator,variant,estimator,backend,spp,time,rmse,rmse_corrected,reference_"
    "noise,relmse,relmse_corrected,relmse_trimmed,"
    "relmse_trimmed_corrected,mape,bias,bias_z,rays,invalid";

namespace {

std::string quoted(const std::string& name) { return name.find(',') == name.npos ? name : '"' + name + '"'; }

/// Commas outside quotes; -1 for a quote that does not end.
long count_commas(std::string_view line) {
    long commas = 0;
    bool inside = false;
    for (const char c : line) {
        if (c == '"') inside = !inside;
        commas += c == ',' && !inside;
    }
    return inside ? -1 : commas;
}

}  // namespace

std::string result_prefix(const std::string& scene, const std::string& run, uint64_t seed) {
    return fmt::format("{},{},{},", quoted(scene), quoted(run), seed);
}

std::string result_line(const ResultRow& r) {
    const Metrics& m = r.metrics;
    return fmt::format(
        "{}{},{},{},{},{},{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.5g},{},{}",
        result_prefix(r.scene, r.run, r.seed), r.checkpoint, r.budget, r.integrator, r.variant, r.estimator, r.backend,
        r.spp, r.time, m.rmse, m.rmse_corrected, m.reference_noise, m.relmse, m.relmse_corrected, m.relmse_trimmed,
        m.relmse_trimmed_corrected, m.mape, m.bias, m.bias_z, r.rays, r.invalid);
}

std::vector<std::string> read_results(const std::string& path) { return read_rows(path, kResultHeader); }

std::vector<std::string> read_rows(const std::string& path, const std::string& header) {
    std::vector<std::string> lines;
    if (!std::filesystem::exists(path)) return lines;
    const std::string content = read_file(path);
    const long commas = count_commas(header);
    std::set<std::string> seen;
    size_t number = 0;
    for (size_t begin = 0, end; (end = content.find('\n', begin)) != std::string::npos; begin = end + 1) {
        std::string line = content.substr(begin, end - begin);
        if (++number == 1) {
            if (line != header)
                throw input_error(path, 1, "its columns are not those of this version: choose another output folder");
            continue;
        }
        if (count_commas(line) == commas && seen.insert(line).second) lines.push_back(std::move(line));
    }
    return lines;
}

}  // namespace ambilux
