// Progress of long work: a line that renews itself on a terminal, a plain line now and then elsewhere, nothing when
// quiet.
#pragma once

#include <chrono>
#include <string>

namespace ambilux {

/// "3.4 s", "2 min 05 s", "1 h 12 min".
std::string format_duration(double seconds);
/// Number with k, M or G: "12.3 M".
std::string format_count(double value);

/// Where long work stands, for who shows it by other means.
struct ProgressReport {
    double fraction = 0;       ///< done, in [0,1]
    std::string details;       ///< what is in work
    double seconds_left = -1;  ///< negative: not known
};

class Progress {
public:
    /// `terminal`: whether standard error is one; pass explicitly in tests only. `plain_interval`: seconds between
    /// plain lines.
    explicit Progress(std::string label, bool terminal = stderr_is_terminal(), double plain_interval = 10.0);
    ~Progress() { finish(); }
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// `fraction` done in [0,1]; `details` such as "64 spp, 12 Mrays/s"; seconds left, or negative to compute it from
    /// the fraction.
    void update(double fraction, const std::string& details, double seconds_left = -1);
    /// Removes the line from a terminal.
    void finish();

    static bool stderr_is_terminal();

private:
    using Clock = std::chrono::steady_clock;
    std::string label_;
    bool terminal_;
    double plain_interval_;
    Clock::time_point start_, last_;
    bool shown_ = false;
};

}  // namespace ambilux
