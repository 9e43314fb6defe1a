// vpl: instant radiosity (Keller 1997, "Instant Radiosity"). A few light subpaths of an iteration leave vertices,
// virtual point lights, that all pixels share; eye subpaths go on through deltas to their first other vertex, which
// samples an emitter and is connected with all of them. Their geometry term may be bounded (Kollig and Keller 2004,
// "Illumination in the Presence of Weak Singularities").
#pragma once

#include "integrators/bdpt/shared/two_sides.h"
#include "integrators/bdpt/vcm/merging_directions.h"
#include "integrators/bdpt/vpl/light_set.h"
#include "integrators/bdpt/vpl/source.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct VplIntegrator {
    using Mis = VplMis;
    using Policy = VplPolicy;
    using State = VplState;
    static constexpr bool kFilmWide = false;
    static constexpr uint32_t kPhases = 2;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p = Policy::plan(scene, settings);
        p.vertex_lanes = ConnectionVertex<Mis>::template lanes<F>();
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        return p.keeps_vertices ? mean_light_vertices<F>(scene, tracer, p.rules, seed) : 0.0;
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies<Mis>(scene, p);
    }

    struct Memory {
        TwoSidesMemory<Mis> two_sides;
        LightVertices<Mis> kept;  ///< of the light subpaths of the wave
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        Memory m;
        m.two_sides = TwoSidesMemory<Mis>::template lay_out<kFusion, F>(layout, p, n);
        m.kept = layout.growing_queue<ConnectionVertex<Mis>>("wave_set_vertices", p.keeps_vertices ? n.kept : 0,
                                                             p.vertex_lanes);
        return m;
    }

    struct Stages {
        TwoSidesStages<F, Tracer, kFusion, VplSource> two_sides;
        GenerateSet<F> generate;
        Extend<F, Tracer, Mis> extend[2];
        LightVertex<F, Mis, KeepVertex<F>> light_vertex[2];
        AppendToSet append;
        PlaceInSet place;
        StageRecord* sort;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State& state)
            : two_sides(parts, p, m.two_sides,
                        VplSource{state.in_order(), p.cache_draws, float(p.vpl.subpaths),
                                  parts.layout.record("clamped_connections")}) {
            const auto record = [&](const char* name) { return parts.layout.record(name); };
            const SceneView& scene = parts.scene;
            const Wave& wave = parts.wave;
            const Rules<Mis> rules = p.light_rules();
            const auto& q = m.two_sides.subpaths;
            const IterationNumbers numbers = {p.vpl.samples, p.waves.light_rounds()};
            StageRecord* const generates = record(generate.kName);
            generate = {{scene, wave, p.rules, q.rays[0], {}, nullptr, generates, p.waves.light_subpaths_per_tile},
                        numbers,
                        p.vpl.subpaths,
                        generates};
            for (int k = 0; k < 2; ++k) {
                extend[k] = {
                    scene, parts.tracer, wave, Stream::light, q.rays[k], q.hits[k], record(extend[k].kLightName)};
                light_vertex[k] = {scene,
                                   wave,
                                   rules,
                                   q.hits[k],
                                   q.rays[1 - k],
                                   {},
                                   nullptr,
                                   {m.kept, wave, numbers},
                                   record(light_vertex[k].kName)};
            }
            append = {m.kept, state, record(append.kName)};
            place = {state, record(place.kName)};
            sort = record("sort_vertices");
        }

        /// The same for the first light subpaths of all slots, the second ..., which differ by their random numbers.
        Stages in_round(uint32_t round) const {
            Stages s = *this;
            s.generate.generate.round = round;
            const uint32_t first_key = round * two_sides.wave.width * two_sides.wave.height;
            s.generate.generate.wave.first_key = first_key;
            for (int k = 0; k < 2; ++k)
                s.extend[k].wave.first_key = s.light_vertex[k].wave.first_key =
                    s.light_vertex[k].camera.wave.first_key = first_key;
            return s;
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& s) { light_subpaths(exec, s); });
        run.once([](auto& exec, const Stages& s) {
            if (!s.two_sides.policy.keeps_vertices) return;
            const uint32_t count = exec.count(s.append.state.all);
            exec.sort_pairs(s.append.state.order, count, 32, s.sort);
            exec.for_each(s.place, count);
        });
        run.for_waves([](auto& exec, const Stages& s) {
            if (s.two_sides.policy.rules.max_depth > 0) run_eye_subpaths(exec, s.two_sides);
        });
        run.once([](auto& exec, const Stages& s) {
            if (s.two_sides.policy.keeps_vertices) exec.clear(s.append.state.all);
        });
    }

private:
    template <class Executor>
    static void light_subpaths(Executor& exec, const Stages& all) {
        const auto& policy = all.two_sides.policy;
        if (!policy.keeps_vertices) return;
        for (uint32_t round = 0; round < policy.waves.light_rounds(); ++round) {
            const Stages s = all.in_round(round);
            exec.run_slots(s.generate, s.two_sides.wave.tiles * kTilePixels);
            exec.set_depth(1);
            exec.extend(s.extend[0]);
            repeat_depths(exec, s.light_vertex, s.extend, policy.waves.multi_bounce_below, [](bool) {});
            exec.set_depth(0);
        }
        exec.fail_on_overflow(all.append.mine, all.append.mine);
        exec.append(all.append);
        exec.clear(all.append.mine);
    }
};

}  // namespace ambilux
