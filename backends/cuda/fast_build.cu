// The steps of the fast builder as kernels. Compiled without contraction of products and sums
// (backends/CMakeLists.txt), so that a device builds what a host builds, to the bit.
#include "backends/fast_build.h"

#include "backends/cuda/device_scene.h"
#include "backends/cuda/primitives.h"
#include "backends/fast_cwbvh.h"
#include "core/seconds.h"

namespace ambilux {
namespace {

constexpr uint32_t kBlock = 128;

template <class Step>
__global__ void __launch_bounds__(kBlock) run_step(Step step, uint32_t n) {
    const uint32_t i = blockIdx.x * kBlock + threadIdx.x;
    if (i < n) step(i);
}

/// On the default stream.
struct DeviceSteps {
    template <class Step>
    void for_each(const Step& step, uint32_t n) {
        if (n == 0) return;
        run_step<Step><<<(n - 1) / kBlock + 1, kBlock>>>(step, n);
        cuda_check(cudaGetLastError(), "building the structure");
    }
    void sort_pairs(const SortMemory<uint64_t>& m, uint32_t n, uint32_t bits) {
        sort_pairs_on_device(m, n, bits, nullptr);
    }
    void scan(const ScanMemory& m, const uint32_t* in, uint32_t* out, uint32_t n) {
        scan_on_device(m, in, out, n, nullptr);
    }
    template <class T>
    std::vector<T> download(const T* from, uint32_t n) {
        std::vector<T> values(n);
        DeviceMemory::get(values.data(), from, n * sizeof(T));
        return values;
    }
    template <class T>
    T* upload(T* to, const std::vector<T>& values) {
        DeviceMemory::put(to, values.data(), values.size() * sizeof(T));
        return to;
    }
};

}  // namespace

DeviceFastCwbvh::DeviceFastCwbvh(const SceneView& scene) {
    const auto start = Clock::now();
    check_no_groups(scene);
    const auto lay_out = [&](Layout& layout) {
        return FastBuildMemory::lay_out(layout, scene.primitive_count(), device_primitive_bytes());
    };
    Layout plan;
    lay_out(plan);
    DeviceBuffer<std::byte> memory(plan.bytes(), "memory of the fast builder");
    Layout layout(plan, memory.data());
    const FastBuildMemory m = lay_out(layout);
    DeviceSteps steps;
    const FastBuild build = plan_fast_build(steps, scene, m);
    check_depth(build);
    nodes_ = DeviceBuffer<CwbvhNode>(build.nodes, "acceleration structure on the device");
    primitives_ = DeviceBuffer<CwbvhPrimitive>(build.primitives, "primitives on the device");
    depth_ = build.depth;
    write_fast_build(steps, scene, m, build, nodes_.data(), primitives_.data());
    wait_for_default_stream("building the structure");
    peak_bytes_ = plan.bytes() + bytes();
    build_seconds_ = seconds_since(start);
}

uint64_t DeviceFastCwbvh::predicted_peak_bytes(const SceneView& scene) {
    return fast_build_peak_bytes(scene.primitive_count(), device_primitive_bytes());
}

FastOnDevice build_cwbvh_fast_on_device(const Scene& scene) {
    const DeviceScene device_scene(scene);
    const DeviceFastCwbvh first(device_scene.view());  // loads kernels
    const DeviceFastCwbvh fast(device_scene.view());
    return {fast.arrays(), fast.build_seconds(), fast.peak_bytes()};
}

template <>
std::shared_ptr<const DeviceFastCwbvh> SharedAccels::get() {
    return once(device_fast_cwbvh_,
                [&] { return std::make_shared<const DeviceFastCwbvh>(get<DeviceScene>()->view()); });
}

}  // namespace ambilux
