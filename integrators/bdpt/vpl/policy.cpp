#include "integrators/bdpt/vpl/policy.h"

#include <fmt/format.h>

#include "core/error.h"
#include "integrators/registry.h"
#include "scene/scene.h"

namespace ambilux {

VplPolicy VplPolicy::plan(const Scene& scene, const RenderSettings& settings) {
    VplPolicy p{plan_bdpt<VplMis>(scene, settings), VplSettings::plan(settings), 0};
    const VplSettings& vpl = p.vpl;
    p.rules.directions.deltas_only = true;
    if (vpl.clamp > 0.0f) p.rules.mis.inverse_bound = scene.bounds_radius * scene.bounds_radius / vpl.clamp;
    p.keeps_vertices = p.rules.connect;
    p.cache_draws = vpl.draws ? vpl.draws : ~0u;
    p.one_connection_per_launch |= p.cache_draws == 1;
    const uint64_t slots = uint64_t(scene.sensor.crop_width) * scene.sensor.crop_height * vpl.samples,
                   rounds = (vpl.subpaths + slots - 1) / slots;
    if (rounds > kMostLightRounds)
        throw Error(ExitCode::usage,
                    fmt::format("vpl_subpaths={}: an iteration of {} samples has at most {} light subpaths a pixel, "
                                "{} with a film of {}x{}; choose fewer light subpaths or more vpl_samples",
                                vpl.subpaths, vpl.samples, kMostLightRounds * vpl.samples, slots * kMostLightRounds,
                                scene.sensor.crop_width, scene.sensor.crop_height));
    p.waves.light_subpaths_per_tile = uint32_t(rounds) * kTilePixels;
    p.waves.iteration_light_subpaths = vpl.subpaths;
    p.waves.iteration_samples = vpl.samples;
    return p;
}

}  // namespace ambilux
