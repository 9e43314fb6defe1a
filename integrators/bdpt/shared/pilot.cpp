#include "integrators/bdpt/shared/pilot.h"

#include <atomic>

#include "core/parallel.h"
#include "integrators/feature_levels.h"
#include "transport/subpath/start.h"
#include "transport/subpath/trace.h"

namespace ambilux {
namespace {

/// Counts the vertices where connections may start.
struct CountVertices {
    uint32_t& count;
    uint32_t max_depth;
    const RandomNumbers& subpath_numbers;

    RandomNumbers numbers() const { return subpath_numbers; }
    void add(const Candidate<BidirectionalMis>&) const {}
    void at(const Vertex<BidirectionalMis>&, const Subpath<BidirectionalMis>& path, const RandomNumbers&) const {
        count += path.depth + 2 <= max_depth;
    }
    bool valid(Rgb) const { return true; }
};

}  // namespace

template <Features F>
double mean_light_vertices(const SceneView& scene, const HostTracer& tracer, const Rules<BidirectionalMis>& rules,
                           uint64_t seed) {
    std::atomic<uint64_t> vertices = 0;
    parallel_for(
        kPilotSubpaths,
        [&](uint32_t i) {
            const RandomNumbers numbers = {{seed, i, 0, Stream::pilot}};
            uint32_t count = 0;
            const CountVertices sink = {count, rules.max_depth, numbers};
            EmissionSample e;
            Subpath<BidirectionalMis> first;
            if (!start_light_subpath<F>(scene, rules, numbers, sink, e, first)) return;
            trace_subpath<F>(
                scene, rules, Side::light, rules.longest(Side::light), first, kInfinity,
                [&](const auto& path, float tmax) { return end_of_ray<F>(scene, tracer, path, tmax, numbers); }, sink);
            vertices.fetch_add(count, std::memory_order_relaxed);
        },
        64u);
    return double(vertices.load()) / kPilotSubpaths;
}

#define AMBILUX_LEVEL(F)                                                                                        \
    template double mean_light_vertices<F>(const SceneView&, const HostTracer&, const Rules<BidirectionalMis>&, \
                                           uint64_t);
AMBILUX_LEVEL(kDiffuseFeatures)
AMBILUX_LEVEL(kUntexturedFeatures)
AMBILUX_LEVEL(kTriangleFeatures)
AMBILUX_LEVEL(kMaskedFeatures)
AMBILUX_LEVEL(kCommonFeatures)
AMBILUX_LEVEL(kFlatFeatures)
AMBILUX_LEVEL(kAllFeatures)
#undef AMBILUX_LEVEL

}  // namespace ambilux
