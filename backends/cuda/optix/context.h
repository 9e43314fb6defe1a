// The driver's OptiX: its library, a context on the current device, and errors with what the driver logged.
#pragma once

#include <optix.h>

#include <mutex>
#include <string>

namespace ambilux {

/// The last lines that the driver wrote. With AMBILUX_OPTIX_LOG=1 they are shown as well; with 2 the driver also checks
/// what it is given, and waits after every launch.
class OptixLog {
public:
    static int shown();
    void add(const std::string& line);
    std::string text() const;

private:
    mutable std::mutex mutex_;
    std::string text_;
};

class OptixContext {
public:
    /// Throws Error(device) without the library, or if it does not know the interface that this was built with.
    OptixContext();
    ~OptixContext();
    OptixContext(const OptixContext&) = delete;
    OptixContext& operator=(const OptixContext&) = delete;

    OptixDeviceContext get() const { return context_; }
    OptixLog& log() const { return log_; }
    /// Throws Error(device) with `what`, the error and the log unless `result` is OPTIX_SUCCESS.
    void check(OptixResult result, const char* what) const;

private:
    mutable OptixLog log_;
    OptixDeviceContext context_ = nullptr;
};

}  // namespace ambilux
