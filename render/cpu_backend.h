// Waves on the CPU: small ones, one per task, so that a wave stays in a core's cache.
#pragma once

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <mutex>

#include "accel/faces.h"
#include "accel/light_tree.h"
#include "accel/shared_accels.h"
#include "backends/cpu/host_memory.h"
#include "backends/cpu/plain_lanes.h"
#include "backends/cpu/whole_executor.h"
#include "backends/fast_cwbvh.h"
#include "backends/fusion.h"
#include "core/error.h"
#include "core/flag.h"
#include "render/state_memory.h"

namespace ambilux {

template <class Integrator, Features F>
class CpuBackend {
    static_assert(contract::Executor<CpuLanesExecutor> && contract::WholeExecutor<CpuWholeExecutor>);

public:
    using Maker = WaveMaker<Integrator, F, HostTracer>;
    using Memory = HostMemory;
    using Stages = typename Maker::Stages;
    static constexpr bool kHost = true;
    static constexpr const char* kName = "cpu";

    explicit CpuBackend(Maker& maker) : maker_(maker) {}

    /// As many as the caller's arena has.
    static uint32_t threads() { return uint32_t(tbb::this_task_arena::max_concurrency()); }
    static BackendBytes bytes() {
        return {host_primitive_bytes(), [](QueuePolicy, uint32_t) { return uint64_t(0); }};
    }
    std::string device() const { return fmt::format("CPU, {} threads", arena_.max_concurrency()); }
    const char* accel() const { return maker_.tracer.use_cwbvh ? "cwbvh" : "embree"; }

    // ---- scene and memory ----

    /// The structure, and what the pilot traces with.
    HostTracer find_structure(SharedAccels& accels) {
        const auto hold = [&](const auto& accel) {
            maker_.tracer = HostTracer(accel->tracer());
            accel_bytes_ = accel->memory_bytes();
            accel_ = accel;
        };
        if (maker_.settings.accel == AccelKind::cwbvh && maker_.settings.build == Build::fast)
            hold(accels.get<FastCwbvhAccel>());
        else if (maker_.settings.accel == AccelKind::cwbvh)
            hold(accels.get<CwbvhAccel>());
        else
            hold(accels.get<EmbreeAccel>());
        faces_ = accels.get<Faces>();
        maker_.view.faces = faces_->data();
        accel_bytes_ += faces_->memory_bytes();
        if (maker_.picks_by_tree()) {
            light_tree_ = accels.get<LightTree>();
            maker_.view.light_tree = light_tree_->view();
            accel_bytes_ += light_tree_->memory_bytes();
        }
        return maker_.tracer;
    }
    void upload(SharedAccels&) {}
    double upload_seconds() const { return 0; }
    Build build() const { return maker_.settings.build; }
    SceneBytes scene_bytes() const { return ambilux::scene_bytes(maker_.scene, TextureMemory::device); }
    uint64_t accel_bytes() const { return accel_bytes_; }
    /// Beside scene, structure, film, state and waves.
    uint64_t other_bytes() const { return 0; }
    uint64_t resident_scene_bytes() const { return scene_bytes().total() + accel_bytes_; }
    uint64_t waves() const { return maker_.threads; }
    /// For film and waves, where `held` bytes are what else there is.
    uint64_t room(uint64_t held) const {
        return maker_.settings.memory ? maker_.settings.memory - std::min(maker_.settings.memory, held) : ~uint64_t(0);
    }
    void refuse_if_full(uint64_t) const {}

    /// The waves of all threads, beside `held` bytes.
    void allocate_waves(uint64_t held) {
        waves_.resize(maker_.threads);
        for (OwnWave& w : waves_) allocate(w, maker_.plan.kept());
        held_ = peak_ = held + planned_wave_bytes();
    }
    uint64_t wave_bytes() const {
        uint64_t bytes = 0;
        for (const OwnWave& w : waves_) bytes += w.layout.bytes();
        return bytes;
    }
    uint64_t planned_wave_bytes() const {
        uint64_t bytes = 0;
        for (const OwnWave& w : waves_) bytes += w.planned_bytes;
        return bytes;
    }
    uint64_t peak_bytes() const { return peak_; }

    /// With the scene's sensor, and without what was counted.
    void begin_anew() {
        maker_.view.sensor = maker_.scene.sensor;
        const uint64_t held = held_ - planned_wave_bytes();
        waves_.clear();
        allocate_waves(held);
    }

    // ---- rendering ----

