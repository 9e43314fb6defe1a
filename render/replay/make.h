// Replays by integrator.
#pragma once

#include "accel/host_tracer.h"
#include "render/replay/replay.h"

namespace ambilux {

/// Integrator path, with its variants.
std::unique_ptr<Replay> make_path_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer);
/// Integrators light and bdpt, with their variants.
std::unique_ptr<Replay> make_bdpt_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer);

}  // namespace ambilux
