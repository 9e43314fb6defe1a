// Runs the stress sweep into a folder; what is there already is not done again (docs/stress.md).
#pragma once

#include <string>
#include <vector>

#include "session/hooks.h"
#include "stress/methods.h"
#include "stress/rows.h"

namespace ambilux::stress {

/// Exit code of a sweep with rows that failed, counted invalid values or were refused.
constexpr int kFailedRows = 6;

struct Request {
    std::string output, backend = "auto";
    std::vector<std::string> families, methods;  ///< names; empty: all
    bool quick = false, resume = false;
    uint64_t seed = 1;
    double seconds = 0;         ///< that the whole sweep may take; 0: as long as its efforts ask for
    unsigned rows_at_once = 0;  ///< 0: on a host one a core, on a device one
    const volatile bool* interrupt = nullptr;
};

struct Summary {
    std::vector<Row> rows;  ///< of the families, methods and the backend asked for
    size_t planned = 0;     ///< how many there would be
    bool interrupted = false;

    size_t count(Verdict verdict) const;
    /// failed, invalid or refused.
    size_t bad() const { return count(Verdict::failed) + count(Verdict::invalid) + count(Verdict::refused); }
};

/// Cells of `all` that are asked for. Throws Error(usage) for an unknown family.
std::vector<std::pair<const Family*, const Cell*>> chosen_cells(const std::vector<Family>& all,
                                                                const std::vector<std::string>& names, bool quick);

/// Writes stress.csv into the folder. Throws Error: usage for an unknown family or method or a folder that holds a
/// sweep already (without `resume`), bad_input if that was another one.
Summary run(const Request& request, const std::vector<Family>& all, const Hooks& hooks);

/// Judges what another renderer measured (stress/elsewhere.h), and writes stress.csv into the folder.
Summary judge(const std::string& table, const std::string& output, const std::vector<Family>& all);

/// Rows that are not ok, worst first, and how many of each verdict; for a person.
std::string report(const Summary& summary);

}  // namespace ambilux::stress
