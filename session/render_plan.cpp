#include "session/render_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace ambilux {

RenderSettings default_settings(const Scene& scene) {
    RenderSettings s;
    s.integrator = scene.integrator.type;
    s.max_depth = scene.integrator.max_depth;
    s.rr_depth = scene.integrator.rr_depth;
    s.may_build_fast = true;
    if (scene.light_picking == "tree") s.light_picking = LightPicks::tree;
    return s;
}

Budget render_budget(std::optional<uint64_t> spp, std::optional<double> time, const Scene& scene,
                     const std::string& prefix) {
    const auto refuse = [&](const std::string& message) { throw Error(ExitCode::usage, prefix + message); };
    if (spp && time) refuse(fmt::format("spp and {}time exclude each other: a render ends by one of them", prefix));
    if (spp && *spp == 0) refuse("spp 0: at least one sample per pixel is needed");
    if (time && !(*time > 0 && std::isfinite(*time))) refuse("time: more than zero seconds are needed");
    if (time) return {0, *time};
    return {spp ? *spp : uint64_t(std::max(1, scene.integrator.spp)), 0};
}

void expect(RenderSettings& settings, const Budget& budget) {
    settings.expected_samples = budget.samples;
    settings.expected_seconds = budget.seconds;
}

RenderPosition first_position(Renderer& renderer) {
    RenderPosition position;
    if (const SelectionStats selection = renderer.stats().selection; !selection.name.empty())
        position.seconds = selection.seconds;
    return position;
}

std::string lost_values(const RenderStats& stats) {
    const auto described = [](const InvalidCounts& counts) {
        return fmt::format("{} NaN, {} Inf, {} negative values", counts.nan, counts.inf, counts.negative);
    };
    std::string text;
    for (const auto& [stage, counts] : stats.invalid_by_stage)
        if (counts.total()) text += fmt::format("stage {} dropped {}; ", stage, described(counts));
    if (text.empty() && stats.invalid.total()) text += fmt::format("{} were dropped; ", described(stats.invalid));
    for (const QueueStats& q : stats.queues)
        if (q.overflow) text += fmt::format("queue {} of capacity {} lost {} items; ", q.name, q.capacity, q.overflow);
    if (!text.empty()) text.resize(text.size() - 2);
    return text;
}

}  // namespace ambilux
