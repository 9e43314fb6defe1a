#include "render/replay/replay.h"

#include <fmt/ranges.h>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "backends/fast_cwbvh.h"
#include "core/error.h"
#include "render/replay/make.h"

namespace ambilux {

std::string listed(std::vector<std::string> names) {
    const std::string last = std::move(names.back());
    names.pop_back();
    return names.empty() ? last : fmt::format("{} and {}", fmt::join(names, ", "), last);
}

void check_replay(const RenderSettings& settings) {
    const Variant& variant = variant_of(settings);
    check_settings(settings, variant, settings.backend == Backend::cuda);
    if (settings.automatic)
        throw Error(ExitCode::usage,
                    "bdpt.auto=true: which integrator made the sample is up to a pilot; give the settings that "
                    "`ambilux render` printed as its selection");
    if (settings.light_picking == LightPicks::tree)
        throw Error(ExitCode::usage, "light_picking=tree: a replay picks emitters by the table of the scene alone");
    if (settings.sampler == Sampler::sobol)
        throw Error(ExitCode::usage, "sampler=sobol: a replay has independent numbers alone");
    if (variant.traits.replay != ReplayPairing::no_replay) return;
    const auto have = [](const VariantTraits& v) { return v.replay != ReplayPairing::no_replay; };
    const std::vector<std::string> others = variants_that(have, variant.integrator);
    throw Error(ExitCode::usage, others.empty() ? fmt::format("integrator {}: there is no replay of it; {} have one",
                                                              variant.integrator, listed(integrators_that(have)))
                                                : fmt::format("variant {}: there is no replay of it; {} have one",
                                                              variant.variant, listed(others)));
}

std::unique_ptr<Replay> make_replay(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    check_replay(settings);
    const bool cuda = settings.backend == Backend::cuda;
    const bool device_structure = cuda || settings.accel == AccelKind::cwbvh;
    const auto make = [&](const auto& accel) -> std::unique_ptr<Replay> {
        std::unique_ptr<Replay> replay = replay_of(variant_of(settings))(scene, settings, HostTracer(accel->tracer()));
        replay->accel = accel;
        return replay;
    };
    if (device_structure && settings.build == Build::fast) return make(accels.get<FastCwbvhAccel>());
    return device_structure ? make(accels.get<CwbvhAccel>()) : make(accels.get<EmbreeAccel>());
}

}  // namespace ambilux
