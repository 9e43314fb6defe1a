#include "experiments/run_maker.h"

#include <algorithm>

#include "integrators/registry.h"
#include "session/statistics.h"

namespace ambilux {

std::unique_ptr<Renderer> OwnRuns::make(const RenderOf& render, const RenderStats& earlier) {
    RenderSettings made = render.settings;
    // What the first part chose, even if this machine is another or busier.
    if (made.automatic && !earlier.selection.name.empty()) {
        made.automatic = false;
        for (const auto& [key, value] : earlier.selection.settings) hooks_.apply_setting(made, key, value);
    }
    for (const Checkpoint& c : config_.checkpoints()) {
        made.expected_samples = std::max(made.expected_samples, c.samples);
        made.expected_seconds = std::max(made.expected_seconds, c.seconds);
    }
    return hooks_.make_renderer(render.scene.scene, made);
}

MethodNames OwnRuns::names(const RenderOf& render, const RenderStats& stats) const {
    const RenderSettings used = used_settings(render.settings, stats);
    return {used.integrator, used.variant, setting_text(used, "estimator"), method_text(used), bias_text(used)};
}

nlohmann::json OwnRuns::statistics(const RenderOf& render, const RenderStats& stats) const {
    return stats_json(render.scene.scene, render.settings, stats, render.scene.load_seconds);
}

Attributes OwnRuns::attributes(const RenderOf& render, const RenderStats& stats) const {
    return image_attributes(render.scene.scene, render.settings, stats);
}

}  // namespace ambilux
