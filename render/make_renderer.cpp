#include <fmt/format.h>

#include <cstdlib>
#include <mutex>
#include <set>

#include "backends/cuda_device.h"
#include "backends/optix.h"
#include "core/error.h"
#include "core/log.h"
#include "integrators/registry.h"
#include "render/make_on_backend.h"
#include "render/selection.h"
#include "render/shared_renderer.h"
#include "render/twin/twin.h"
#include "scene/light_tree.h"

namespace ambilux {
namespace {

/// Triangles from which on the good builder takes longer than most renders wait, and the seconds that it takes for one
/// (docs/performance.md).
constexpr uint32_t kManyTriangles = 1000000;
constexpr double kGoodSeconds = 2e-6;

Build settled_build(const RenderSettings& s, bool cuda, const Scene& scene) {
    const size_t triangles = scene.triangles.size();
    if (s.build == Build::fast && !scene.groups.empty())
        log_info("build=fast: trees of scenes with instances have two levels, which the good builder makes alone");
    if (s.build == Build::good || !scene.groups.empty()) return Build::good;
    if (s.build == Build::fast) return Build::fast;
    if (!cuda || !s.may_build_fast || s.accel == AccelKind::bvh2 || s.accel == AccelKind::optix || s.deterministic)
        return Build::good;
    const bool short_time = s.expected_seconds > 0 && kGoodSeconds * double(triangles) > 0.2 * s.expected_seconds;
    return short_time || (s.expected_seconds <= 0 && triangles >= kManyTriangles) ? Build::fast : Build::good;
}

void check_build(const RenderSettings& s, bool cuda) {
    if (s.build != Build::fast) return;
    if (s.automatic)
        throw Error(ExitCode::usage,
                    "build=fast: the pilot of bdpt.auto=true traces through the good structure; leave "
                    "one of the two out, or render with the settings that it chooses");
    if (s.accel == AccelKind::bvh2 || s.accel == AccelKind::optix || (!cuda && s.accel != AccelKind::cwbvh))
        throw Error(ExitCode::usage, fmt::format("build=fast: it builds accel=cwbvh alone; {}",
                                                 cuda ? "leave one of the two out" : "set that, or leave it out"));
}

void check_optix(const RenderSettings& s) {
    if (s.accel != AccelKind::optix) return;
    if (!kOptixBuilt) throw Error(ExitCode::usage, kWhyNoOptix);
    if (s.deterministic)
        throw Error(ExitCode::usage,
                    "deterministic=true: OptiX does not promise which of two surfaces at one distance "
                    "it finds; take accel=cwbvh, or leave one of the two out");
}

/// What settings that are left open stand for (docs/performance.md).
RenderSettings settled(const RenderSettings& settings, const Variant& variant, bool cuda, const Scene& scene) {
    RenderSettings s = settings;
    const bool several_bsdfs = scene.features.several_bsdfs();
    if (s.queues.ordering == Ordering::automatic)
        s.queues.ordering = cuda && variant.traits.sorts && several_bsdfs ? Ordering::material : Ordering::none;
    s.queues.keyed_hits =
        s.queues.ordering == Ordering::material && s.queues.compaction == Compaction::atomic && several_bsdfs;
    // OptiX cannot launch inside of a conditional node.
    if (cuda && (!cuda_graphs_choose() || s.accel == AccelKind::optix)) s.graph = false;
    if (!light_tree_pays(scene)) s.light_picking = LightPicks::table;
    s.build = settled_build(s, cuda, scene);
    if (s.draws == CacheDraws::automatic && variant.traits.draws_together)
        s.draws = cuda ? CacheDraws::coherent : CacheDraws::independent;
    return s;
}

/// The smallest level of features that covers the scene, of those that the backend is compiled for.
CompiledRenderer::Make compiled_for(bool cuda, const Scene& scene, const RenderSettings& s) {
    Features needed = s.specialise && s.fuse != Fuse::none ? scene.features : kAllFeatures;
    needed.sampling = s.light_picking == LightPicks::tree || s.sampler == Sampler::sobol;
    const Variant& variant = variant_of(s);
    for (const CompiledRenderer& r : compiled_renderers()) {
        const CompiledRenderer::Make make = cuda ? r.cuda : r.cpu;
        if (make && r.integrator == variant.integrator && r.variant == variant.variant && r.level.covers(needed))
            return make;
    }
    throw Error(ExitCode::usage, fmt::format("{}: integrators/registry.list has no level {} for it", variant.name(),
                                             needed.sampling ? "Sampling" : "All"));
}

/// What a first start waits for, once for each variant. Only the kernels of this variant and level are loaded, and so
/// compiled. True if there is something to wait for.
bool announce_kernels(const RenderSettings& s) {
    const KernelChoice kernels = cuda_kernels();
    static std::set<std::string> announced;
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    const std::string name = variant_of(s).name();
    if (kernels.kind != KernelKind::ptx || !announced.insert(name).second) return false;
    const char *disabled = std::getenv("CUDA_CACHE_DISABLE"), *path = std::getenv("CUDA_CACHE_PATH");
    const std::string kept = disabled && std::string(disabled) == "1"
                                 ? "and again at every start, since CUDA_CACHE_DISABLE is set"
                                 : fmt::format("once: it keeps them in {}", path ? path : "~/.nv/ComputeCache");
    log_info(fmt::format("{}: the driver compiles kernels for this device from {}. That takes up to a minute, {}", name,
                         kernels_text(kernels), kept));
    return true;
}

std::unique_ptr<Renderer> make_on(bool cuda, const Scene& scene, const RenderSettings& s, SharedAccels& accels) {
    if (cuda && !cuda_device_present()) throw Error(ExitCode::device, why_no_cuda_device());
    const auto make = compiled_for(cuda, scene, s);
    const bool waits = cuda && announce_kernels(s);
    std::unique_ptr<Renderer> renderer = make(scene, s, accels);
    if (const double seconds = waits ? renderer->stats().kernel_seconds : 0; seconds > 0)
        log_info(fmt::format("{}: its kernels were there after {:.1f} s", variant_of(s).name(), seconds));
    return renderer;
}

std::unique_ptr<Renderer> make_from(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    const Variant& variant = variant_of(settings);
    const bool in_double = settings.precision == Precision::in_double;
    const bool open = settings.backend == Backend::automatic && settings.accel != AccelKind::embree && !in_double;
    const bool cuda = settings.backend == Backend::cuda || (open && cuda_available());
    check_settings(settings, variant, cuda);
    check_build(settings, cuda);
    check_optix(settings);
    accels.place_textures(settings.textures);
    if (in_double && settings.light_picking == LightPicks::tree)
        throw Error(ExitCode::usage, "light_picking=tree: precision=double picks emitters by the table alone");
    if (in_double && settings.sampler == Sampler::sobol)
        throw Error(ExitCode::usage, "sampler=sobol: precision=double has independent numbers alone");
    if (in_double) return make_twin(scene, settings);
    if (settings.automatic)
        return make_automatic(scene, settings, cuda, accels, [&](RenderSettings chosen) {
            chosen.build = Build::good;  // the pilot's
            return make_from(scene, chosen, accels);
        });
    return make_on(cuda, scene, settled(settings, variant, cuda, scene), accels);
}

}  // namespace

bool cuda_available() { return cuda_device_present(); }

std::unique_ptr<Renderer> make_renderer(const Scene& scene, const RenderSettings& settings) {
    SharedAccels accels(scene);
    return make_from(scene, settings, accels);
}

std::unique_ptr<Renderer> make_renderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    return make_from(scene, settings, accels);
}

}  // namespace ambilux
