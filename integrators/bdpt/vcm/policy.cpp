#include "integrators/bdpt/vcm/policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "core/error.h"
#include "integrators/bdpt/correlated/correlation_mis.h"
#include "integrators/bdpt/vcm/grid.h"
#include "integrators/registry.h"
#include "scene/scene.h"

namespace ambilux {

template <class Mis>
VcmPolicyOf<Mis> VcmPolicyOf<Mis>::plan(const Scene& scene, const RenderSettings& settings) {
    VcmPolicyOf p{plan_bdpt<Mis>(scene, settings), VcmSettings::plan(settings), {}, 0.0f, 0};
    p.rules.mis.merges = variant_of(settings).traits.merges;
    p.rules.mis.merges_first = p.vcm.first;
    p.rules.directions.deltas_only = !p.rules.mis.competes();
    p.keeps_vertices = !scene.emitters.empty() && p.rules.max_depth >= 2 && !p.rules.singles.on;
    p.waves.iteration_samples = p.vcm.samples;
    p.waves.strategy_merges = p.waves.strategy_depth > 0;
    if (p.rules.connect) p.cache_draws = settings.connections;
    p.one_connection_per_launch |= p.cache_draws == 1;
    const uint64_t keys =
        uint64_t(scene.sensor.crop_width) * scene.sensor.crop_height * p.waves.light_rounds() * p.vcm.samples;
    p.keys = {uint32_t(std::bit_width(p.rules.max_depth)), std::max(1u, uint32_t(std::bit_width(keys - 1))),
              MergeKeys::kLeastTableBits};
    if (p.keys.subpath_bits > MergeKeys::kMostSubpathBits)
        throw Error(ExitCode::usage,
                    fmt::format("merge_samples={}: light subpaths of an iteration are numbered up to {}, and a film of "
                                "{}x{} has {}; choose fewer samples in an iteration",
                                p.vcm.samples, uint64_t(1) << MergeKeys::kMostSubpathBits, scene.sensor.crop_width,
                                scene.sensor.crop_height, keys));
    return p;
}

template <class Mis>
void VcmPolicyOf<Mis>::size_table(double mean_vertices) {
    const uint64_t vertices = uint64_t(std::max(mean_vertices * double(subpaths()), 1.0));
    keys.table_bits =
        std::clamp(uint32_t(std::bit_width(vertices)), MergeKeys::kLeastTableBits, MergeKeys::kMostTableBits);
    waves.iterations_together =
        1u << std::min(MergeKeys::kMostTableBits - keys.table_bits, MergeKeys::kMostIterationBits);
}

template struct VcmPolicyOf<MergingMis>;
template struct VcmPolicyOf<CorrelationMis>;

}  // namespace ambilux