    void give_up_when(const volatile bool* flag) { give_up_ = flag; }
    /// Waves were left out since it was asked to.
    bool gave_up() const { return is_set(give_up_); }
    /// Samples to render before clocks and signals are looked at again, at most `batch`.
    uint32_t pass(uint32_t batch, const volatile bool*, uint64_t) const {
        return Maker::kFilmWide ? uint32_t(maker_.plan.film_wave.samples) : batch;
    }
    /// Adds samples [first, first + count) of every pixel to the film. Returns how many are finished: all.
    template <class State>
    uint32_t run(uint32_t first, uint32_t count, State& state) {
        arena_.execute([&] {
            uint32_t step = count;
            for (uint32_t s = first; s < first + count; s += step) {
                if constexpr (kWholeIterations<Integrator>)
                    step = maker_.samples_together(s, first + count - s);
                else if constexpr (contract::HasIteration<Integrator>)
                    step = maker_.policy.waves.iteration_samples;
                Iteration<State> iteration = {*this, state, s, step};
                run_iteration<Integrator>(iteration);
                if constexpr (Maker::kFilmWide) update_film(s, step);
            }
        });
        return count;
    }

    void fill(RenderStats& stats) const {
        const Layout* largest = &waves_[0].layout;
        std::vector<StageRecord> total(largest->record_names().size());
        std::vector<const QueueCounter*> counters;
        for (const OwnWave& w : waves_) {
            for (size_t r = 0; r < total.size(); ++r) total[r].add(w.layout.records()[r]);
            counters.push_back(w.layout.counters());
            if (w.layout.bytes() > largest->bytes()) largest = &w.layout;
        }
        fill_stage_stats(largest->record_names(), total, stats);
        fill_queue_stats(*largest, counters, stats);
    }

private:
    /// Queues of one thread. They grow when a wave has more light vertices than any before.
    struct OwnWave : Maker::Memory {
        HostMemory memory;
    };
    /// Tiles of the film, and samples from `first` on.
    struct Part {
        uint32_t first_tile, tiles, first, count;
    };

    /// What run_iteration calls.
    template <class State>
    struct Iteration {
        CpuBackend& backend;
        State& state;
        uint32_t first, count;
        uint32_t phase = 0;
        std::mutex mutex = {};
        std::vector<Part> failed = {};  ///< for want of room in what waves append to

        template <class Body>
        void for_waves(const Body& body) {
            ++phase;
            const Wave& wave = backend.maker_.plan.wave;
            const uint32_t parts = (tile_count(wave) + wave.tiles - 1) / wave.tiles;
            parallel_for(parts, [&](uint32_t p) {
                if (!backend.gave_up()) run({p * wave.tiles, wave.tiles, first, count}, body);
            });
            while (!failed.empty()) {
                backend.grow(state);
                const std::vector<Part> again = std::exchange(failed, {});
                parallel_for(uint32_t(again.size()), [&](uint32_t p) { run(again[p], body); });
            }
        }
        template <class Body>
        void once(const Body& body) {
            OwnWave& w = backend.waves_[0];
            const Wave film = backend.film_wave(first, count);
            CpuWholeExecutor exec;
            body(exec, backend.maker_.stages(w.layout, w, film, backend.maker_.film));
        }

    private:
        /// The waves of a part on the thread that calls it.
        template <class Body>
        void run(const Part& part, const Body& body) {
            Maker& maker = backend.maker_;
            OwnWave& w = backend.waves_[size_t(tbb::this_task_arena::current_thread_index())];
            const uint32_t light_subpaths = light_subpaths_in(maker.plan.wave, part.first_tile, part.tiles,
                                                              maker.policy.waves.light_subpaths_per_tile);
            for (uint32_t s = 0; s < part.count; s += maker.plan.wave.samples) {
                const uint32_t samples = std::min(maker.plan.wave.samples, part.count - s), sample = part.first + s;
                Wave wave = maker.plan.wave;
                wave.tiles = part.tiles;
                wave.state = w.state;
                const FilmBuffers film = backend.film_of(w, part.first_tile, sample - first);
                const Stages stages = maker.stages(w.layout, w, wave, film);
                *w.state = {};
                w.state->first_tile = part.first_tile;
                w.state->first_sample = sample;
                w.state->samples = samples;
                w.state->light_subpaths = samples * light_subpaths;
                w.state->iteration = backend.iteration_of(first);
                CpuLanesExecutor exec(w.state, maker.view, w.order);
                body(exec, stages);
                if (w.state->failed) return again({part.first_tile, part.tiles, sample, part.count - s}, body, w);
                if constexpr (!Maker::kFilmWide)
                    if (phase == phases_of<Integrator>())
                        exec.run_slots(maker.update_film(wave, film, w.layout.record(UpdateFilm::kName)),
                                       part.tiles * kTilePixels, 1);
            }
        }
        /// The rest of a part whose wave had no room. If a budget has none, each half of the wave is a wave of its own:
        /// light subpaths are alike, so that what they bring does not depend on why they were divided.
        template <class Body>
        void again(const Part& rest, const Body& body, OwnWave& w) {
            if (w.state->failed == kAppendedFull) {
                const std::lock_guard lock(mutex);
                failed.push_back(rest);
            } else if (backend.grow(w, rest.tiles)) {
                run(rest, body);
            } else {
                const uint32_t half = rest.tiles / 2;
                run({rest.first_tile, half, rest.first, rest.count}, body);
                run({rest.first_tile + half, rest.tiles - half, rest.first, rest.count}, body);
            }
        }
    };

