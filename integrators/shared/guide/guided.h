// A method whose subpaths sample directions from what it has learned about where light comes from (Müller, Gross
// and Novák 2017, "Practical Path Guiding for Efficient Light-Transport Simulation"; Müller 2019, "Path Guiding in
// Production", chapter 10; Rath et al. 2020, "Variance-Aware Path Guiding").
#pragma once

#include "accel/host_tracer.h"
#include "integrators/shared/guide/update.h"
#include "stages/generate.h"

namespace ambilux {

/// `Method` renders without learning, with weights GuidedMis. It has, beside what methods have
/// (integrators/contract.h):
///   Training(stages, note)        what paths outside of the image need; note(name): a record of statistics
///   wave<kFused>(exec, stages or training, generate, before)   one wave; generate, kFused and before:
///   start_eye_subpaths
///                                 and repeat_depths
template <Features F, class Tracer, Fusion kFusion, class Method>
struct GuidedOf {
    using Unguided = Method;
    using Mis = typename Method::Mis;
    using State = GuidedStates;
    static constexpr bool kFilmWide = Method::kFilmWide;
    static constexpr uint32_t kPhases = kGuideRounds + 1;
    static constexpr uint32_t kTrainingPaths = 1u << 20;  ///< of an iteration, at most
    static constexpr uint32_t kMostSamples = 256;         ///< of an iteration, unless it is told

    struct Policy : Method::Policy {
        GuidedSettings guided;
        GuideTraining training;
    };
    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p = {Method::plan(scene, settings), GuidedSettings::plan(settings), {}};
        const Sensor& s = scene.sensor;
        // With the splats of bdpt a film of 1920x1080 and its trees fit in 256 MiB.
        if (p.guided.most_leaves == 0) p.guided.most_leaves = Mis::kBidirectional ? 4096 : 8192;
        if (p.guided.iteration_samples == 0)
            p.guided.iteration_samples = iteration_samples(uint64_t(s.crop_width) * s.crop_height, settings);
        p.waves.iteration_samples = p.guided.iteration_samples;
        p.training.until = p.guided.until;
        p.training.tiles = ((s.crop_width + kTileSide - 1) / kTileSide) * ((s.crop_height + kTileSide - 1) / kTileSide);
        const uint64_t paths = uint64_t(s.crop_width) * s.crop_height * p.guided.iteration_samples;
        while (p.training.shift < kMostShift && paths >> p.training.shift > kTrainingPaths) ++p.training.shift;
        return p;
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) { return Method::skipped(scene, p); }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed)
        requires kFilmWide
    {
        return Method::pilot(p, scene, tracer, seed);
    }

    struct Memory {
        typename Method::Memory method;
        GuideRecords records;
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        Memory m;
        m.method = Method::lay_out(layout, p, n);
        m.records = {layout.array<GuideRecord>(p.training.places(n.slots)),
                     layout.allocate<uint32_t>(n.slots >> p.training.shift)};
        return m;
    }

    struct Stages {
        typename Method::Stages render;
        typename Method::Training train;
        GenerateGuided<GenerateEye<F, Mis>> generate;
        GenerateTraining<GenerateGuided<GenerateEye<F, Mis>>> generate_training;
        RecordRays<Mis> record[2];
        LearnRecords learn;
        LearnImportance<F, Mis> importance[2] = {};
        GuideStep update[2] = {};  ///< by side

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& policy, const Memory& m, const State& all)
            : Stages(parts, m, all.around(parts.scene), policy) {}

        /// Those of training round `round`: paths of random numbers that no other has, and records of their own.
        Stages of_round(uint32_t round) const {
            Stages s = *this;
            number_training(s.train, round);
            for (Wave* wave : {&s.generate_training.wave, &s.learn.wave, &s.importance[0].wave, &s.importance[1].wave})
                wave->first_key = (round + 1) * wave->width * wave->height;
            s.generate_training.round = round;
            s.generate_training.share = s.learn.share =
                min(s.learn.training.shift + kGuideRounds - 1 - round, kMostShift);
            s.learn.round = round;
            return s;
        }

    private:
        static Policy guided_by(Policy p, const State& s) {
            p.rules.mis.trees = followed<Mis::kBidirectional>(s, p.guided);
            p.rules.directions = {p.rules.mis.trees, p.guided.roulette};
            return p;
        }
        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Memory& m, const State& s, const Policy& p)
            : render(parts, guided_by(p, s), m.method, NoState()),
              train(render, [&](const char* name) { return parts.layout.record(name); }) {
            const auto note = [&](const char* name) { return parts.layout.record(name); };
            const Lane* const samples = parts.film.samples;
            static_cast<GenerateEye<F, Mis>&>(generate) = render.generate;
            generate.over_pixel = s.eye.over_pixel;
            generate.training = p.training;
            generate.made = m.records.made;
            static_cast<GenerateGuided<GenerateEye<F, Mis>>&>(generate_training) = generate;
            static_cast<GenerateEye<F, Mis>&>(generate_training) = train.generate;
            generate_training.record = note("train_generate");
            generate_training.progress = s.eye.progress;
            for (int k = 0; k < 2; ++k)
                record[k] = {parts.wave,    p.training, m.method.subpaths.hits[k],
                             m.records,     samples,    note(RecordRays<Mis>::kName),
                             s.eye.progress};
            learn = {{parts.wave, p.training, p.guided, s.eye, note(LearnRecords::kName)}, m.records, samples};
            update[0] = {s.eye, p.guided, note(GuideStep::kName)};
            if (!s.has_light()) return;
            update[1] = {s.light, p.guided.of_light(), update[0].record};
            for (int k = 0; k < 2; ++k)
                importance[k] = {
                    {parts.wave, p.training, update[1].settings, s.light, note(LearnImportance<F, Mis>::kName)},
                    parts.scene,
                    m.method.subpaths.hits[k],
                    s.eye.progress};
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        for (uint32_t round = 0; round < kGuideRounds; ++round) {
            run.for_waves([round](auto& exec, const Stages& all) {
                const Stages s = all.of_round(round);
                paths<false>(exec, s, s.train, s.generate_training);  // of some slots alone
            });
            run.once([round](auto& exec, const Stages& s) { learn(exec, s, round); });
        }
        run.for_waves([](auto& exec, const Stages& s) { paths<kFusion.generate>(exec, s, s.render, s.generate); });
        run.once([](auto& exec, const Stages& s) { learn(exec, s, kGuideRounds); });
    }

