// photon_density: a progressive photon mapper as small as can be. Light subpaths leave photons, which are sorted into
// cells once all of them are there; eye subpaths gather them at their first vertex; the radius shrinks from iteration
// to iteration (Jensen 1996, "Global Illumination using Photon Maps"; Knaus and Zwicker 2011, "Progressive Photon
// Mapping: A Probabilistic Approach").
#pragma once

#include "integrators/bdpt/shared/pilot.h"
#include "integrators/bdpt/shared/policy.h"
#include "integrators/shared/subpath_queues.h"
#include "stages/extend.h"
#include "stages/generate.h"
#include "stages/light_vertex.h"
#include "vertices.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct PhotonDensityIntegrator {
    using Mis = BidirectionalMis;
    using State = photon_density::State;
    using Photon = photon_density::Photon;
    static constexpr bool kFilmWide = false;
    static constexpr uint32_t kPhases = 2;

    struct Policy : BdptPolicy {
        photon_density::Settings photons;
    };
    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        need_one_light_subpath(settings, "photon_density has one for each sample of a pixel");
        Policy p{plan_bdpt(scene, settings), photon_density::Settings::plan(settings)};
        // Light subpaths have photons where others have connections with the camera; paths have one segment more.
        p.rules.splat = !scene.emitters.empty() && p.rules.max_depth >= 2;
        p.rules.connect = p.rules.next_event = p.rules.background_only = false;
        p.rules.count_hits = !scene.emitters.empty();
        p.waves.iteration_samples = p.photons.iteration_samples;
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        return p.rules.splat ? mean_light_vertices<F>(scene, tracer, p.rules, seed) : 0.0;
    }
    static std::vector<std::string> skipped(const Scene&, const Policy&) { return {}; }

    struct Memory {
        SubpathQueues<SubpathItems<Mis>::Ray> subpaths;
        Queue<Photon> photons;
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        Memory m;
        m.subpaths = {layout, n.slots, p.waves.queues};
        m.photons = layout.growing_queue<Photon>("wave_photons", p.rules.splat ? n.kept : 0);
        return m;
    }

    struct Stages {
        using LeavePhoton = photon_density::LeavePhoton<Mis>;

        /// Nobody sees emitters by their light subpaths.
        struct NoSplats {
            AMBILUX_HD uint32_t push(const CandidateItem&) const { return 0; }
        };

        Wave wave;
        bool light;
        uint32_t multi_bounce_below;
        GenerateLight<F, Mis, NoSplats> generate_light;
        Extend<F, Tracer, Mis> extend_light[2], extend_eye[2];
        LightVertex<F, Mis, LeavePhoton> light_vertex[2];
        photon_density::Append append;
        State state;
        GenerateEye<F, Mis> generate_eye;
        photon_density::Gather<F, Mis> gather[2];
        StageRecord* sort;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State& all)
            : wave(parts.wave), light(p.rules.splat), multi_bounce_below(p.waves.multi_bounce_below), state(all) {
            const auto record = [&](const char* name) { return parts.layout.record(name); };
            const SceneView& scene = parts.scene;
            const auto& q = m.subpaths;
            generate_light = {scene, wave, p.rules, q.rays[0], {}, nullptr, record(generate_light.kName), kTilePixels};
            generate_eye = {scene, wave, p.rules.mis, q.rays[0], parts.film.samples, record(generate_eye.kName)};
            const Accumulate samples = {{}, parts.film.samples, record(Accumulate::kName), wave, {}};
            for (int k = 0; k < 2; ++k) {
                extend_light[k] = {
                    scene, parts.tracer, wave, Stream::light, q.rays[k], q.hits[k], record(extend_light[k].kLightName)};
                light_vertex[k] = {scene,
                                   wave,
                                   p.rules,
                                   q.hits[k],
                                   q.rays[1 - k],
                                   {},
                                   nullptr,
                                   LeavePhoton{wave, m.photons, p.photons.iteration_samples},
                                   record(light_vertex[k].kName)};
                extend_eye[k] = {
                    scene, parts.tracer, wave, Stream::eye, q.rays[k], q.hits[k], record(extend_eye[k].kName)};
                gather[k] = {scene,
                             wave,
                             p.rules,
                             p.photons,
                             q.hits[k],
                             q.rays[1 - k],
                             all,
                             samples,
                             record(gather[k].kName),
                             p.rules.mis.light_subpaths * float(p.photons.iteration_samples)};
            }
            append = {scene, wave, p.photons, m.photons, all, record(append.kName)};
            sort = record("sort_photons");
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& s) {
            if (!s.light) return;
            exec.run_slots(s.generate_light, s.wave.tiles * kTilePixels);
            exec.set_depth(1);
            exec.extend(s.extend_light[0]);
            repeat_depths(exec, s.light_vertex, s.extend_light, s.multi_bounce_below, [](bool) {});
            exec.set_depth(0);
            exec.fail_on_overflow(s.append.mine, s.append.mine);
            exec.append(s.append);
            exec.clear(s.append.mine);
        });
        run.once([](auto& exec, const Stages& s) {
            exec.sort_pairs(s.state.order, exec.count(s.state.photons), 64, s.sort);
        });
        run.for_waves([](auto& exec, const Stages& s) {
            start_eye_subpaths<false>(exec, s.generate_eye, s.extend_eye[0], s.wave.tiles * kTilePixels);
            repeat_depths(exec, s.gather, s.extend_eye, s.multi_bounce_below, [](bool) {});
            exec.set_depth(0);
        });
        run.once([](auto& exec, const Stages& s) { exec.clear(s.state.photons); });
    }
};

}  // namespace ambilux
