// Who else used the machine while something ran.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace ambilux {

/// Counters of the system and of this process; differences of two readings tell what happened between them.
struct LoadReading {
    double wall = 0;   ///< seconds, of a steady clock
    double busy = 0;   ///< CPU seconds of all processes, all cores
    double own = 0;    ///< of this process and those that it started
    double ranks = 0;  ///< of the other ranks on this host and those that they started
    double steal = 0;  ///< that a host of virtual machines gave to others
    double load = 0;   ///< processes that ran or waited, mean of a minute
    double mhz = 0;    ///< mean over cores; 0: unknown
};

/// Null for 0, which stands for unknown.
nlohmann::json known(double value);

/// From /proc; zeros where it does not say.
LoadReading read_load();

/// "cpu  123 4 56 ..." of /proc/stat: sets busy and steal. Ticks of `per_second`.
void parse_cpu_line(const std::string& line, double per_second, LoadReading& reading);

/// CPU seconds in a line of /proc/PID/stat, those of its ended children included; 0 if it is none.
double parse_stat_seconds(const std::string& text, double per_second);

/// CPU seconds of other processes, stolen ones included, per second of wall clock: cores that others held. Other ranks
/// of the same work are none of them: what they may share is said where they greet
/// (experiments/task_dealer.h). Not below 0.
double other_cores(const LoadReading& before, const LoadReading& after);

/// {seconds, cores, other_cores, own_cores, rank_cores, steal_cores, load {before, after}, cpu_mhz {before, after}}.
nlohmann::json load_json(const LoadReading& before, const LoadReading& after);

}  // namespace ambilux
