#include "backends/fast_cwbvh.h"

#include "backends/cpu/host_memory.h"
#include "backends/cpu/primitives.h"
#include "backends/fast_build.h"
#include "core/parallel.h"
#include "core/seconds.h"
#include "scene/scene.h"

namespace ambilux {
namespace {

struct HostSteps {
    template <class Step>
    void for_each(const Step& step, uint32_t n) {
        parallel_for(n, [&](uint32_t i) { step(i); }, 512u);
    }
    void sort_pairs(const SortMemory<uint64_t>& m, uint32_t n, uint32_t bits) { sort_pairs_together(m, n, bits); }
    void scan(const ScanMemory&, const uint32_t* in, uint32_t* out, uint32_t n) { scan_together(in, out, n); }
    template <class T>
    std::vector<T> download(const T* from, uint32_t n) {
        return {from, from + n};
    }
    template <class T>
    T* upload(T* to, const std::vector<T>& values) {
        std::copy(values.begin(), values.end(), to);
        return to;
    }
};

}  // namespace

CwbvhArrays build_cwbvh_fast(const SceneView& scene) {
    check_no_groups(scene);
    const auto lay_out = [&](Layout& layout) {
        return FastBuildMemory::lay_out(layout, scene.primitive_count(), host_primitive_bytes());
    };
    Layout plan;
    lay_out(plan);
    HostMemory memory(plan.bytes());
    Layout layout(plan, memory.data());
    const FastBuildMemory m = lay_out(layout);
    HostSteps steps;
    const FastBuild build = plan_fast_build(steps, scene, m);
    check_depth(build);
    CwbvhArrays arrays;
    arrays.nodes.resize(build.nodes);
    arrays.primitives.resize(build.primitives);
    arrays.depth = build.depth;
    write_fast_build(steps, scene, m, build, arrays.nodes.data(), arrays.primitives.data());
    return arrays;
}

FastCwbvhAccel::FastCwbvhAccel(const Scene& scene) {
    const auto start = Clock::now();
    arrays_ = build_cwbvh_fast(scene.view());
    build_seconds_ = seconds_since(start);
}

template <>
std::shared_ptr<const FastCwbvhAccel> SharedAccels::get() {
    return made_once(structures_->fast_cwbvh);
}

}  // namespace ambilux
