#include "backends/cuda/optix/context.h"

#include <cuda_runtime_api.h>
#include <fmt/format.h>
#include <optix_function_table_definition.h>
#include <optix_stubs.h>

#include <cstdlib>

#include "core/error.h"
#include "core/log.h"

namespace ambilux {
namespace {

constexpr size_t kKeptLog = 6000;

std::string interface_text() {
    return fmt::format("OptiX {}.{} (interface {})", OPTIX_VERSION / 10000, OPTIX_VERSION / 100 % 100,
                       OPTIX_ABI_VERSION);
}

/// Drivers that brought the interface of the headers: by NVIDIA's release notes.
int first_driver() {
    return OPTIX_VERSION >= 90100 ? 590 : OPTIX_VERSION >= 90000 ? 570 : OPTIX_VERSION >= 80100 ? 555 : 535;
}

/// Once in a process.
void load_library() {
    static const OptixResult loaded = optixInit();
    if (loaded == OPTIX_SUCCESS) return;
    const std::string why =
        loaded == OPTIX_ERROR_LIBRARY_NOT_FOUND
            ? "was not found: it comes with NVIDIA's driver, in a container with NVIDIA_DRIVER_CAPABILITIES=graphics"
        : loaded == OPTIX_ERROR_UNSUPPORTED_ABI_VERSION ? "is of a driver that does not know the interface"
                                                        : "does not answer";
    throw Error(ExitCode::device,
                fmt::format("accel=optix: libnvoptix.so.1 {} (error {}). {} needs a driver from {} on; or take "
                            "accel=cwbvh",
                            why, int(loaded), interface_text(), first_driver()));
}

int shown() {
    const char* const value = std::getenv("AMBILUX_OPTIX_LOG");
    return value ? std::atoi(value) : 0;
}

/// Of one thread: a context belongs to one renderer.
void receive(unsigned level, const char* tag, const char* message, void* log) {
    const std::string line = fmt::format("[{}][{}] {}", level, tag, message);
    if (shown() > 0) log_info("OptiX: " + line);
    std::string& text = *static_cast<std::string*>(log);
    text += line + "\n";
    if (text.size() > kKeptLog) text.erase(0, text.size() - kKeptLog);
}

}  // namespace

OptixContext::OptixContext() {
    load_library();
    if (const cudaError_t error = cudaFree(nullptr); error != cudaSuccess)  // starts CUDA's context
        throw Error(ExitCode::device, std::string("accel=optix: ") + cudaGetErrorString(error));
    OptixDeviceContextOptions options = {};
    options.logCallbackFunction = receive;
    options.logCallbackData = &log_;
    options.logCallbackLevel = 4;
    if (shown() > 1) options.validationMode = OPTIX_DEVICE_CONTEXT_VALIDATION_MODE_ALL;
    check(optixDeviceContextCreate(nullptr, &options, &context_), "its context");
}

OptixContext::~OptixContext() {
    if (context_) optixDeviceContextDestroy(context_);
}

void OptixContext::check(OptixResult result, const char* what) const {
    if (result == OPTIX_SUCCESS) return;
    const cudaError_t cuda = cudaGetLastError();
    throw Error(ExitCode::device,
                fmt::format("accel=optix: {}: {} ({}), {}{}. {} answers:\n{}", what, optixGetErrorName(result),
                            int(result), optixGetErrorString(result),
                            cuda ? fmt::format("; CUDA: {}", cudaGetErrorString(cuda)) : "", interface_text(), log_));
}

}  // namespace ambilux
