#include "experiments/load.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>

#include "experiments/machine.h"

namespace ambilux {
namespace {

double seconds_of(const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); }

/// Null for 0, which stands for unknown.
nlohmann::json known(double value) { return value > 0 ? nlohmann::json(value) : nlohmann::json(nullptr); }

}  // namespace

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
    if (rusage usage; ::getrusage(RUSAGE_SELF, &usage) == 0)
        r.own = seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
    std::ifstream("/proc/loadavg") >> r.load;
    r.mhz = cpu_mhz().mean;
    return r;
}

double other_cores(const LoadReading& before, const LoadReading& after) {
    const double wall = after.wall - before.wall;
    if (!(wall > 0)) return 0;
    return std::max(0.0, (after.busy - before.busy) + (after.steal - before.steal) - (after.own - before.own)) / wall;
}

nlohmann::json load_json(const LoadReading& before, const LoadReading& after) {
    const double wall = std::max(1e-9, after.wall - before.wall);
    return {{"seconds", wall},
            {"cores", std::thread::hardware_concurrency()},
            {"other_cores", other_cores(before, after)},
            {"own_cores", (after.own - before.own) / wall},
            {"steal_cores", (after.steal - before.steal) / wall},
            {"load", {{"before", before.load}, {"after", after.load}}},
            {"cpu_mhz", {{"before", known(before.mhz)}, {"after", known(after.mhz)}}}};
}

}  // namespace ambilux
