#include "experiments/machine.h"

#include <sys/utsname.h>

#include <ctime>
#include <fstream>
#include <thread>

namespace ambilux {

nlohmann::json describe_machine() {
    nlohmann::json machine = {{"cpu", nullptr}, {"cores", std::thread::hardware_concurrency()}, {"system", nullptr}, {"driver", nullptr}};
    std::ifstream cpu("/proc/cpuinfo");
    for (std::string line; std::getline(cpu, line);)
        if (line.starts_with("model name")) {
            if (const size_t at = line.find(": "); at != std::string::npos) machine["cpu"] = line.substr(at + 2);
            break;
        }
    // "NVRM version: NVIDIA UNIX Open Kernel Module for x86_64  580.65.06  Release Build ..."
    std::ifstream driver("/proc/driver/nvidia/version");
    if (std::string line; std::getline(driver, line)) machine["driver"] = line;
    if (utsname name; ::uname(&name) == 0) machine["system"] = std::string(name.sysname) + " " + name.release + " " + name.machine;
    return machine;
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
