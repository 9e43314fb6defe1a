#include "backends/fast_cwbvh.h"

#include <fmt/format.h>

#include "backends/cpu/host_memory.h"
#include "backends/cpu/primitives.h"
#include "backends/fast_build.h"
#include "core/error.h"
#include "core/parallel.h"

namespace ambilux {
namespace {

struct HostSteps {
    template <class Step>
    void for_each(const Step& step, uint32_t n) {
        parallel_for(n, [&](uint32_t i) { step(i); }, 512u);
    }
    void sort_pairs(const SortMemory<uint64_t>& m, uint32_t n, uint32_t bits) { sort_pairs_together(m, n, bits); }
    void scan(const ScanMemory&, const uint32_t* in, uint32_t* out, uint32_t n) { scan_together(in, out, n); }
    uint32_t read(const uint32_t* from) { return *from; }
    void write(uint32_t* to, uint32_t value) { *to = value; }
};

}  // namespace

CwbvhArrays build_cwbvh_fast(const SceneView& scene) {
    const uint32_t primitives = scene.primitive_count();
    const auto lay_out = [&](Layout& layout) {
        return FastBuildMemory::lay_out(layout, primitives, fast_references(primitives), host_primitive_bytes());
    };
    Layout plan;
    lay_out(plan);
    HostMemory memory(plan.bytes());
    Layout layout(plan, memory.data());
    const FastBuildMemory m = lay_out(layout);
    HostSteps steps;
    const FastBuild build = plan_fast_build(steps, scene, m);
    CwbvhArrays arrays;
    arrays.nodes.resize(build.nodes);
    arrays.primitives.resize(build.primitives);
    arrays.depth = build.depth;
    write_fast_build(steps, scene, m, build, arrays.nodes.data(), arrays.primitives.data());
    return arrays;
}

}  // namespace ambilux
