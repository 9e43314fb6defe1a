#include <fmt/format.h>

#include "backends/cuda_device.h"
#include "core/error.h"
#include "integrators/bidirectional/bidirectional.h"
#include "integrators/bidirectional/choice.h"
#include "integrators/path/path.h"

namespace ambilux {
namespace {

/// What `ordering=auto` stands for (docs/performance.md, "Compaction and ordering").
Ordering best_ordering(const Scene& scene, const RenderSettings& settings, bool cuda) {
    const bool sortable = settings.variant != "megakernel";
    return cuda && sortable && scene.features.several_bsdfs() ? Ordering::material : Ordering::none;
}

}  // namespace

bool cuda_available() { return cuda_device_present(); }

namespace {

/// Whoever sets what has no effect expects one. Throws Error(usage).
void check_applies(const RenderSettings& s) {
    const RenderSettings defaults;
    const bool bdpt = s.integrator == "bdpt";
    const auto refuse = [&](const char* what, const char* whose) {
        throw Error(ExitCode::usage,
                    fmt::format("{}: {}, and this is integrator {}, variant {}", what, whose, s.integrator, s.variant));
    };
    if (s.estimator != defaults.estimator && s.integrator != "path")
        refuse("estimator", "integrator path has estimators, bdpt has strategies");
    if ((s.strategies != defaults.strategies || s.singles.on) && !bdpt)
        refuse("strategies", "integrator bdpt has strategies to choose from, path has estimators");
    if (s.connections != defaults.connections && !(bdpt && (s.variant == "lvc" || s.automatic)))
        refuse("connections", "light vertices are drawn in variant lvc of bdpt");
    if (s.light_walks_per_tile != defaults.light_walks_per_tile && s.integrator == "path")
        refuse("light_paths", "integrators light and bdpt have light walks");
}

std::unique_ptr<Renderer> make_from(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    // Settings may come from elsewhere than apply_setting.
    RenderSettings checked;
    apply_setting(checked, "integrator", settings.integrator);
    apply_setting(checked, "variant", settings.variant);
    apply_setting(checked, "backend", settings.backend);
    apply_setting(checked, "accel", settings.accel);
    check_applies(settings);
    if (settings.automatic) check_automatic(settings);
    if (settings.variant != "wavefront" && settings.integrator != "bdpt")
        throw Error(ExitCode::usage,
                    "variant=" + settings.variant + ": integrator " + settings.integrator +
                        " has the variant wavefront only; megakernel, lvc and streaming belong to bdpt");
    if (settings.technique_depth > 0 && (settings.integrator == "path" || settings.variant == "megakernel"))
        throw Error(ExitCode::usage,
                    fmt::format("technique_depth={}: {} gathers no images of single strategies; integrator light and "
                                "the other variants of bdpt do",
                                settings.technique_depth,
                                settings.integrator == "path" ? "integrator path" : "variant megakernel"));
    const bool compacted = settings.queues.compaction != Compaction::atomic,
               ordered = settings.queues.ordering != Ordering::none && settings.queues.ordering != Ordering::automatic;
    if (settings.variant == "megakernel" && (compacted || ordered))
        throw Error(ExitCode::usage,
                    fmt::format("compaction={}, ordering={}: variant megakernel has no queues to compact or to sort; "
                                "the variants wavefront and lvc have these switches",
                                compaction_name(settings.queues.compaction), ordering_name(settings.queues.ordering)));
    if (settings.variant == "streaming" && compacted)
        throw Error(ExitCode::usage, fmt::format("compaction={}: variant streaming has its rays by slot and appends "
                                                 "all else; the variants wavefront and lvc have this switch",
                                                 compaction_name(settings.queues.compaction)));
    const bool cuda =
        settings.backend == "cuda" || (settings.backend == "auto" && settings.accel != "embree" && cuda_available());
    if (cuda && settings.accel == "embree")
        throw Error(ExitCode::usage,
                    "accel=embree: the cuda backend has its own structure, cwbvh; use --backend cpu for Embree");
    if (settings.accel == "bvh2" && !(cuda && settings.integrator == "path"))
        throw Error(
            ExitCode::usage,
            fmt::format("accel=bvh2: a binary BVH to compare with, on the cuda backend for integrator path; {} has {}",
                        cuda ? "integrator " + settings.integrator : "the cpu backend",
                        cuda ? "cwbvh" : "embree and cwbvh"));
    if (cuda && settings.deterministic && settings.variant == "lvc")
        throw Error(ExitCode::usage,
                    "deterministic=true: variant lvc draws from a cache whose order differs between runs on a CUDA "
                    "device; use wavefront or megakernel");
    if (settings.automatic)
        return make_automatic(scene, settings, cuda, accels,
                              [&](const RenderSettings& chosen) { return make_from(scene, chosen, accels); });
    RenderSettings chosen = settings;
    // On a host connect of the path tracer waits for the tables of environments, which it can ask for ahead only as a
    // stage of its own.
    if (chosen.fuse == Fuse::automatic) chosen.fuse = cuda || chosen.integrator != "path" ? Fuse::all : Fuse::light;
    if (chosen.queues.ordering == Ordering::automatic) chosen.queues.ordering = best_ordering(scene, settings, cuda);
    chosen.queues.keyed_hits = chosen.queues.ordering == Ordering::material &&
                               chosen.queues.compaction == Compaction::atomic && scene.features.several_bsdfs();
    if (chosen.integrator != "path")
        return cuda ? make_bidirectional_cuda(scene, chosen, accels) : make_bidirectional_cpu(scene, chosen, accels);
    return cuda ? make_path_cuda(scene, chosen, accels) : make_path_cpu(scene, chosen, accels);
}

}  // namespace

std::unique_ptr<Renderer> make_renderer(const Scene& scene, const RenderSettings& settings) {
    SharedAccels accels(scene);
    return make_from(scene, settings, accels);
}

}  // namespace ambilux
