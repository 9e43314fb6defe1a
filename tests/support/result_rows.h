// The rows of runs.csv as a test looks at them.
#pragma once

#include <sstream>

#include "experiments/results.h"
#include "tests/support/catch.h"

namespace ambilux::test {

inline std::vector<std::vector<std::string>> table(const std::string& path) {
    std::vector<std::vector<std::string>> rows;
    for (const std::string& line : read_results(path)) {
        rows.emplace_back(1);
        bool inside = false;
        for (const char c : line) {
            if (c == '"')
                inside = !inside;
            else if (c == ',' && !inside)
                rows.back().emplace_back();
            else
                rows.back().back() += c;
        }
    }
    return rows;
}

inline size_t column(const std::string& name) {
    std::istringstream in(kResultHeader);
    size_t i = 0;
    for (std::string field; std::getline(in, field, ','); ++i)
        if (field == name) return i;
    FAIL("no column " << name);
    return 0;
}

/// Rows without the one column that clocks decide.
inline std::vector<std::vector<std::string>> timeless(const std::string& path) {
    auto rows = table(path);
    for (auto& row : rows) row[column("time")] = "";
    return rows;
}

}  // namespace ambilux::test
