#include "session/machine.h"

#include <fmt/format.h>

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <sstream>
#include <thread>

#include "backends/cuda_device.h"
#include "core/version.h"

namespace ambilux {

std::string parse_driver_version(const std::string& line) {
    std::istringstream words(line);
    for (std::string word; words >> word;)
        if (word.find('.') != std::string::npos && word.find_first_not_of("0123456789.") == std::string::npos)
            return word;
    return line;
}

nlohmann::json describe_machine() {
    nlohmann::json machine = {{"cpu", nullptr},
                              {"cores", std::thread::hardware_concurrency()},
                              {"memory_bytes", nullptr},
                              {"system", nullptr},
                              {"driver", nullptr}};
    if (const long pages = ::sysconf(_SC_PHYS_PAGES), size = ::sysconf(_SC_PAGESIZE); pages > 0 && size > 0)
        machine["memory_bytes"] = uint64_t(pages) * uint64_t(size);
    std::ifstream cpu("/proc/cpuinfo");
    for (std::string line; std::getline(cpu, line);)
        if (line.starts_with("model name")) {
            if (const size_t at = line.find(": "); at != std::string::npos) machine["cpu"] = line.substr(at + 2);
            break;
        }
    std::ifstream driver("/proc/driver/nvidia/version");
    if (std::string line; std::getline(driver, line)) machine["driver"] = parse_driver_version(line);
    if (utsname name; ::uname(&name) == 0)
        machine["system"] = std::string(name.sysname) + " " + name.release + " " + name.machine;
    return machine;
}

nlohmann::json parse_gpu_clocks(const std::string& lines) {
    nlohmann::json gpus = nlohmann::json::array();
    std::istringstream in(lines);
    for (std::string line; std::getline(in, line);) {
        nlohmann::json gpu;
        std::istringstream fields(line);
        for (const char* name : {"sm_mhz", "memory_mhz", "celsius"}) {
            std::string field;
            std::getline(fields, field, ',');
            field.erase(0, std::min(field.find_first_not_of(' '), field.size()));
            double value = 0;
            const auto parsed = std::from_chars(field.data(), field.data() + field.size(), value);
            gpu[name] = parsed.ec == std::errc() ? nlohmann::json(value) : nlohmann::json(nullptr);
        }
        gpus.push_back(gpu);
    }
    return gpus;
}

CpuMhz cpu_mhz() {
    std::ifstream cpuinfo("/proc/cpuinfo");
    return parse_cpu_mhz(cpuinfo);
}

CpuMhz parse_cpu_mhz(std::istream& cpuinfo) {
    CpuMhz found;
    double sum = 0;
    int cores = 0;
    for (std::string line; std::getline(cpuinfo, line);) {
        if (!line.starts_with("cpu MHz")) continue;
        const size_t at = line.find(": ");
        double mhz = 0;
        if (at == std::string::npos || !(std::istringstream(line.substr(at + 2)) >> mhz)) continue;
        found.lowest = cores ? std::min(found.lowest, mhz) : mhz;
        found.highest = std::max(found.highest, mhz);
        sum += mhz;
        ++cores;
    }
    if (cores) found.mean = sum / cores;
    return found;
}

nlohmann::json describe_versions() {
    nlohmann::json versions = {{"ambilux", version()},           {"git_revision", git_revision()},
                               {"compiler", compiler()},         {"flags", AMBILUX_BUILD_FLAGS},
                               {"embree", AMBILUX_EMBREE},       {"tbb", AMBILUX_TBB},
                               {"cuda", nlohmann::json(nullptr)}};
    if (const std::string cuda = AMBILUX_CUDA; !cuda.empty()) versions["cuda"] = cuda;
    return versions;
}

std::string command_line() {
    std::ifstream in("/proc/self/cmdline", std::ios::binary);
    std::string line, argument;
    while (std::getline(in, argument, '\0')) {
        const bool plain = argument.find_first_of(" \t\n\"'$\\*?") == std::string::npos && !argument.empty();
        if (!line.empty()) line += ' ';
        line += plain ? argument : fmt::format("'{}'", argument);
    }
    return line;
}

std::string printed_by(const std::string& command) {
    std::FILE* const pipe = ::popen(command.c_str(), "r");
    if (!pipe) return {};
    std::string text;
    for (int c; (c = std::fgetc(pipe)) != EOF;) text += char(c);
    return ::pclose(pipe) == 0 ? text : std::string();
}

nlohmann::json describe_clocks(const std::string& when, bool cuda) {
    nlohmann::json clocks = {{"when", when}, {"date", utc_now()}, {"cpu_mhz", nullptr}, {"gpu", nullptr}};
    if (const CpuMhz mhz = cpu_mhz(); mhz.mean > 0)
        clocks["cpu_mhz"] = {{"lowest", mhz.lowest}, {"mean", mhz.mean}, {"highest", mhz.highest}};
    const std::string id = cuda ? cuda_device_bus_id() : "";
    if (id.empty()) return clocks;
    // A driver in trouble may not answer, hence the limit.
    const std::string ask =
        "timeout 10 nvidia-smi -i " + id +
        " --query-gpu=clocks.sm,clocks.mem,temperature.gpu --format=csv,noheader,nounits 2>/dev/null";
    if (const std::string lines = printed_by(ask); !lines.empty()) clocks["gpu"] = parse_gpu_clocks(lines);
    return clocks;
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    ::gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

}  // namespace ambilux
