// bdpt, variant aware: a cache of light vertices as in lvc, from which eye vertices draw as many as their pixel has.
#pragma once

#include "integrators/bdpt/aware/settings.h"
#include "integrators/bdpt/aware/source.h"
#include "integrators/bdpt/shared/two_sides.h"
#include "integrators/kept_state.h"

namespace ambilux {

struct AwarePolicy : BdptPolicyOf<PixelMis> {
    AwareSettings aware;
};

/// The map, which follows from the settings.
struct AwareState {
    static constexpr StateKind kKind = StateKind::none;

    uint16_t* counts;

    static AwareState lay_out(Layout& layout, const AwarePolicy& p, const StateSize&) {
        return {layout.allocate<uint16_t>(p.aware.map.counts.size())};
    }
    template <class Put>
    void init(const AwarePolicy& p, Put put) const {
        put(counts, p.aware.map.counts);
    }
    template <class Visit>
    void for_each_saved(Visit) const {}
};

template <Features F, class Tracer, Fusion kFusion>
struct AwareIntegrator {
    using Policy = AwarePolicy;
    using State = AwareState;
    using Memory = TwoSidesMemory<PixelMis>;
    static constexpr bool kFilmWide = true;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p{plan_bdpt<PixelMis>(scene, settings), AwareSettings::plan(settings)};
        p.aware.check(scene, settings);
        if (!p.rules.connect) return p;
        p.cache_draws = p.aware.map.most();
        p.coherent_draws = settings.draws == CacheDraws::coherent;
        p.one_connection_per_launch |= p.cache_draws == 1;
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        if (!p.light_subpaths()) return 0.0;
        const double mean = mean_light_vertices<F>(scene, tracer, p.rules, seed);
        if (mean > 0.0) p.rules.mis.per_draw = float(1.0 / mean);
        return mean;
    }
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        return Memory::template lay_out<kFusion, F>(layout, p, n);
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies(scene, p);
    }

    struct Stages : TwoSidesStages<F, Tracer, kFusion, PixelSource> {
        using TwoSides = TwoSidesStages<F, Tracer, kFusion, PixelSource>;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State& state)
            : TwoSides(parts, with_map(p, state), m, PixelSource{m.light_vertices, p.cache_draws, p.coherent_draws}) {}

    private:
        /// Weights know it.
        static BdptPolicyOf<PixelMis> with_map(BdptPolicyOf<PixelMis> p, const ConnectionsMap& map,
                                               const State& state) {
            p.rules.mis.counts = {state.counts, map.x, map.y};
            return p;
        }
        static BdptPolicyOf<PixelMis> with_map(const Policy& p, const State& state) {
            return with_map(p, p.aware.map, state);
        }
    };

    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        run_two_sides(exec, s);
    }
};

}  // namespace ambilux
