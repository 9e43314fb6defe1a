// What is decided about a render before its first sample and said after its last, however it is asked for.
#pragma once

#include <optional>
#include <string>

#include "session/drive.h"

namespace ambilux {

/// Settings that nothing was said about: the defaults, with the integrator and the depths that the scene asks for.
RenderSettings default_settings(const Scene& scene);

/// Until when to render: `spp`, `time` in seconds or, with neither, the scene's samples. `prefix` stands before the two
/// names in messages. Throws Error(usage).
Budget render_budget(std::optional<uint64_t> spp, std::optional<double> time, const Scene& scene,
                     const std::string& prefix);

/// Tells the renderer what it will be asked for.
void expect(RenderSettings& settings, const Budget& budget);

/// Where a renderer stands before its first sample. Choosing is part of the method bdpt.auto: its time counts.
RenderPosition first_position(Renderer& renderer);

/// The values that were dropped and the items that queues lost, stage by stage; empty if there are none.
std::string lost_values(const RenderStats& stats);

}  // namespace ambilux
