// Renderers of all variants of integrators, compiled once for each level of features and backend
// (cmake/instantiate.cmake).
#pragma once

#include "accel/shared_accels.h"
#include "backends/fusion.h"
#include "core/error.h"
#include "integrators/feature_levels.h"
#include "render/renderer.h"

namespace ambilux {

template <class Variant, Features F>
std::unique_ptr<Renderer> make_on_cpu(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

template <class Variant, Features F>
std::unique_ptr<Renderer> make_on_cuda(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

/// The template behind a variant: IntegratorOf<Variant>::Type<Features, Tracer, Fusion>.
template <class Variant>
struct IntegratorOf;

/// A variant as it is compiled for one level of features.
struct CompiledRenderer {
    using Make = std::unique_ptr<Renderer> (*)(const Scene&, const RenderSettings&, SharedAccels&);

    const char *integrator, *variant;
    Features level;
    Make cpu, cuda;  ///< null where the backend is built without this level
};

/// Levels of one variant follow each other from the smallest on; the last holds all features.
const std::vector<CompiledRenderer>& compiled_renderers();

/// fuse=none is compiled for the level of all features only; with kLeftOut not at all, and then refused.
template <Features F, Fusion kFused, bool kLeftOut = false, class Make>
std::unique_ptr<Renderer> with_fusion(const RenderSettings& settings, Make make) {
    if constexpr (F == kAllFeatures)
        if (settings.fuse == Fuse::none) {
            if constexpr (kLeftOut)
                throw Error(ExitCode::usage,
                            "fuse=none: this build has no such kernels, as wheels and those with "
                            "AMBILUX_CUDA_OPTIMISE=OFF; scripts/build.sh makes one that has");
            else
                return make.template operator()<kNoFusion>();
        }
    if constexpr (F.sampling)
        if (settings.fuse == Fuse::none)
            throw Error(ExitCode::usage, settings.sampler == Sampler::sobol
                                             ? "fuse=none: there are no such kernels with sampler=sobol"
                                             : "fuse=none: there are no such kernels with light_picking=tree");
    return make.template operator()<kFused>();
}

}  // namespace ambilux
