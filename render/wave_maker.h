// What waves are made of, on every backend: places in memory, and the stages that work on them.
#pragma once

#include "backends/handed_rays.h"
#include "integrators/contract.h"
#include "render/statistics.h"
#include "render/wave_plan.h"

namespace ambilux {

/// Bytes that sorts and lists of a backend take beside their operands.
struct BackendBytes {
    PrimitiveBytes primitives;
    uint64_t (*order)(QueuePolicy policy, uint32_t slots);
};

/// Memory of one wave.
template <class Integrator>
struct WaveMemory {
    Layout layout;
    uint64_t planned_bytes = 0;  ///< of the layout, by its dry run
    WaveState* state = nullptr;
    Lane* samples = nullptr;  ///< of eye subpaths, where they are not those of the film
    typename Integrator::Memory queues;
    OrderMemory order;
    HandedRays handed;  ///< accel=optix
};

template <class Integrator, Features F, class SomeTracer>
struct WaveMaker {
    using Tracer = SomeTracer;
    using Stages = typename Integrator::Stages;
    using State = typename Integrator::State;
    using Memory = WaveMemory<Integrator>;
    static constexpr bool kFilmWide = Integrator::kFilmWide;

    const Scene& scene;
    const RenderSettings settings;
    const uint32_t threads;  ///< of a host; 0: a device
    const BackendBytes bytes;
    typename Integrator::Policy policy = Integrator::plan(scene, settings);
    WavePlan plan{scene, settings, policy.waves, kFilmWide, threads, kWholeIterations<Integrator>};
    SceneView view = scene.view();
    Tracer tracer{};
    FilmBuffers film{};
    State state{};
    uint32_t appended = 0;  ///< capacity of what all waves append to

    /// Samples of the iterations that are done at once from sample `first` on, at most `most`, which are whole ones.
    uint32_t samples_together(uint32_t first, uint32_t most) const {
        const uint32_t k = policy.waves.iteration_samples;
        uint32_t iterations = std::min(most, plan.film_wave.samples) / k;
        if constexpr (requires { policy.together(0u); }) iterations = std::min(iterations, policy.together(first / k));
        return iterations * k;
    }

    /// The renderer has a tree of lights.
    bool picks_by_tree() const { return F.sampling && settings.light_picking == LightPicks::tree; }

    /// Samples lie in the memory of a wave until they are added to the film, or copied there.
    bool keeps_samples() const { return !kFilmWide || (threads == 0 && plan.in_parts()); }

    /// Lays out a wave with room for `kept` light vertices. Cold, as constructors of stages are: else the compiler
    /// inlines them as much as stages, which takes a third of a renderer's compile time.
    [[gnu::cold]] Stages lay_out(Layout& layout, Memory& m, uint32_t kept) {
        const uint32_t slots = plan.wave.slot_count(), listed = policy.waves.order_slots(slots);
        m.state = layout.allocate<WaveState>(1);
        m.samples = layout.allocate<Lane>(keeps_samples() ? slots : 0);
        m.queues = Integrator::lay_out(layout, policy, {slots, kept, bytes.primitives});
        m.order = lay_out_order(layout, policy.waves.queues, listed, bytes.order(policy.waves.queues, listed));
        m.handed = HandedRays::lay_out(layout, settings.accel == AccelKind::optix ? slots : 0);
        layout.record(UpdateFilm::kName);
        Wave wave = plan.wave;
        wave.state = m.state;
        FilmBuffers buffers = film;
        if (keeps_samples()) buffers.samples = m.samples;
        return stages(layout, m, wave, buffers);
    }
    /// The stages over what is laid out, for a part of the film.
    [[gnu::cold]] Stages stages(Layout& layout, const Memory& m, const Wave& wave, const FilmBuffers& buffers) const {
        return Stages(WaveParts<Tracer>{layout, view, tracer, wave, buffers}, policy, m.queues, state);
    }
    uint64_t wave_bytes(uint32_t kept) {
        Memory m;
        Layout dry;
        lay_out(dry, m, kept);
        return dry.bytes();
    }

    State lay_out_state(Layout& layout) const { return State::lay_out(layout, policy, {appended, bytes.primitives}); }
    uint64_t state_bytes() const {
        Layout dry;
        lay_out_state(dry);
        return dry.bytes();
    }

    uint64_t film_values() const { return uint64_t(plan.wave.width) * plan.wave.height * 3; }
    /// Memory of the film must be zero at first. A sample of any pixel may splat on any other one, so that each pixel
    /// has a sum for every sample of a wave.
    [[gnu::cold]] FilmBuffers lay_out_film(Layout& layout) const {
        const uint64_t values = film_values(), pixels = values / 3;
        const uint64_t cells = kFilmWide ? pixels * plan.film_wave.samples : 0;
        const bool doubles = threads > 0 || policy.waves.deterministic;
        FilmBuffers f{};
        f.sums = {layout.allocate<double>(values), layout.allocate<double>(values)};
        f.samples = layout.allocate<Lane>(kFilmWide ? plan.film_wave.slot_count() : 0);
        if (cells && doubles) f.splats.doubles = layout.allocate<double>(cells * 3);
        if (cells && !doubles) f.splats.floats = layout.allocate<Lane>(cells);
        if (const uint32_t images = policy.waves.strategy_images()) {
            f.strategies = layout.allocate<double>(strategy_values(images, pixels));
            f.strategies_dropped = layout.allocate<uint64_t>(images);
        }
        return f;
    }
    uint64_t film_bytes() const {
        Layout dry;
        lay_out_film(dry);
        return dry.bytes();
    }
    UpdateFilm update_film(const Wave& wave, const FilmBuffers& buffers, StageRecord* record) const {
        return {wave, buffers.samples, buffers.splats, buffers.sums, record};
    }
};

}  // namespace ambilux