private:
    static constexpr uint32_t kMostShift = 6;  ///< of GuideTraining: one slot of a tile

    /// Where guide_samples leaves it open, a power of two: that of a film of so many pixels, and if it is known how
    /// many samples there will be, one that divides them and lets trees become better several times.
    static uint32_t iteration_samples(uint64_t pixels, const RenderSettings& settings) {
        const uint64_t paths = std::is_same_v<Tracer, HostTracer> ? 1u << 18 : 1u << 23,
                       samples = settings.expected_samples;
        uint32_t n = 1;
        while (n < kMostSamples && 2 * n * pixels <= paths) n *= 2;
        while (n > 1 && samples > 0 && (samples % n != 0 || 8 * uint64_t(n) > samples)) n /= 2;
        return n;
    }

    /// One wave of the image, or outside of it.
    template <bool kFused, class Executor, class Paths, class Generate>
    static void paths(Executor& exec, const Stages& s, const Paths& p, const Generate& generate) {
        if (s.render.policy.rules.max_depth == 0) return;
        const GuidedSettings& guided = s.learn.settings;
        Method::template wave<kFused>(exec, p, generate, [&](int k, const auto&) {
            if (guided.guides(Side::eye)) exec.for_each(s.record[k], s.record[k].hits);
            if constexpr (Mis::kBidirectional)
                if (guided.guides(Side::light)) exec.for_each(s.importance[k], s.importance[k].hits);
        });
        exec.run_slots(s.learn, s.render.wave.tiles * kTilePixels >> s.learn.training.shift);
    }
    template <class Executor>
    static void learn(Executor& exec, const Stages& s, uint32_t round) {
        for (GuideStep step : s.update) {
            step.round = round;
            if (step.state.most_leaves > 0) GuideUpdate::of(step).run(exec);
        }
    }
};

/// Eye stages of training round `round`, and the names under which statistics have them.
template <class EyeStages>
void number_training(EyeStages& s, uint32_t round) {
    const uint32_t first_key = (round + 1) * s.wave.width * s.wave.height;
    const auto rekey = [&](auto&... stages) { ((stages.wave.first_key = first_key), ...); };
    rekey(s, s.extend[0], s.extend[1], s.eye_vertex[0], s.eye_vertex[1], s.connect_emitter);
}
template <class EyeStages, class Note>
void name_training(EyeStages& s, const Note& note) {
    for (auto& stage : s.extend) stage.record = note("train_extend");
    for (auto& stage : s.eye_vertex) stage.record = note("train_shade");
}

}  // namespace ambilux
