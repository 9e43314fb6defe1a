// Renderers of a family of integrators, compiled once for each level of features and backend
// (cmake/instantiate.cmake).
#pragma once

#include "accel/shared_accels.h"
#include "integrators/feature_levels.h"
#include "render/renderer.h"
#include "stages/stage.h"

namespace ambilux {

template <class Family, Features F>
std::unique_ptr<Renderer> make_on_cpu(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

template <class Family, Features F>
std::unique_ptr<Renderer> make_on_cuda(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

/// fuse=none is compiled for the level of all features only.
template <Features F, Fusion kFused, class Make>
std::unique_ptr<Renderer> with_fusion(const RenderSettings& settings, Make make) {
    if constexpr (F == kAllFeatures)
        if (settings.fuse == Fuse::none) return make.template operator()<Fusion{}>();
    return make.template operator()<kFused>();
}

}  // namespace ambilux
