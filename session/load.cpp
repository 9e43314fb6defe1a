#include "session/load.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>

#include "core/ranks.h"
#include "session/machine.h"

namespace ambilux {
namespace {

double seconds_of(const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); }

double process_seconds(pid_t process) {
    std::ifstream stat(fmt::format("/proc/{}/stat", process));
    const std::string text((std::istreambuf_iterator<char>(stat)), std::istreambuf_iterator<char>());
    return parse_stat_seconds(text, double(::sysconf(_SC_CLK_TCK)));
}

/// CPU seconds of the processes that a process has started, those they started included. Those that have ended are in
/// their parent's counts.
double child_seconds(pid_t parent, int depth = 0) {
    constexpr int kMostGenerations = 8;
    double seconds = 0;
    std::error_code ignored;
    for (const auto& task : std::filesystem::directory_iterator(fmt::format("/proc/{}/task", parent), ignored)) {
        std::ifstream children(task.path() / "children");
        for (pid_t child = 0; children >> child;) {
            seconds += process_seconds(child);
            if (depth < kMostGenerations) seconds += child_seconds(child, depth + 1);
        }
    }
    return seconds;
}

}  // namespace

nlohmann::json known(double value) { return value > 0 ? nlohmann::json(value) : nlohmann::json(nullptr); }

double parse_stat_seconds(const std::string& text, double per_second) {
    // pid (name) state ppid pgrp session tty tpgid flags minflt cminflt majflt cmajflt utime stime cutime cstime
    // (proc(5)); the name may hold anything, but no bracket follows it.
    const size_t end = text.rfind(')');
    if (end == std::string::npos) return 0;
    std::istringstream in(text.substr(end + 1));
    std::string skipped;
    for (int i = 0; i < 11; ++i) in >> skipped;
    double ticks = 0, sum = 0;
    for (int i = 0; i < 4 && in >> ticks; ++i) sum += ticks;
    return sum / per_second;
}

void parse_cpu_line(const std::string& line, double per_second, LoadReading& reading) {
    std::istringstream in(line);
    std::string name;
    in >> name;
    if (name != "cpu") return;
    // user nice system idle iowait irq softirq steal; guests are counted in user (proc(5)).
    double ticks[8] = {};
    for (double& t : ticks) in >> t;
    reading.busy = (ticks[0] + ticks[1] + ticks[2] + ticks[5] + ticks[6]) / per_second;
    reading.steal = ticks[7] / per_second;
}

LoadReading read_load() {
    LoadReading r;
    r.wall = std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    if (std::ifstream stat("/proc/stat"); stat) {
        std::string line;
        std::getline(stat, line);
        parse_cpu_line(line, double(::sysconf(_SC_CLK_TCK)), r);
    }
    for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN})
        if (rusage usage; ::getrusage(who, &usage) == 0)
            r.own += seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
    r.own += child_seconds(::getpid());
    for (const int rank : ranks().local_peers()) r.ranks += process_seconds(rank) + child_seconds(rank);
    std::ifstream("/proc/loadavg") >> r.load;
    r.mhz = cpu_mhz().mean;
    return r;
}

double other_cores(const LoadReading& before, const LoadReading& after) {
    const double wall = after.wall - before.wall;
    if (!(wall > 0)) return 0;
    const double all = (after.busy - before.busy) + (after.steal - before.steal),
                 known = (after.own - before.own) + (after.ranks - before.ranks);
    return std::max(0.0, all - known) / wall;
}

nlohmann::json load_json(const LoadReading& before, const LoadReading& after) {
    const double wall = std::max(1e-9, after.wall - before.wall);
    return {{"seconds", wall},
            {"cores", std::thread::hardware_concurrency()},
            {"other_cores", other_cores(before, after)},
            {"own_cores", (after.own - before.own) / wall},
            {"rank_cores", (after.ranks - before.ranks) / wall},
            {"steal_cores", (after.steal - before.steal) / wall},
            {"load", {{"before", before.load}, {"after", after.load}}},
            {"cpu_mhz", {{"before", known(before.mhz)}, {"after", known(after.mhz)}}}};
}

}  // namespace ambilux