    uint32_t iteration_of(uint32_t sample) const { return sample / maker_.policy.waves.iteration_samples; }
    /// All of the film, for work that is done once.
    Wave film_wave(uint32_t first, uint32_t count) {
        film_state_ = {};
        film_state_.first_sample = first;
        film_state_.samples = count;
        film_state_.iteration = iteration_of(first);
        Wave wave = maker_.plan.film_wave;
        wave.state = &film_state_;
        return wave;
    }
    /// Where the light of a wave goes; `sample`: of those that are added to the film at once.
    FilmBuffers film_of(const OwnWave& w, uint32_t first_tile, uint32_t sample) const {
        FilmBuffers film = maker_.film;
        if constexpr (Maker::kFilmWide) {
            const Wave& all = maker_.plan.film_wave;
            film.samples += (uint64_t(sample) * all.tiles + first_tile) * kTilePixels;
            film.splats.doubles += uint64_t(sample) * maker_.film_values();
        } else {
            film.samples = w.samples;
        }
        return film;
    }
    void update_film(uint32_t first, uint32_t count) {
        CpuWholeExecutor exec;
        const Wave wave = film_wave(first, count);
        exec.run_slots(maker_.update_film(wave, maker_.film, waves_[0].layout.record(UpdateFilm::kName)),
                       wave.tiles * kTilePixels, 1);
    }

    [[gnu::cold]] void allocate(OwnWave& w, uint32_t kept) {
        const StageRecord* const old = w.layout.records();
        const std::vector<StageRecord> records(old, old + w.layout.record_names().size());
        w = {};
        Layout dry;
        maker_.lay_out(dry, w, kept);
        w.planned_bytes = dry.bytes();
        w.memory = HostMemory(w.planned_bytes);
        w.layout = Layout(dry, w.memory.data());
        maker_.lay_out(w.layout, w, kept);
        const std::vector<QueueCounter> counters = w.layout.first_counters();
        std::copy(counters.begin(), counters.end(), w.layout.counters());
        std::copy(records.begin(), records.end(), w.layout.records());
    }
    /// A wave of `tiles` had more light vertices than there was capacity for. False if a budget leaves no room.
    [[gnu::cold]] bool grow(OwnWave& w, uint32_t tiles) {
        const uint64_t needed = w.layout.most_grown(w.layout.counters());
        const uint32_t kept = uint32_t(std::min<uint64_t>(needed + needed / 4, 1u << 30));
        const uint64_t more = maker_.wave_bytes(kept) - w.planned_bytes;
        if (reserve(more)) return allocate(w, kept), true;
        QueueCounter* const counters = w.layout.counters();
        for (size_t q = 0; q < w.layout.queue_names().size(); ++q)
            counters[q].peak = std::min<uint64_t>(counters[q].peak, counters[q].capacity);
        if (tiles <= 1) refuse_more(more);
        return false;
    }
    /// More room for what waves append to.
    template <class State>
    void grow(State& state) {
        const uint64_t more = state.grown_bytes();  // the old memory lives until all of it is copied
        if (!reserve(more)) refuse_more(more);
        const uint64_t old = state.bytes();
        state.grow();
        held_ -= old;
    }
    [[noreturn]] void refuse_more(uint64_t more) const {
        const uint64_t waves = planned_wave_bytes();
        refuse_budget(maker_.settings, {scene_bytes(), accel_bytes_,
                                        held_ - waves - scene_bytes().total() - accel_bytes_, waves + more});
    }
    /// False if a budget has no room for so many bytes more.
    bool reserve(uint64_t more) {
        uint64_t held = held_;
        do {
            if (maker_.settings.memory > 0 && held + more > maker_.settings.memory) return false;
        } while (!held_.compare_exchange_weak(held, held + more));
        for (uint64_t peak = peak_; peak < held + more && !peak_.compare_exchange_weak(peak, held + more);) {}
        return true;
    }

    Maker& maker_;
    tbb::task_arena arena_{int(threads())};
    std::shared_ptr<const void> accel_;
    std::shared_ptr<const Faces> faces_;
    std::shared_ptr<const LightTree> light_tree_;  ///< light_picking=tree only
    std::vector<OwnWave> waves_;
    WaveState film_state_{};
    const volatile bool* give_up_ = nullptr;
    std::atomic<uint64_t> held_ = 0, peak_ = 0;  ///< bytes, by all waves and all else
    uint64_t accel_bytes_ = 0;
};

}  // namespace ambilux
