// Runs the stress sweep into a folder; what is there already is not done again (docs/stress.md).
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "experiments/hooks.h"
#include "experiments/stress/rows.h"

namespace ambilux::stress {

/// Exit code of a sweep with cells that failed, or that counted invalid values, or were refused.
constexpr int kFailedCells = 6;

struct Request {
    std::string output, backend = "auto";
    std::vector<std::string> families;  ///< names; empty: all
    bool quick = false, resume = false;
    uint64_t seed = 1;
    const volatile bool* interrupt = nullptr;
};

struct Summary {
    std::vector<Row> rows;  ///< of the families and the backend asked for
    double planned = 0;     ///< rows of the whole sweep
    bool interrupted = false;

    size_t count(Verdict verdict) const;
    /// failed, invalid or refused.
    size_t bad() const { return count(Verdict::failed) + count(Verdict::invalid) + count(Verdict::refused); }
};

/// Writes scenes/, expected.csv and stress.csv into the folder. Throws Error: usage for an unknown family or a folder
/// that holds a sweep already (without `resume`), bad_input if that was another one.
Summary run(const Request& request, const Hooks& hooks);

/// Rows that are not ok, worst first, and how many of each verdict; for a person.
std::string report(const Summary& summary);

}  // namespace ambilux::stress
