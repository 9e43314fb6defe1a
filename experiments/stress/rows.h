// stress.csv, a row per cell, method and backend, and expected.csv, a row per cell.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "experiments/stress/cell.h"
#include "experiments/stress/judge.h"

namespace ambilux::stress {

extern const char* const kRowHeader;
extern const char* const kExpectedHeader;

struct Row {
    std::string cell, family;
    double value = 0;
    std::string method, backend;
    Verdict verdict = Verdict::ok;
    Mean mean, answer;
    Comparison comparison;
    double variance = 0;        ///< relative_variance
    double variance_ratio = 0;  ///< over that of the benign cell by the same method; 0: not known
    double paths = 0, seconds = 0;
    uint64_t invalid = 0, lost = 0;
    std::string limit, note;
};

std::string row_prefix(const std::string& cell, const std::string& method, const std::string& backend);
std::string row_line(const Row& row);
/// The row of a line that row_line made; nothing of another.
std::optional<Row> parse_row(const std::string& line);

/// `found`: methods that can find the light.
std::string expected_line(const Family& family, const Cell& cell, const std::vector<std::string>& found);

}  // namespace ambilux::stress
