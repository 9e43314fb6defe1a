// bdpt, variant megakernel: one kernel instead of stages, whose subpaths live in registers.
#pragma once

#include "integrators/bdpt/shared/light_side.h"
#include "integrators/bdpt/shared/pilot.h"
#include "stages/megakernel.h"

namespace ambilux {

template <Features F, class Tracer, class Mis>
struct MegakernelOf {
    using Policy = BdptPolicyOf<Mis>;
    static constexpr bool kFilmWide = true;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        need_one_light_subpath(settings, "variant megakernel has one light subpath per eye subpath; use variant lvc");
        return plan_bdpt<Mis>(scene, settings);
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        return p.light_subpaths() ? mean_light_vertices<F>(scene, tracer, p.rules, seed) : 0.0;
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies(scene, p);
    }

    using State = NoState;
    struct Memory {
        LightVertices<Mis> light_vertices;
        Queue<SplatItem> splats;
    };
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        Memory m;
        m.light_vertices = layout.growing_queue<ConnectionVertex<Mis>>("light_vertices", p.rules.connect ? n.kept : 0,
                                                                       ConnectionVertex<Mis>::template lanes<F>());
        m.splats = layout.growing_queue<SplatItem>("splats", p.rules.splat ? n.kept + n.slots : 0);
        return m;
    }

    struct Stages {
        Policy policy;
        Wave wave;
        Megakernel<F, Tracer, Mis> megakernel;
        Splat<F> splat;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State&)
            : policy(p), wave(parts.wave) {
            const auto record = [&](const char* name) { return parts.layout.record(name); };
            const MegakernelRecords records = {
                record("light_generate"), record("light_extend"), record("light_shade"), record("connect_camera"),
                record("extend"),         record("shade"),        record("connect"),     record("connect_vertices"),
                record("mis_weight"),     record("occlude")};
            megakernel = {parts.scene,
                          parts.tracer,
                          wave,
                          p.rules,
                          m.light_vertices,
                          m.splats,
                          parts.film.samples,
                          records,
                          record(megakernel.kName)};
            splat = {parts.scene, wave, m.splats, parts.film.splats, {}, record(Splat<F>::kName)};
        }
    };

    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        if (s.policy.rules.max_depth == 0) return;
        exec.run_paths(s.megakernel, s.wave.tiles * kTilePixels);
        exec.fail_on_overflow(s.megakernel.light_vertices, s.megakernel.splats);
        if (s.policy.rules.splat) exec.run(s.splat);
        if (s.policy.rules.connect) exec.clear(s.megakernel.light_vertices);
    }
};
template <Features F, class Tracer, Fusion>
using MegakernelIntegrator = MegakernelOf<F, Tracer, BidirectionalMis>;

}  // namespace ambilux
