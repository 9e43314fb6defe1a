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
    const std::string or_else =
        fmt::format("; {} needs a driver from {} on. Or take accel=cwbvh", interface_text(), first_driver());
    switch (loaded) {
        case OPTIX_SUCCESS: return;
        case OPTIX_ERROR_LIBRARY_NOT_FOUND:
            throw Error(ExitCode::device,
                        "accel=optix: libnvoptix.so.1 was not found. It comes with NVIDIA's driver, "
                        "in a container with NVIDIA_DRIVER_CAPABILITIES=graphics or all" +
                            or_else);
        case OPTIX_ERROR_ENTRY_SYMBOL_NOT_FOUND:
            throw Error(ExitCode::device,
                        "accel=optix: libnvoptix.so.1 has no optixQueryFunctionTable: it is not of a driver" + or_else);
        case OPTIX_ERROR_UNSUPPORTED_ABI_VERSION:
            throw Error(ExitCode::device, fmt::format("accel=optix: the driver's libnvoptix.so.1 does not know the "
                                                      "interface of the headers that this was built with (error {})",
                                                      int(loaded)) +
                                              or_else);
        default:
            throw Error(ExitCode::device,
                        fmt::format("accel=optix: libnvoptix.so.1 answers error {}", int(loaded)) + or_else);
    }
}

void receive(unsigned level, const char* tag, const char* message, void* log) {
    static_cast<OptixLog*>(log)->add(fmt::format("[{}][{}] {}", level, tag, message));
}

}  // namespace

int OptixLog::shown() {
    const char* const value = std::getenv("AMBILUX_OPTIX_LOG");
    return value ? std::atoi(value) : 0;
}

void OptixLog::add(const std::string& line) {
    if (line.empty()) return;
    if (shown() > 0) log_info("OptiX: " + line);
    const std::lock_guard lock(mutex_);
    text_ += line + (line.back() == '\n' ? "" : "\n");
    if (text_.size() > kKeptLog) text_.erase(0, text_.size() - kKeptLog);
}

std::string OptixLog::text() const {
    const std::lock_guard lock(mutex_);
    return text_;
}

OptixContext::OptixContext() {
    load_library();
    if (const cudaError_t error = cudaFree(nullptr); error != cudaSuccess)  // starts CUDA's context
        throw Error(ExitCode::device, std::string("accel=optix: ") + cudaGetErrorString(error));
    OptixDeviceContextOptions options = {};
    options.logCallbackFunction = receive;
    options.logCallbackData = &log_;
    options.logCallbackLevel = 4;
    if (OptixLog::shown() > 1) options.validationMode = OPTIX_DEVICE_CONTEXT_VALIDATION_MODE_ALL;
    check(optixDeviceContextCreate(nullptr, &options, &context_), "its context");
}

OptixContext::~OptixContext() {
    if (context_) optixDeviceContextDestroy(context_);
}

void OptixContext::check(OptixResult result, const char* what) const {
    if (result == OPTIX_SUCCESS) return;
    const cudaError_t cuda = cudaGetLastError();
    throw Error(ExitCode::device, fmt::format("accel=optix: {}: {} ({}), {}{}. {} answers:\n{}", what,
                                              optixGetErrorName(result), int(result), optixGetErrorString(result),
                                              cuda ? fmt::format("; CUDA: {}", cudaGetErrorString(cuda)) : "",
                                              interface_text(), log_.text()));
}

}  // namespace ambilux
