// Statistics of a render that was made in parts, and of which a part may have been made by another process.
#pragma once

#include <nlohmann/json.hpp>

#include "render/renderer.h"

namespace ambilux {

/// Adds to `total` what happened between `before` and `now`: counts, times and rays; of queues the highest peak. The
/// rest is taken from `now`.
void add_part(RenderStats& total, const RenderStats& before, const RenderStats& now);

/// Of devices that rendered at the same time, each with the name of its host, and of an earlier part. `hosts`: names of
/// hosts are stated even where all devices are alike.
RenderStats sum_of_devices(RenderStats earlier, const std::vector<std::pair<std::string, RenderStats>>& devices,
                           bool hosts);

/// All fields, and back.
nlohmann::json save_stats(const RenderStats& stats);
RenderStats restore_stats(const nlohmann::json& json);

}  // namespace ambilux
