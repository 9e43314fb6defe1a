// path, variant optimal: at the first vertices of a path next event estimation and hits have the weights of least
// variance, learned from earlier iterations (Kondapaneni et al. 2019, "Optimal Multiple Importance Sampling").
#pragma once

#include <numeric>

#include "integrators/path/integrator.h"
#include "integrators/path/optimal/hits.h"
#include "integrators/path/optimal/next_event.h"
#include "integrators/path/optimal/update.h"

namespace ambilux {

/// The emitters that are picked most often are a strategy each.
inline EmitterStrategies emitter_strategies(const Scene& scene, uint32_t most) {
    std::vector<uint32_t> order(scene.emitters.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return scene.emitters[a].pick_probability > scene.emitters[b].pick_probability;
    });
    EmitterStrategies s{};
    s.count = std::clamp(uint32_t(order.size()), 1u, most);
    for (size_t k = 0; k < order.size(); ++k) {
        const uint32_t strategy = std::min(uint32_t(k), s.count - 1);
        if (strategy + 1 < s.count) s.emitters[strategy] = order[k];
        s.probability[strategy] += scene.emitters[order[k]].pick_probability;
    }
    return s;
}

template <Features F, class Tracer, Fusion kFusion>
struct PathOptimalIntegrator {
    using Mis = UnidirectionalMis;
    using Path = PathIntegrator<F, Tracer, kFusion, OptimalNextEvent, OptimalSampling, Mis, NoteNextEvents>;
    using State = OptimalState;
    static constexpr bool kFilmWide = false;
    static constexpr uint32_t kPhases = 1;
    static constexpr bool kKeepsIterations = true;  ///< they say what was known before a sample

    struct Policy : Path::Policy {
        StrategyLearning learning;
        PixelBlocks blocks;
    };
    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p = {Path::plan(scene, settings), {}, {}};
        const OptimalSettings& own = p.sampling.settings;
        p.rules.mis.estimator = Estimator::mis;
        p.rules.mis.heuristic = MisHeuristic::balance;
        p.rules.rr_depth = std::max(p.rules.rr_depth, own.vertices + 1);
        p.waves.iteration_samples = own.iteration_samples;
        p.sampling.strategies = emitter_strategies(scene, own.strategies);
        p.learning = {p.sampling.strategies, own.learning};
        p.sampling.records.vertices = own.vertices;
        p.blocks = {scene.sensor.crop_width, scene.sensor.crop_height, own.block};
        return p;
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) { return Path::skipped(scene, p); }

    struct Memory {
        typename Path::Memory path;
        StrategyRecords records;
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        const uint32_t vertices = p.sampling.settings.vertices;
        return {Path::lay_out(layout, p, n), {layout.array<VertexStrategies>(n.slots * vertices), vertices}};
    }

    struct Stages {
        typename Path::Stages path;
        GenerateRecorded<GenerateEye<F, Mis>> generate;
        NoteHits<F, Mis> hits[2];
        AddOptimal add;
        SumNeighbourhoods sum;
        SolveBlocks solve;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& policy, const Memory& m, const State& state)
            : path(parts, recording(policy, m), m.path, {}) {
            const auto note = [&](const char* name) { return parts.layout.record(name); };
            const EmitterStrategies& strategies = policy.sampling.strategies;
            static_cast<GenerateEye<F, Mis>&>(generate) = path.generate;
            generate.records = m.records;
            for (int k = 0; k < 2; ++k)
                hits[k] = {parts.scene, policy.rules, m.path.subpaths.hits[k],
                           strategies,  m.records,    note(NoteHits<F, Mis>::kName)};
            add = {parts.wave,      policy.learning,        m.records, state, parts.film.samples,
                   parts.film.sums, note(AddOptimal::kName)};
            sum = {policy.learning, state, note(SumNeighbourhoods::kName)};
            solve = {policy.learning, state, note(SolveBlocks::kName)};
        }

    private:
        static Policy recording(Policy p, const Memory& m) {
            p.sampling.records = m.records;
            return p;
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& s) { wave(exec, s); });
        run.once([](auto& exec, const Stages& s) {
            exec.for_each(s.sum, s.sum.state.neighbourhoods.count());
            exec.for_each(s.solve, s.solve.state.blocks.count());
        });
    }

private:
    template <class Executor>
    static void wave(Executor& exec, const Stages& s) {
        const typename Path::Stages& p = s.path;
        if (p.policy.rules.max_depth == 0) return;
        Path::template eye_subpaths<kFusion.generate>(
            exec, p, s.generate, [&](int k, const auto&) { exec.for_each(s.hits[k], s.hits[k].hits); });
        exec.run_slots(s.add, p.wave.tiles * kTilePixels, 1);
    }
};

}  // namespace ambilux
