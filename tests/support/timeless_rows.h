// Results of experiments without what differs from run to run.
#pragma once

#include <string>
#include <vector>

#include "experiments/results.h"

namespace ambilux {

/// Rows without the column `time`, which is the 11th; names may hold commas in quotes.
inline std::vector<std::string> timeless(const std::string& path) {
    std::vector<std::string> rows = read_results(path);
    for (std::string& row : rows) {
        bool inside = false;
        int field = 0;
        std::string kept;
        for (const char c : row) {
            if (c == '"') inside = !inside;
            field += c == ',' && !inside;
            if (field != 10 || c == ',') kept += c;
        }
        row = kept;
    }
    return rows;
}

}  // namespace ambilux
