#include "session/devices.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "backends/optix.h"

namespace ambilux {
namespace {

std::string known_or(const std::string& text, const char* other) { return text.empty() ? other : text; }

std::string device_text(const CudaDevice& d) {
    if (!d.problem.empty()) return fmt::format("device {}: {} cannot be used: {}\n", d.number, d.name, d.problem);
    const bool compiled = d.kernels.kind == KernelKind::ptx;
    return fmt::format("device {}: {}, compute capability {}, {} MiB, {}: {}{}\n", d.number, d.name,
                       capability_text(d.capability), d.memory_bytes >> 20, d.bus_id, kernels_text(d.kernels),
                       compiled ? ", which the driver compiles at the first start" : "");
}

}  // namespace

nlohmann::json devices_json(const CudaReport& r) {
    nlohmann::json devices = nlohmann::json::array();
    for (const CudaDevice& d : r.devices)
        devices.push_back({{"number", d.number},
                           {"name", d.name},
                           {"bus_id", d.bus_id},
                           {"compute_capability", capability_text(d.capability)},
                           {"memory_bytes", d.memory_bytes},
                           {"kernels", kernels_text(d.kernels)},
                           {"problem", d.problem}});
    return {{"toolkit", r.toolkit}, {"kernels", built_text(r.built)},
            {"driver", r.driver},   {"driver_cuda", r.driver_cuda},
            {"graphs", r.graphs},   {"optix", kOptixBuilt},
            {"problem", r.problem}, {"devices", devices}};
}

std::string devices_text(const CudaReport& r) {
    if (r.toolkit.empty()) return fmt::format("CUDA: {}\n", r.problem);
    std::string text = fmt::format("CUDA {}: kernels are {}; driver {}, which knows CUDA {}\n", r.toolkit,
                                   built_text(r.built), known_or(r.driver, "none"), known_or(r.driver_cuda, "none"));
    if (!r.driver_cuda.empty() && !r.graphs)
        text += "graphs: the driver is older than CUDA 12.8, so that kernels are launched one by one (graph=false)\n";
    text += kOptixBuilt ? "OptiX: built in (accel=optix)\n" : "OptiX: not built in\n";
    if (!r.problem.empty()) text += fmt::format("no device: {}\n", r.problem);
    for (const CudaDevice& d : r.devices) text += device_text(d);
    return text;
}

}  // namespace ambilux
