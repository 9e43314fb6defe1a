// lpv: cascaded light propagation volumes (Kaplanyan and Dachsbacher 2010, "Cascaded Light Propagation Volumes for
// Real-Time Indirect Illumination"). The first vertices of light subpaths become virtual lights in nested grids, whose
// light spreads from cell to cell; eye subpaths look it up at their first vertex. Each iteration has light subpaths of
// its own, and the image is their mean.
// Directions blur from cell to cell, so that light turns and surfaces also light themselves: within a box the bounce
// has about the right mean, on an open floor it is several times too bright. Left out of the paper's parts: damping by
// the gradient, blockers that the camera sees, further bounces.
#pragma once

#include "gather.h"
#include "inject.h"
#include "integrators/bdpt/shared/policy.h"
#include "integrators/bdpt/vcm/merging_directions.h"
#include "integrators/path/integrator.h"
#include "propagate.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct LpvIntegrator {
    using Mis = MergingMis;  ///< of integrator sppm: emission that is seen through deltas, else next event estimation
    using State = lpv::State;
    static constexpr bool kFilmWide = false;
    static constexpr uint32_t kPhases = 2;
    /// Emission and next event estimation.
    using Eye = PathIntegrator<F, Tracer, kFusion, NextEvent, NoSettings, Mis>;

    struct Policy : BdptPolicyOf<Mis> {
        lpv::Settings volumes;
        lpv::Cascades cascades;
        uint32_t light_subpaths;  ///< of an iteration; 0: they find nothing
    };
    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        need_one_light_subpath(settings, "lpv has one for each sample of a pixel; lpv_samples makes iterations larger");
        Policy p{plan_bdpt<Mis>(scene, settings), lpv::Settings::plan(settings), {}, 0};
        p.rules.mis.merges = Merges::first;
        p.rules.directions.deltas_only = true;
        p.cascades = lpv::Cascades::plan(scene, p.volumes);
        p.waves.keeps_light_vertices = false;
        p.waves.iteration_samples = p.volumes.iteration_samples;
        if (!scene.emitters.empty() && p.rules.max_depth >= 3) p.light_subpaths = p.volumes.lights(scene);
        return p;
    }
    static std::vector<std::string> skipped(const Scene&, const Policy& p) {
        if (p.light_subpaths > 0) return {};
        return {"light propagation volumes: no emitters, or paths of two segments at most"};
    }

    using Memory = typename Eye::Memory;
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        return Eye::lay_out(layout, {p.rules, p.waves, {}}, n);
    }

    struct Stages {
        /// Nobody sees emitters by their light subpaths.
        struct NoSplats {
            AMBILUX_HD uint32_t push(const CandidateItem&) const { return 0; }
        };

        Policy policy;
        typename Eye::Stages eye;
        GenerateLight<F, Mis, NoSplats> generate_light;
        Extend<F, Tracer, Mis> extend_light;
        lpv::LeaveLight<F, Mis> leave;
        lpv::FindSites find;
        StageRecord* sort;
        lpv::Block block;
        lpv::Inject inject;
        lpv::Propagate propagate;
        lpv::Gather<F, Mis> gather[2];
        State state;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State& all)
            : policy(p), eye(parts, {p.rules, p.waves, {}}, m, NoState{}), state(all) {
            const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
            const SceneView& scene = parts.scene;
            const Wave& wave = parts.wave;
            const auto& q = m.subpaths;
            const uint32_t pairs = p.light_subpaths * p.cascades.count;
            const float subpaths = p.rules.mis.light_subpaths * float(p.volumes.iteration_samples);
            generate_light = {scene, wave, p.rules, q.rays[0], {}, nullptr, record(generate_light), kTilePixels};
            extend_light = {scene,
                            parts.tracer,
                            wave,
                            Stream::light,
                            q.rays[0],
                            q.hits[0],
                            parts.layout.record(extend_light.kLightName)};
            leave = {scene, wave, p.rules, q.hits[0], all.lights, p.volumes.iteration_samples, subpaths, record(leave)};
            find = {wave, p.cascades, all, p.light_subpaths, false, record(find)};
            sort = parts.layout.record("sort_lights");
            block = {all, pairs, record(block)};
            inject = {p.cascades, all, pairs, 0, record(inject)};
            propagate = {p.cascades, all, p.volumes.occlusion, 0, 0, record(propagate)};
            for (int k = 0; k < 2; ++k)
                gather[k] = {
                    scene, wave, p.rules, p.cascades, q.hits[k], all.total, eye.eye.accumulate, record(gather[k])};
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& s) {
            if (s.policy.light_subpaths == 0) return;
            exec.run_slots(s.generate_light, s.eye.wave.tiles * kTilePixels);
            exec.set_depth(1);
            exec.extend(s.extend_light);
            exec.run(s.leave);
            exec.set_depth(0);
        });
        run.once([](auto& exec, const Stages& s) {
            if (s.policy.light_subpaths > 0) build(exec, s);
        });
        run.for_waves([](auto& exec, const Stages& s) { eye_subpaths(exec, s); });
    }

private:
    template <class Executor>
    static void sort_lights(Executor& exec, const Stages& s, bool blockers) {
        lpv::FindSites find = s.find;
        find.blockers = blockers;
        exec.for_each(find, s.inject.count);
        exec.sort_pairs(s.state.order, s.inject.count, lpv::kKeyBits, s.sort);
    }
    /// Grids, from the largest on, whose light enters the next one.
    template <class Executor>
    static void build(Executor& exec, const Stages& s) {
        const lpv::Cascades& cascades = s.policy.cascades;
        const uint32_t cells = cascades.grids[0].cells();
        if (s.policy.volumes.occlusion > 0.0f) {
            sort_lights(exec, s, true);
            exec.for_each(s.block, cascades.count * cascades.grids[0].corners());
        }
        sort_lights(exec, s, false);
        for (uint32_t c = 0; c < cascades.count; ++c) {
            lpv::Inject inject = s.inject;
            lpv::Propagate propagate = s.propagate;
            inject.cascade = propagate.cascade = c;
            exec.for_each(inject, cells);
            for (propagate.step = 0; propagate.step < s.policy.volumes.steps; ++propagate.step)
                exec.for_each(propagate, cells);
        }
    }
    template <class Executor>
    static void eye_subpaths(Executor& exec, const Stages& s) {
        const typename Eye::Stages& eye = s.eye;
        const auto& rules = s.policy.rules;
        if (rules.max_depth == 0) return;
        start_eye_subpaths<kFusion.generate>(exec, eye.generate, eye.extend[0], eye.wave.tiles * kTilePixels);
        const auto rest = [&](bool several_bounces) {
            run_emission(exec, eye.eye);
            if (!rules.next_event) return;
            if constexpr (!kFusion.connect) exec.run(eye.connect_emitter);
            run_candidates(exec, eye.eye, several_bounces);
        };
        repeat_depths(exec, eye.eye_vertex, eye.extend, 0, rest, [&](int k, const auto&) {
            if (s.policy.light_subpaths > 0) exec.for_each(s.gather[k], s.gather[k].hits);
        });
        exec.set_depth(0);
    }
};

}  // namespace ambilux
