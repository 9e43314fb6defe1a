#include "integrators/bidirectional/pilot.h"

#include <atomic>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "core/parallel.h"
#include "render/feature_levels.h"

namespace ambilux {

template <Features F, class Tracer>
double mean_light_vertices(const SceneView& scene, const Tracer& tracer, const BidirectionalPolicy& policy,
                           uint64_t seed) {
    std::atomic<uint64_t> vertices = 0;
    parallel_for(
        kPilotWalks,
        [&](uint32_t i) {
            const RngKey key = {seed, i, 0, Stream::pilot};
            const Vec4f direction = random_floats(key, kEmissionBlock + 1);
            EmissionSample e;
            if (!sample_emission<F>(scene, random_floats(key, kEmissionBlock), {direction.x, direction.y}, e)) return;
            uint32_t left = 0;
            for (Walk w = start_light_walk(e);;) {
                Hit hit;
                Ray ray = {w.o, kInfinity, w.d, alpha_seed(key, w.depth, false)};
                if (!tracer.template closest<F>(scene, ray, hit)) break;
                const WalkVertex y = light_vertex<F>(scene, policy.mis, w, hit.prim, hit.u, hit.v);
                if (w.depth + 2 > policy.max_depth) break;
                left += bsdf_is_smooth(y.scattering.bsdf);
                if (!scatter_walk<F>(policy.mis, y, random_floats(key, light_scatter_block(w.depth)),
                                     TransportMode::importance, policy.rr_depth, w))
                    break;
            }
            vertices.fetch_add(left, std::memory_order_relaxed);
        },
        64u);
    return double(vertices.load()) / kPilotWalks;
}

template double mean_light_vertices<kDiffuseFeatures>(const SceneView&, const CwbvhTracer&, const BidirectionalPolicy&,
                                                      uint64_t);
template double mean_light_vertices<kUntexturedFeatures>(const SceneView&, const CwbvhTracer&,
                                                         const BidirectionalPolicy&, uint64_t);
template double mean_light_vertices<kTriangleFeatures>(const SceneView&, const CwbvhTracer&, const BidirectionalPolicy&,
                                                       uint64_t);
template double mean_light_vertices<kMaskedFeatures>(const SceneView&, const CwbvhTracer&, const BidirectionalPolicy&,
                                                     uint64_t);
template double mean_light_vertices<kAllFeatures>(const SceneView&, const CwbvhTracer&, const BidirectionalPolicy&,
                                                  uint64_t);
template double mean_light_vertices<kDiffuseFeatures>(const SceneView&, const EmbreeTracer&, const BidirectionalPolicy&,
                                                      uint64_t);
template double mean_light_vertices<kTriangleFeatures>(const SceneView&, const EmbreeTracer&,
                                                       const BidirectionalPolicy&, uint64_t);
template double mean_light_vertices<kAllFeatures>(const SceneView&, const EmbreeTracer&, const BidirectionalPolicy&,
                                                  uint64_t);

}  // namespace ambilux
