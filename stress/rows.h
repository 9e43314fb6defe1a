// stress.csv, a row per cell, method and backend, and expected.csv, a row per cell.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stress/cell.h"
#include "stress/judge.h"

namespace ambilux::stress {

struct Row {
    std::string cell, family;
    double value = 0;  ///< of the parameter
    std::string method, backend;
    Verdict verdict = Verdict::ok;
    Mean mean, answer;
    Comparison comparison;
    double variance = 0;        ///< relative_variance
    double variance_ratio = 0;  ///< over that of the benign cell by the same method; 0: not known
    double first = 0;           ///< Measurement::first
    double samples = 0, paths = 0, seconds = 0;
    uint64_t invalid = 0, lost = 0, underflow = 0;
    std::string limit, note;
};

/// A row that nothing is known of but its answer. `benign`: of the benign cell by the same method, if there is one.
Row blank_row(const Cell& cell, const std::string& method, const std::string& backend, const Row* benign);
/// What was measured, judged. `rows`: of the whole sweep, for the correction; `bias`: Stressed::bias of the method.
void fill_row(Row& row, const Cell& cell, const Measurement& m, const Row* benign, double rows, double bias = 0);
/// Not rendered, or nothing to compare with.
void leave_out(Row& row, const std::string& why);
/// The program said that it cannot render this.
void refuse_row(Row& row, const Cell& cell, const std::string& why);

std::string row_header();
std::string row_line(const Row& row);
/// A file of them.
std::string rows_text(const std::vector<Row>& rows);
/// The row of a line that row_line made; nothing of another.
std::optional<Row> parse_row(const std::string& line);

extern const char* const kExpectedHeader;
std::string expected_line(const Family& family, const Cell& cell);

}  // namespace ambilux::stress
