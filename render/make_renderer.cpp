#include <fmt/format.h>

#include "backends/cuda_device.h"
#include "core/error.h"
#include "integrators/registry.h"
#include "render/make_on_backend.h"
#include "render/selection.h"

namespace ambilux {
namespace {

/// What settings are asked of, and what they ask for.
struct Request {
    const RenderSettings& settings;
    const VariantInfo& variant;
    bool cuda;

    /// Throws Error(usage): `what` has no effect here, and why.
    template <class... Args>
    [[noreturn]] void refuse(fmt::format_string<Args...> what, Args&&... args) const {
        throw Error(ExitCode::usage,
                    fmt::format("{}; this is integrator {}, variant {}", fmt::format(what, std::forward<Args>(args)...),
                                variant.integrator, variant.variant));
    }
};

/// Whoever sets what has no effect expects one.
void check_estimator(const Request& r) {
    const RenderSettings& s = r.settings;
    const RenderSettings defaults;
    const bool bdpt = s.integrator == "bdpt";
    if (s.estimator != defaults.estimator && r.variant.bidirectional)
        r.refuse("estimator: integrator path has estimators, bdpt has strategies");
    if ((s.strategies != defaults.strategies || s.singles.on) && !bdpt)
        r.refuse("strategies: integrator bdpt has strategies to choose from, path has estimators");
    if (s.connections != defaults.connections && !(bdpt && (r.variant.draws || s.automatic)))
        r.refuse("connections: light vertices are drawn in variant lvc of bdpt");
    if (s.draws != CacheDraws::automatic && !(bdpt && (r.variant.draws || s.automatic)))
        r.refuse("draws: light vertices are drawn in variant lvc of bdpt");
    if (s.draws == CacheDraws::coherent && !r.cuda)
        r.refuse("draws=coherent: lanes of a warp draw together, on the cuda backend");
    if (s.light_subpaths_per_tile != defaults.light_subpaths_per_tile && !r.variant.bidirectional)
        r.refuse("light_paths: integrators light and bdpt have light subpaths");
    if (s.technique_depth > 0 && !r.variant.strategy_images)
        r.refuse(
            "technique_depth={}: no images of single strategies are gathered here; integrator light and the "
            "variants wavefront, lvc and streaming of bdpt do",
            s.technique_depth);
}

void check_queues(const Request& r) {
    const QueuePolicy& q = r.settings.queues;
    if (q.ordering != Ordering::none && q.ordering != Ordering::automatic && !r.variant.sorts)
        r.refuse("ordering={}: there are no queues to sort; the variants wavefront and lvc have this switch",
                 ordering_name(q.ordering));
    if (q.compaction != Compaction::atomic && !r.variant.compacts)
        r.refuse(
            "compaction={}: there are no queues of one item per path; the variants wavefront and lvc have this "
            "switch",
            compaction_name(q.compaction));
}

void check_backend(const Request& r) {
    const RenderSettings& s = r.settings;
    if (r.cuda && s.accel == "embree")
        r.refuse("accel=embree: the cuda backend has its own structure, cwbvh; use --backend cpu for Embree");
    if (s.accel == "bvh2" && !(r.cuda && r.variant.binary_bvh))
        r.refuse("accel=bvh2: a binary BVH to compare with, on the cuda backend for integrator path; {} has {}",
                 r.cuda ? "this" : "the cpu backend", r.cuda ? "cwbvh" : "embree and cwbvh");
    if (r.cuda && s.deterministic && !r.variant.repeats)
        r.refuse(
            "deterministic=true: variant lvc draws from a cache whose order differs between runs on a CUDA "
            "device; use wavefront or megakernel");
}

const VariantInfo& variant_of(const RenderSettings& settings) {
    // Settings may come from elsewhere than apply_setting.
    RenderSettings checked;
    apply_setting(checked, "integrator", settings.integrator);
    apply_setting(checked, "variant", settings.variant);
    apply_setting(checked, "backend", settings.backend);
    apply_setting(checked, "accel", settings.accel);
    if (const VariantInfo* v = find_variant(settings.integrator, settings.variant)) return *v;
    throw Error(ExitCode::usage,
                fmt::format("variant={}: integrator {} has the variant wavefront only; megakernel, lvc and streaming "
                            "belong to bdpt",
                            settings.variant, settings.integrator));
}

/// What settings that are left open stand for (docs/performance.md).
RenderSettings settled(const RenderSettings& settings, const Request& r, const Scene& scene) {
    RenderSettings s = settings;
    const bool several = scene.features.several_bsdfs();
    if (s.queues.ordering == Ordering::automatic)
        s.queues.ordering = r.cuda && r.variant.sorts && several ? Ordering::material : Ordering::none;
    s.queues.keyed_hits =
        s.queues.ordering == Ordering::material && s.queues.compaction == Compaction::atomic && several;
    if (s.draws == CacheDraws::automatic && r.variant.draws)
        s.draws = r.cuda ? CacheDraws::coherent : CacheDraws::independent;
    return s;
}

std::unique_ptr<Renderer> make_on(bool cuda, const Scene& scene, const RenderSettings& s, SharedAccels& accels) {
#if defined(AMBILUX_HAS_CUDA)
    if (cuda && !cuda_device_present())
        throw Error(ExitCode::device, "no CUDA device answers: check the driver with nvidia-smi, or use --backend cpu");
#else
    if (cuda)
        throw Error(ExitCode::device,
                    "this program was built without CUDA: install the CUDA toolkit and build again, "
                    "or use --backend cpu");
#endif
    const bool specialise = s.specialise && s.fuse != Fuse::none;
    return with_family(s.integrator, [&]<class Family>() {
        return with_feature_level(scene.features, specialise, [&]<Features F>() {
#if defined(AMBILUX_HAS_CUDA)
            if (cuda) return make_on_cuda<Family, F>(scene, s, accels);
#endif
            return make_on_cpu<Family, F>(scene, s, accels);
        });
    });
}

std::unique_ptr<Renderer> make_from(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    const VariantInfo& variant = variant_of(settings);
    const bool cuda =
        settings.backend == "cuda" || (settings.backend == "auto" && settings.accel != "embree" && cuda_available());
    const Request request = {settings, variant, cuda};
    check_estimator(request);
    if (settings.automatic) check_automatic(settings);
    check_queues(request);
    check_backend(request);
    if (settings.automatic)
        return make_automatic(scene, settings, cuda, accels,
                              [&](const RenderSettings& chosen) { return make_from(scene, chosen, accels); });
    return make_on(cuda, scene, settled(settings, request, scene), accels);
}

}  // namespace

bool cuda_available() { return cuda_device_present(); }

std::unique_ptr<Renderer> make_renderer(const Scene& scene, const RenderSettings& settings) {
    SharedAccels accels(scene);
    return make_from(scene, settings, accels);
}

}  // namespace ambilux
