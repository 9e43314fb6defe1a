#include "session/gpu_watch.h"

#include <dlfcn.h>

#include <algorithm>
#include <utility>

#include "session/load.h"

namespace ambilux {
namespace {

// nvml.h, whose numbers are stable: clocks of the multiprocessors and of memory, the sensor of the chip.
constexpr int kSmClock = 1, kMemoryClock = 2, kChip = 0;

constexpr std::pair<uint64_t, const char*> kSlowdowns[] = {
    {0x04, "power cap"}, {0x08, "hardware"}, {0x20, "thermal"}, {0x40, "thermal (hardware)"}, {0x80, "power brake"}};

}  // namespace

std::vector<std::string> slowdowns(uint64_t held_down) {
    std::vector<std::string> names;
    for (const auto& [bit, name] : kSlowdowns)
        if (held_down & bit) names.emplace_back(name);
    return names;
}

void GpuReadings::add(const GpuReading& r) {
    lowest_ = count_ ? std::min(lowest_, r.sm_mhz) : r.sm_mhz;
    memory_ = count_ ? std::min(memory_, r.memory_mhz) : r.memory_mhz;
    highest_ = std::max(highest_, r.sm_mhz);
    celsius_ = std::max(celsius_, r.celsius);
    sum_mhz_ += r.sm_mhz;
    sum_watts_ += 1e-3 * r.milliwatts;
    held_down_ |= r.held_down;
    ++count_;
}

nlohmann::json GpuReadings::json() const {
    if (count_ == 0) return nullptr;
    const double n = double(count_);
    return {{"readings", count_},
            {"sm_mhz", {{"lowest", known(lowest_)}, {"mean", known(sum_mhz_ / n)}, {"highest", known(highest_)}}},
            {"memory_mhz", known(memory_)},
            {"celsius", known(celsius_)},
            {"watts", known(sum_watts_ / n)},
            {"slowdowns", slowdowns(held_down_)}};
}

struct Nvml::Library {
    using Device = void*;

    void* handle;
    Device device = nullptr;
    int (*clock)(Device, int, unsigned*) = nullptr;
    int (*temperature)(Device, int, unsigned*) = nullptr;
    int (*power)(Device, unsigned*) = nullptr;
    int (*reasons)(Device, unsigned long long*) = nullptr;
    int (*shutdown)() = nullptr;

    explicit Library(const char* name) : handle(::dlopen(name, RTLD_NOW | RTLD_LOCAL)) {}
    ~Library() {
        if (shutdown) shutdown();
        if (handle) ::dlclose(handle);
    }
    template <class Function>
    bool find(Function& function, const char* name) {
        function = reinterpret_cast<Function>(::dlsym(handle, name));
        return function != nullptr;
    }
    bool open(const std::string& bus_id) {
        int (*init)() = nullptr;
        int (*by_bus_id)(const char*, Device*) = nullptr;
        if (!handle || !find(init, "nvmlInit_v2") || !find(by_bus_id, "nvmlDeviceGetHandleByPciBusId_v2") ||
            !find(clock, "nvmlDeviceGetClockInfo") || init() != 0)
            return false;
        find(shutdown, "nvmlShutdown");
        find(temperature, "nvmlDeviceGetTemperature");
        find(power, "nvmlDeviceGetPowerUsage");
        if (!find(reasons, "nvmlDeviceGetCurrentClocksEventReasons"))
            find(reasons, "nvmlDeviceGetCurrentClocksThrottleReasons");  // drivers before 535
        return by_bus_id(bus_id.c_str(), &device) == 0;
    }
};

Nvml::Nvml(const std::string& bus_id, const char* library) {
    if (bus_id.empty()) return;
    auto opened = std::make_unique<Library>(library);
    if (opened->open(bus_id)) library_ = std::move(opened);
}

Nvml::~Nvml() = default;

GpuReading Nvml::read() const {
    GpuReading r;
    if (!library_) return r;
    const Library& l = *library_;
    unsigned long long reasons = 0;
    l.clock(l.device, kSmClock, &r.sm_mhz);
    l.clock(l.device, kMemoryClock, &r.memory_mhz);
    if (l.temperature) l.temperature(l.device, kChip, &r.celsius);
    if (l.power) l.power(l.device, &r.milliwatts);
    if (l.reasons && l.reasons(l.device, &reasons) == 0) r.held_down = reasons;
    return r;
}

}  // namespace ambilux
