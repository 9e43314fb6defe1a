// What stands for the CUDA backend in a build without CUDA.
#include "backends/cuda/bench_queues.h"
#include "backends/cuda/bench_rays.h"
#include "backends/cuda/mean_on_device.h"
#include "backends/cuda_device.h"
#include "backends/fast_cwbvh.h"
#include "backends/trace_on_device.h"
#include "core/error.h"

namespace ambilux {
namespace {

Error not_built() { return {ExitCode::device, "this program was built without CUDA"}; }

}  // namespace

bool cuda_device_present() { return false; }

double cuda_start_seconds() { return 0; }

std::string why_no_cuda_device() {
    return "this program was built without CUDA: install the CUDA toolkit and build again, or take backend cpu";
}

std::string cuda_device_name() { return {}; }

std::string cuda_device_bus_id() { return {}; }

int cuda_device_count() { return 0; }

void use_cuda_device(int) { throw not_built(); }

KernelChoice cuda_kernels() { return {}; }

bool cuda_graphs_choose() { return false; }

CudaReport cuda_report() {
    CudaReport report;
    report.problem = why_no_cuda_device();
    return report;
}

void copy_to_host(const DeviceImage&, std::vector<float>&) { throw not_built(); }

std::vector<Hit> trace_on_device(const Scene&, const std::vector<Ray>&, bool, bool, bool) { throw not_built(); }

FastOnDevice build_cwbvh_fast_on_device(const Scene&) { throw not_built(); }

std::vector<std::vector<KernelTiming>> time_rays_on_device(const Scene&, const CwbvhArrays&,
                                                           const std::vector<RayBatch>&, int, int) {
    throw not_built();
}
std::vector<std::vector<KernelTiming>> time_rays_on_device(const Scene&, const PairArrays&,
                                                           const std::vector<RayBatch>&, int, int) {
    throw not_built();
}

OptixAnswers trace_by_optix(const Scene&, const std::vector<Ray>&, bool) { throw not_built(); }

OptixTimings time_rays_by_optix(const Scene&, const std::vector<RayBatch>&, int, int) { throw not_built(); }

std::vector<QueueTiming> time_queues_on_device(const Scene&, uint32_t, const std::vector<PathHit>&,
                                               const std::vector<PathRay>&, int, int) {
    throw not_built();
}

}  // namespace ambilux
