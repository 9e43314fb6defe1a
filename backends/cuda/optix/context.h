// The driver's OptiX: its library, a context on the current device, and errors with what the driver logged.
#pragma once

#include <optix.h>

#include <string>

namespace ambilux {

class OptixContext {
public:
    /// Throws Error(device) without the library, or if it does not know the interface that this was built with.
    OptixContext();
    ~OptixContext();
    OptixContext(const OptixContext&) = delete;
    OptixContext& operator=(const OptixContext&) = delete;

    OptixDeviceContext get() const { return context_; }
    /// Throws Error(device) with `what`, the error and the end of the driver's log unless `result` is OPTIX_SUCCESS.
    /// With AMBILUX_OPTIX_LOG=1 the log is shown as well; with 2 the driver also checks what it is given, and waits
    /// after every launch.
    void check(OptixResult result, const char* what) const;

private:
    std::string log_;
    OptixDeviceContext context_ = nullptr;
};

}  // namespace ambilux
