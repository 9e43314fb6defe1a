// What stands for OptiX in a build with CUDA and without it.
#include "backends/cuda/bench_rays.h"
#include "backends/cuda/device_optix.h"
#include "backends/optix.h"
#include "backends/trace_on_device.h"
#include "core/error.h"

namespace ambilux {
namespace {

Error not_built() { return {ExitCode::usage, kWhyNoOptix}; }

}  // namespace

struct DeviceOptix::Parts {};

DeviceOptix::DeviceOptix(const Scene&, const SceneView&, uint64_t) { throw not_built(); }
DeviceOptix::~DeviceOptix() = default;
void DeviceOptix::take(const HandedRays&, cudaStream_t) { throw not_built(); }
void DeviceOptix::trace(bool, cudaStream_t) const { throw not_built(); }

OptixAnswers trace_by_optix(const Scene&, const std::vector<Ray>&, bool) { throw not_built(); }
OptixTimings time_rays_by_optix(const Scene&, const std::vector<RayBatch>&, int, int) { throw not_built(); }

}  // namespace ambilux
