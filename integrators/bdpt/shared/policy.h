// What a light tracer or bidirectional path tracer does where, decided once by the host.
#pragma once

#include "integrators/integrator.h"
#include "transport/mis/bidirectional.h"

namespace ambilux {

struct BdptPolicy {
    Rules<BidirectionalMis> rules;
    WavePolicy waves;
    uint32_t cache_draws;            ///< light vertices that an eye vertex draws from a cache; 0: variants without one
    bool coherent_draws;             ///< LightVertexSource
    bool one_connection_per_launch;  ///< else sums of a path depend on the order of threads
    bool traces_connections;         ///< on a device: connect_vertices traces its shadow rays itself

    bool light_subpaths() const { return rules.splat || rules.connect; }
};

/// What `settings` ask of a scene (integrators light and bdpt). Throws Error(usage) when subpaths might never end.
BdptPolicy plan_bdpt(const Scene& scene, const RenderSettings& settings);

/// Throws Error(usage) that says `why` unless there is one light subpath per pixel and sample.
void need_one_light_subpath(const RenderSettings& settings, const char* why);

/// Names of strategies that this render does without.
std::vector<std::string> skipped_strategies(const Scene& scene, const BdptPolicy& policy);

}  // namespace ambilux
