// What a path tracer does where, decided once by the host.
#pragma once

#include "integrators/integrator.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

struct PathPolicy {
    Rules<UnidirectionalMis> rules;
    WavePolicy waves;
};
/// Throws Error(usage) when paths might never end.
PathPolicy plan_path(const Scene& scene, const RenderSettings& settings);
/// Names of stages that this render does without.
std::vector<std::string> skipped_path_parts(const Scene& scene, const Rules<UnidirectionalMis>& rules);

}  // namespace ambilux
