// The renderer's twin in double precision: a reference for rounding, where a scene has no closed form.
//
// transport/ is compiled a second time with doubles in place of floats (cmake/double_precision.cmake). Paths are
// sampled one after the other, without queues, stages and fusion, and traced by a tree and tests of the twin's own.
// Random numbers are the same as those of the renderers, of 24 bits: at equal seeds the two images differ by what
// rounding does. Only a host runs it, at a half to a fifth of the renderer's speed.
#pragma once

#include <memory>

#include "render/renderer.h"

namespace ambilux {

/// Integrator path, and light and bdpt of variant wavefront. The scene must outlive it. Throws Error(usage) that names
/// a setting that the twin does without.
std::unique_ptr<Renderer> make_twin(const Scene& scene, const RenderSettings& settings);

}  // namespace ambilux
