// What becomes of light that eye subpaths find: emission and candidates, weighted, tested, added to their samples.
// Which of these stages run as parts of others is the type's matter (Fusion).
#pragma once

#include "integrators/integrator.h"
#include "stages/arrival.h"

namespace ambilux {

/// Queues that lie between the stages of one depth. `Learn`: see Occlude.
template <class Mis, class Learn = LearnNothing>
struct EyeQueues {
    Queue<VertexItem<Mis>> vertices;
    Queue<EmissionItem> emission;
    Queue<Contribution> emission_contributions;
    Queue<typename Learn::Candidate> candidates;
    Queue<typename Learn::Item> shadows;
    Queue<Contribution> shadow_contributions;
    Lane* raw;  ///< StrategyFilm

    EyeQueues() = default;
    /// `slots`: items of a depth; `paths`: of the wave; `connects`: rules let vertices be connected with anything.
    template <Fusion K, Features F>
    [[gnu::cold]] static EyeQueues lay_out(Layout& layout, uint32_t slots, uint32_t paths, const Rules<Mis>& rules,
                                           const WavePolicy& waves) {
        const bool by_path = waves.queues.fixed_places(),
                   hits = !K.weigh && (rules.count_hits || rules.count_environment);
        const uint32_t connects = rules.next_event || rules.connect ? slots : 0, emits = hits ? slots : 0;
        EyeQueues q;
        q.vertices = layout.queue<VertexItem<Mis>>("vertices", K.connect ? 0 : connects, by_path,
                                                   VertexItem<Mis>::template lanes<F>());
        q.emission = layout.queue<EmissionItem>("emission", emits, by_path);
        q.emission_contributions = layout.queue<Contribution>("emission_contributions", emits, by_path);
        q.candidates = layout.queue<typename Learn::Candidate>("candidates", K.weigh ? 0 : connects, by_path);
        q.shadows = layout.queue<typename Learn::Item>("shadows", connects, by_path && !K.occlude);
        q.shadow_contributions = layout.queue<Contribution>("shadow_contributions", K.weigh ? 0 : connects, by_path);
        q.raw = layout.allocate<Lane>(waves.strategy_depth ? paths : 0);
        return q;
    }
};

/// The stages behind the vertex stages. `Learn`: see Occlude.
template <Features F, class Tracer, Fusion K, class Learn = LearnNothing>
struct EyeSide {
    using Contributions = std::conditional_t<K.weigh, Accumulate, Queue<Contribution>>;
    using EmissionStage = WeighEmission<Contributions>;
    using OccludeStage = Occlude<F, Tracer, Contributions, Learn>;
    using Shadows = std::conditional_t<K.occlude, Gathered<OccludeStage>, Queue<typename Learn::Item>>;
    using WeighStage = WeighCandidates<Shadows, typename Learn::Candidate>;
    using Emission = std::conditional_t<K.weigh, EmissionStage, Queue<EmissionItem>>;
    using Candidates = std::conditional_t<K.weigh, WeighStage, Queue<typename Learn::Candidate>>;

    Accumulate accumulate_emission, accumulate;
    EmissionStage weigh_emission;
    OccludeStage occlude;
    WeighStage weigh;

    template <class Mis>
    [[gnu::cold]] EyeSide(const WaveParts<Tracer>& parts, const EyeQueues<Mis, Learn>& q, const WavePolicy& waves,
                          const Learn& learn = {}) {
        const auto& [layout, scene, tracer, wave, film] = parts;
        const StrategyFilm strategies = {film.strategies, film.strategies_dropped, q.raw, waves.strategy_depth};
        StageRecord* const accumulates = layout.record(Accumulate::kName);
        StageRecord* const weighs = layout.record(WeighStage::kName);
        accumulate_emission = {q.emission_contributions, film.samples, accumulates, wave, strategies};
        accumulate = {q.shadow_contributions, film.samples, accumulates, wave, strategies};
        weigh_emission = {q.emission, choose<K.weigh>(accumulate_emission, q.emission_contributions), weighs,
                          strategies};
        occlude = {scene,
                   tracer,
                   q.shadows,
                   choose<K.weigh>(accumulate, q.shadow_contributions),
                   layout.record(OccludeStage::kName),
                   strategies,
                   learn};
        // One by one where a path keeps what came of its last candidate, or what it has brought decides about the next.
        const uint32_t gathered = strategies.sums || waves.cull > 0.0f ? 1 : q.shadows.capacity();
        weigh = {q.candidates, choose<K.occlude>(Gathered<OccludeStage>{occlude, wave.state, gathered}, q.shadows),
                 weighs,       strategies,
                 film.samples, waves.cull};
    }

    Emission emission() const { return choose<K.weigh>(weigh_emission, weigh_emission.candidates); }
    Candidates candidates() const { return choose<K.weigh>(weigh, weigh.candidates); }
    /// Where the last of candidates or shadow rays are counted, and how many there may be.
    const QueueCounter* candidate_counter() const {
        return K.weigh ? occlude.shadows.counter : weigh.candidates.counter;
    }
    uint32_t candidate_capacity() const { return K.weigh ? occlude.shadows.capacity() : weigh.candidates.capacity(); }
};

/// Emission of one depth: weighted, added to its paths.
template <class Executor, Features F, class Tracer, Fusion K, class Learn>
void run_emission([[maybe_unused]] Executor& exec, [[maybe_unused]] const EyeSide<F, Tracer, K, Learn>& eye) {
    if constexpr (!K.weigh) {
        exec.run(eye.weigh_emission);
        exec.run(eye.accumulate_emission);
    }
}

/// Candidates of one launch: weighted, tested, added to their paths. `needs_atomic_add`: a path may have several.
template <class Executor, Features F, class Tracer, Fusion K, class Learn>
void run_candidates(Executor& exec, const EyeSide<F, Tracer, K, Learn>& eye, bool needs_atomic_add) {
    if constexpr (!K.weigh) exec.run(eye.weigh);
    if constexpr (K.occlude)
        exec.trace_gathered(eye.occlude);
    else
        exec.trace(eye.occlude.with_atomic_add(needs_atomic_add));
    if constexpr (!K.weigh) {
        Accumulate accumulate = eye.accumulate;
        accumulate.needs_atomic_add = needs_atomic_add;
        exec.run(accumulate);
    }
}

}  // namespace ambilux
