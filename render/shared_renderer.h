// Renderers one after the other of a scene whose geometry stays.
#pragma once

#include "accel/shared_accels.h"
#include "render/renderer.h"

namespace ambilux {

/// make_renderer() with structures for rays that outlive the renderer. Between two renderers the sensor may change,
/// and nothing else of the scene.
std::unique_ptr<Renderer> make_renderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

}  // namespace ambilux
