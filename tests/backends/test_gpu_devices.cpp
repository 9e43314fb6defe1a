// libs: ambilux_render ambilux_backends
// labels: gpu
// What is said of CUDA devices where there are some.
#include "backends/cuda_device.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

TEST_CASE("a device that renders is listed with its capability and its kernels") {
    if (!device()) return;
    const CudaReport r = cuda_report();
    CHECK(r.problem.empty());
    CHECK_FALSE(r.toolkit.empty());
    CHECK_FALSE(r.driver_cuda.empty());
    REQUIRE(int(r.devices.size()) == cuda_device_count());
    bool current = false;
    for (const CudaDevice& d : r.devices) {
        INFO(d.name << ": " << d.problem);
        CHECK(d.capability >= 80);
        CHECK(d.memory_bytes > 0);
        // What is predicted is what the driver finds.
        CHECK((d.kernels.kind == KernelKind::none) == !d.problem.empty());
        current |= d.bus_id == cuda_device_bus_id();
    }
    CHECK(current);
    CHECK(cuda_kernels().kind != KernelKind::none);
    CHECK(cuda_start_seconds() > 0);
}

TEST_CASE("a device that is not there is refused by its number") {
    if (!device()) return;
    CHECK_THROWS_WITH(use_cuda_device(99), ContainsSubstring("99"));
}
