#include "core/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>

#include "core/log.h"

namespace ambilux {

std::string format_duration(double seconds) {
    if (!(seconds >= 0) || std::isinf(seconds)) return "?";
    if (seconds < 9.95) return fmt::format("{:.1f} s", seconds);
    const auto whole = static_cast<long long>(std::llround(seconds));
    if (whole < 60) return fmt::format("{} s", whole);
    if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
    return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

std::string format_count(double value) {
    if (value >= 1e9) return fmt::format("{:.2f} G", value * 1e-9);
    if (value >= 1e6) return fmt::format("{:.2f} M", value * 1e-6);
    if (value >= 1e3) return fmt::format("{:.2f} k", value * 1e-3);
    return fmt::format("{:.0f} ", value);
}

bool Progress::stderr_is_terminal() { return ::isatty(STDERR_FILENO) != 0; }

Progress::Progress(std::string label, bool terminal, double plain_interval)
    : label_(std::move(label)), terminal_(terminal), plain_interval_(plain_interval), start_(Clock::now()),
      last_(start_) {}

void Progress::update(double fraction, const std::string& details, double seconds_left) {
    if (is_quiet()) return;
    const auto now = Clock::now();
    const double since = std::chrono::duration<double>(now - last_).count();
    // The first plain line comes after an interval: short work prints none.
    if (terminal_ ? shown_ && since < 0.1 : since < plain_interval_) return;
    last_ = now;
    shown_ = true;
    if (seconds_left < 0) {
        const double elapsed = std::chrono::duration<double>(now - start_).count();
        seconds_left = fraction > 0 ? elapsed * (1 - fraction) / fraction : INFINITY;
    }
    const std::string line =
        fmt::format("{} {:3.0f} %  {}  {} left", label_, 100 * fraction, details, format_duration(seconds_left));
    if (terminal_)
        set_status_line(line);
    else
        log_info(line);
}

void Progress::finish() {
    if (terminal_ && shown_) set_status_line("");
    shown_ = false;
}

}  // namespace ambilux
