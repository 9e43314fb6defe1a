// What a GPU did while it rendered: clocks, temperature, power, and why its clocks were held down.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace ambilux {

/// One look at a device; 0: unknown.
struct GpuReading {
    unsigned sm_mhz = 0, memory_mhz = 0, celsius = 0, milliwatts = 0;
    uint64_t held_down = 0;  ///< bits of nvmlClocksEventReasons
};

/// Names of the bits that mean a slow device: "thermal", "power brake", "hardware", "power cap".
std::vector<std::string> slowdowns(uint64_t held_down);

/// Gathers looks at the device that renders.
class GpuReadings {
public:
    void add(const GpuReading& reading);
    /// {readings, sm_mhz {lowest, mean, highest}, memory_mhz, celsius, watts, slowdowns}: lowest, highest, highest and
    /// mean; null where there were none.
    nlohmann::json json() const;

private:
    uint64_t count_ = 0, held_down_ = 0;
    unsigned lowest_ = 0, highest_ = 0, memory_ = 0, celsius_ = 0;
    double sum_mhz_ = 0, sum_watts_ = 0;
};

/// The driver's management library, opened when it is there: a look takes well below a millisecond, where nvidia-smi
/// takes a process.
class Nvml {
public:
    /// `bus_id` of cuda_device_bus_id(). Without a driver, or with an empty id, nothing is ever read.
    explicit Nvml(const std::string& bus_id, const char* library = "libnvidia-ml.so.1");
    ~Nvml();
    Nvml(const Nvml&) = delete;
    Nvml& operator=(const Nvml&) = delete;

    bool is_there() const { return library_ != nullptr; }
    GpuReading read() const;

private:
    struct Library;
    std::unique_ptr<Library> library_;
};

}  // namespace ambilux
