// The film of one sample by any integrator: its schedule over one wave of the whole film, on the calling thread.
#pragma once

#include <memory>
#include <vector>

#include "accel/light_tree.h"
#include "backends/cpu/executor.h"
#include "integrators/integrator.h"
#include "tests/support/catch.h"
#include "transport/emitter/light_tree.h"

namespace ambilux {

/// Values of the film's channels, row by row.
template <class Integrator, class Tracer>
std::vector<double> wave_film(const Scene& scene, const Tracer& tracer, const typename Integrator::Policy& policy,
                              uint64_t seed, uint32_t sample) {
    const uint32_t tiles = tile_count(shape_wave(scene, seed, kTilePixels, 1));
    Wave wave = shape_wave(scene, seed, tiles * kTilePixels, tiles);
    WaveState state{};
    state.first_sample = sample;
    state.samples = wave.samples = 1;
    wave.state = &state;
    const uint32_t slots = wave.slot_count();
    std::vector<Lane> samples(slots);
    std::vector<double> splats(size_t(wave.width) * wave.height * 3), sum(splats.size()), squares(splats.size());
    const FilmBuffers film = {samples.data(), {splats.data(), nullptr}, {sum.data(), squares.data()}};
    SceneView view = scene.view();
    std::unique_ptr<LightTree> tree;
    if constexpr (std::is_same_v<decltype(policy.rules.lights), LightsByTree>) {
        tree = std::make_unique<LightTree>(scene);
        view.light_tree = tree->view();
    }
    const auto lay_out = [&](Layout& layout) {
        const auto memory = Integrator::lay_out(layout, policy, {slots, slots * 64});
        const WaveParts<Tracer> parts = {layout, view, tracer, wave, film};
        return std::pair(std::make_unique<typename Integrator::Stages>(parts, policy, memory, NoState()),
                         UpdateFilm{wave, samples.data(), film.splats, film.sums, layout.record(UpdateFilm::kName)});
    };
    Layout plan;
    lay_out(plan);
    std::vector<Lane> bytes(plan.bytes() / sizeof(Lane) + 16);
    void* start = bytes.data();
    size_t room = bytes.size() * sizeof(Lane);
    Layout layout(plan, std::align(256, plan.bytes(), start, room));
    const auto [stages, update] = lay_out(layout);
    const std::vector<QueueCounter> counters = layout.first_counters();
    std::copy(counters.begin(), counters.end(), layout.counters());
    CpuExecutor executor(&state);
    Integrator::schedule(executor, *stages);
    for (uint32_t i = 0; i < wave.tiles * kTilePixels; ++i) update(i);
    REQUIRE(state.failed == 0);
    return sum;
}

}  // namespace ambilux
