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
    "relmse_trimmed_corrected,mape,bias,bias_z,rays,invalid,method,stated_bias,device,host";
const char* const kBatchHeader = "scene,run,seed,batch,spp,time,mse,relmse,other_cores";

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
        "{}{},{},{},{},{},{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.5g},{},{},{},{"
        "},{},{}",
        result_prefix(r.scene, r.run, r.seed), r.checkpoint, r.budget, r.integrator, r.variant, r.estimator, r.backend,
        r.spp, r.time, m.rmse, m.rmse_corrected, m.reference_noise, m.relmse, m.relmse_corrected, m.relmse_trimmed,
        m.relmse_trimmed_corrected, m.mape, m.bias, m.bias_z, r.rays, r.invalid, quoted(r.method),
        quoted(r.stated_bias), quoted(r.device), quoted(r.host));
}

std::string batch_line(const BatchRow& r) {
    return fmt::format("{}{},{},{:.9g},{:.9g},{:.9g},{:.3g}", result_prefix(r.scene, r.run, r.seed), r.batch, r.spp,
                       r.time, r.mse, r.relmse, r.other_cores);
}

std::vector<std::string> read_results(const std::string& path, const char* header) {
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

ResultTable::ResultTable(const std::string& path, const char* header)
    : path_(path), header_(header), lines_(read_results(path, header)) {
    write();
}

size_t ResultTable::count(const std::string& prefix) const {
    return size_t(
        std::count_if(lines_.begin(), lines_.end(), [&](const std::string& line) { return line.starts_with(prefix); }));
}

void ResultTable::add(const std::string& line) { add(std::vector<std::string>{line}); }

void ResultTable::add(const std::vector<std::string>& lines) {
    if (tell_) return tell_("add", lines);
    std::string text;
    for (const std::string& line : lines) {
        if (std::find(lines_.begin(), lines_.end(), line) != lines_.end()) continue;
        text += line + "\n";
        lines_.push_back(line);
    }
    if (!text.empty()) append_file(path_, text);
}

void ResultTable::remove(const std::string& prefix) {
    if (tell_) return tell_("remove", {prefix});
    if (std::erase_if(lines_, [&](const std::string& line) { return line.starts_with(prefix); }) > 0) write();
}

void ResultTable::write() const {
    std::string text = std::string(header_) + "\n";
    for (const std::string& line : lines_) text += line + "\n";
    write_file_atomic(path_, text);
}

}  // namespace ambilux
