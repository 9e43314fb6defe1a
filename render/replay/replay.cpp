#include "render/replay/replay.h"

#include <fmt/format.h>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "core/error.h"
#include "integrators/registry.h"
#include "render/replay/make.h"

namespace ambilux {
namespace {

/// Keeps the structure that rays are traced through.
class WithAccel final : public Replay {
public:
    WithAccel(std::shared_ptr<const void> accel, std::unique_ptr<Replay> replay)
        : accel_(std::move(accel)), replay_(std::move(replay)) {}

    ReplaySample sample(const ReplayRequest& request) const override { return replay_->sample(request); }
    uint32_t light_subpaths() const override { return replay_->light_subpaths(); }
    bool has_light_subpath(uint32_t number) const override { return replay_->has_light_subpath(number); }
    ReplaySubpath light_subpath(uint32_t number, uint32_t sample, bool details,
                                std::vector<ReplayCandidate>& splats) const override {
        return replay_->light_subpath(number, sample, details, splats);
    }

private:
    std::shared_ptr<const void> accel_;
    std::unique_ptr<Replay> replay_;
};

}  // namespace

void check_replay(const RenderSettings& settings) {
    check_settings(settings, variant_of(settings), settings.backend == Backend::cuda);
    if (settings.automatic)
        throw Error(ExitCode::usage,
                    "bdpt.auto=true: which integrator made the sample is up to a pilot; give the settings that "
                    "`ambilux render` printed as its selection");
    for (const char* name : {"path", "light", "bdpt"})
        if (settings.integrator == name) return;
    throw Error(ExitCode::usage, fmt::format("integrator {}: there is no replay of it; path, light and bdpt have one",
                                             settings.integrator));
}

std::unique_ptr<Replay> make_replay(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    check_replay(settings);
    const bool cuda = settings.backend == Backend::cuda;
    const bool device_structure = cuda || settings.accel == AccelKind::cwbvh;
    const auto make = [&](const auto& accel) -> std::unique_ptr<Replay> {
        const HostTracer tracer(accel->tracer());
        return std::make_unique<WithAccel>(accel, settings.integrator == "path"
                                                      ? make_path_replay(scene, settings, tracer)
                                                      : make_bdpt_replay(scene, settings, tracer));
    };
    return device_structure ? make(accels.get<CwbvhAccel>()) : make(accels.get<EmbreeAccel>());
}

}  // namespace ambilux
