// --outliers of the command render: its largest samples and its invalid values, each with a command that replays it.
#pragma once

#include "cli/commands.h"
#include "render/replay/outliers.h"

namespace ambilux {

/// `used`: settings as the render used them (used_settings). Prints tables to standard output unless `quiet`, and adds
/// `outliers` and `invalid_values` to the statistics.
void report_outliers(const SampleWatch& watch, const SceneOptions& options, const Scene& scene,
                     const RenderSettings& used, uint32_t count, bool quiet, nlohmann::json& statistics);

}  // namespace ambilux
