// What a light tracer or bidirectional path tracer does where, decided once by the host.
#pragma once

#include "integrators/integrator.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

template <class Mis>
struct BdptPolicyOf {
    Rules<Mis> rules;
    WavePolicy waves;
    uint32_t cache_draws;            ///< light vertices that an eye vertex draws from a cache; 0: variants without one
    bool coherent_draws;             ///< LightVertexSource
    bool one_connection_per_launch;  ///< else sums of a path depend on the order of threads
    bool traces_connections;         ///< on a device: connect_vertices traces its shadow rays itself
    bool keeps_vertices = false;     ///< the method keeps light vertices, of all waves, and these need not

    bool light_subpaths() const { return rules.splat || rules.connect || keeps_vertices; }
    bool wave_keeps_vertices() const { return rules.connect && !keeps_vertices; }
    /// Light subpaths leave no vertices for connections of their wave.
    BdptPolicyOf of_light_side() const {
        BdptPolicyOf p = *this;
        p.rules.connect = wave_keeps_vertices();
        return p;
    }
    /// The same with another model.
    template <class Other>
    BdptPolicyOf<Other> with(const Other& mis) const {
        return {rules.with(mis),    waves,         cache_draws, coherent_draws, one_connection_per_launch,
                traces_connections, keeps_vertices};
    }
};
using BdptPolicy = BdptPolicyOf<BidirectionalMis>;

/// What `settings` ask of a scene (integrators light and bdpt). Throws Error(usage) when subpaths might never end.
BdptPolicy plan_bdpt(const Scene& scene, const RenderSettings& settings);

/// Throws Error(usage) that says `why` unless there is one light subpath per pixel and sample.
void need_one_light_subpath(const RenderSettings& settings, const char* why);

/// The same for a model that adds to BidirectionalMis, and is made of one.
template <class Mis>
BdptPolicyOf<Mis> plan_bdpt(const Scene& scene, const RenderSettings& settings) {
    const BdptPolicy p = plan_bdpt(scene, settings);
    BdptPolicyOf<Mis> own = p.with(Mis{p.rules.mis});
    if constexpr (requires { own.rules.mis.sobol; }) {
        own.rules.mis.sobol = settings.sampler == Sampler::sobol;
        own.rules.mis.light_subpaths_per_tile = p.waves.light_subpaths_per_tile;
    }
    return own;
}

/// Names of strategies that this render does without.
std::vector<std::string> skipped_strategies(const Scene& scene, const BdptPolicy& policy);
template <class Mis>
std::vector<std::string> skipped_strategies(const Scene& scene, const BdptPolicyOf<Mis>& policy) {
    return skipped_strategies(scene, policy.with(BidirectionalMis(policy.rules.mis)));
}

}  // namespace ambilux
