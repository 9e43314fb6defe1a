// Renders on the CPU: small waves, one per task, so that a wave stays in a core's cache.
#pragma once

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <new>

#include "accel/host_tracer.h"
#include "accel/shared_accels.h"
#include "backends/cpu/executor.h"
#include "backends/cpu/wave_bytes.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/parallel.h"
#include "integrators/integrator.h"
#include "render/cpu_wave.h"
#include "render/statistics.h"
#include "scene/info.h"

namespace ambilux {

template <class Integrator, Features F>
class CpuRenderer final : public Renderer {
public:
    CpuRenderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), settings_(settings), view_(scene.view()), policy_(Integrator::plan(scene, settings)),
          accel_name_(settings.accel == AccelKind::cwbvh ? "cwbvh" : "embree") {
        const auto start = Clock::now();
        shape(settings);
        const uint64_t values = uint64_t(wave_.width) * wave_.height * 3;
        try {
            take_accel(settings, accels);
            allocate_film(values);
            double mean = 0;
            if constexpr (kFilmWide) mean = Integrator::pilot(policy_, view_, tracer_, settings.seed);
            if constexpr (kLearns) allocate_kept();
            const uint64_t kept = planned_kept(mean, policy_.waves.most_light_subpaths(wave_.slot_count()));
            waves_.resize(size_t(arena_.max_concurrency()));
            for (WaveMemory& w : waves_) allocate(w, uint32_t(kept));
        } catch (const std::bad_alloc&) {
            throw Error(ExitCode::device,
                        fmt::format("out of memory: a film of {}x{} needs more than there is; a smaller --size or "
                                    "wave_size needs less",
                                    wave_.width, wave_.height));
        }
        build_seconds_ = seconds_since(start);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) {
            const uint32_t pass = kFilmWide ? 1 : std::min(count - done, preferred_batch());
            const auto pass_start = Clock::now();
            arena_.execute([&] {
                const uint32_t chunks = (tile_count(wave_) + wave_.tiles - 1) / wave_.tiles;
                parallel_for(chunks, [&](uint32_t c) { render_tiles(c * wave_.tiles, first + done, pass); });
                if constexpr (kFilmWide) update_film(first + done);
                if constexpr (kLearns) learn();
            });
            done += pass;
            measured_seconds_ = seconds_since(pass_start);
            measured_samples_ = pass;
        }
        film_.samples += done;
        samples_ += done;
        render_seconds_ += seconds_since(start);
        return done;
    }

    FilmMoments film() override { return film_; }

    void clear_film() override {
        std::fill(film_.sum.begin(), film_.sum.end(), 0.0);
        std::fill(film_.sum_squares.begin(), film_.sum_squares.end(), 0.0);
        film_.samples = 0;
    }

    RenderStats stats() override {
        RenderStats s;
        s.backend = "cpu";
        s.device = fmt::format("CPU, {} threads", arena_.max_concurrency());
        s.accel = accel_name_;
        s.settings = settings_;
        s.build_seconds = build_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        s.memory_bytes = s.memory_bytes_predicted = fixed_bytes();
        const Layout* largest = &waves_[0].layout;
        std::vector<StageRecord> total(largest->record_names().size() + 1);
        std::vector<const QueueCounter*> counters;
        for (const WaveMemory& w : waves_) {
            for (size_t r = 0; r + 1 < total.size(); ++r) total[r].add(w.layout.records()[r]);
            counters.push_back(w.layout.counters());
            s.memory_bytes += w.layout.bytes();
            s.memory_bytes_predicted += w.planned_bytes;
            if (w.layout.bytes() > largest->bytes()) largest = &w.layout;
        }
        total.back() = film_record_;
        std::vector<std::string> names = largest->record_names();
        names.emplace_back(UpdateFilm::kName);
        fill_stage_stats(names, total, s);
        fill_queue_stats(*largest, counters, s);
        s.features = feature_names(F);
        s.skipped = Integrator::skipped(scene_, policy_);
        skipped_features(F, s.skipped);
        return s;
    }

    std::vector<StrategyImage> strategy_images() override {
        return ambilux::strategy_images(policy_.waves.strategy_depth, samples_, strategies_, strategies_dropped_);
    }

    uint32_t preferred_batch() const override { return batch_of(measured_seconds_, measured_samples_); }

private:
    static constexpr bool kFilmWide = Integrator::kFilmWide;
    /// It keeps something from wave to wave, which is brought up to date after each sample.
    static constexpr bool kLearns =
        requires(Layout& layout, typename Integrator::Policy& policy) { Integrator::lay_out_kept(layout, policy); };

    /// Queues of one thread. They grow when a wave has more light vertices than any before.
    struct WaveMemory {
        Layout layout;
        uint64_t planned_bytes = 0;  ///< of the layout, by its dry run
        WaveBytes bytes;
        WaveState* state = nullptr;
        Lane* samples = nullptr;
        typename Integrator::Memory queues;
        OrderMemory order;
    };

    void shape(const RenderSettings& settings) {
        wave_ = cpu_wave(scene_, settings, arena_.max_concurrency());
        if (!kFilmWide) return;
        wave_.samples = 1;  // a sample is complete when all its waves are done
        film_wave_ = wave_;
        film_wave_.tiles = (tile_count(wave_) + wave_.tiles - 1) / wave_.tiles * wave_.tiles;
        film_wave_.state = &film_state_;
        if (policy_.waves.slots_in_flight)
            policy_.waves.slots_in_flight = std::max(kTilePixels, wave_.slot_count() / 4);
    }
    void take_accel(const RenderSettings& settings, SharedAccels& accels) {
        const auto take = [&](const auto& accel) {
            tracer_ = HostTracer(accel->tracer());
            accel_bytes_ = accel->memory_bytes();
            accel_ = accel;
        };
        if (settings.accel == AccelKind::cwbvh)
            take(accels.get<CwbvhAccel>());
        else
            take(accels.get<EmbreeAccel>());
    }
    void allocate_film(uint64_t values) {
        film_.width = wave_.width;
        film_.height = wave_.height;
        film_.sum.resize(values);
        film_.sum_squares.resize(values);
        if (!kFilmWide) return;
        film_samples_.resize(film_wave_.slot_count());
        splats_.resize(values);
        strategies_.resize(strategy_values(policy_.waves.strategy_depth, values / 3));
        strategies_dropped_.resize(strategy_count(policy_.waves.strategy_depth));
    }
    void allocate_kept() {
        Layout plan;
        Integrator::lay_out_kept(plan, policy_);
        kept_ = std::vector<Lane>((plan.bytes() + sizeof(Lane) - 1) / sizeof(Lane));
        Layout placed(plan, reinterpret_cast<std::byte*>(kept_.data()));
        Integrator::lay_out_kept(placed, policy_);
        Integrator::fill_kept(policy_,
                              [](auto* to, const auto& values) { std::copy(values.begin(), values.end(), to); });
    }
    void learn() {
        const auto stage = Integrator::learn(policy_, &film_state_, nullptr);
        if (stage.is_due()) parallel_for(Integrator::items_to_learn(policy_), [&](uint32_t i) { stage(i); }, 64u);
    }
    /// All but the waves.
    uint64_t fixed_bytes() const {
        return scene_.memory_bytes() + accel_bytes_ + (film_.sum.size() + film_.sum_squares.size()) * sizeof(double) +
               kept_.size() * sizeof(Lane) + (splats_.size() + strategies_.size()) * sizeof(double) +
               film_samples_.size() * sizeof(Lane);
    }
    uint64_t planned_kept(double mean, uint64_t subpaths) const {
        return policy_.waves.keeps_light_vertices ? planned_light_vertices(mean, subpaths) : 0;
    }

    typename Integrator::Stages lay_out(Layout& layout, WaveMemory& w, uint32_t kept) {
        const uint32_t slots = wave_.slot_count();
        w.state = layout.allocate<WaveState>(1);
        w.samples = layout.allocate<Lane>(kFilmWide ? 0 : slots);
        w.queues = Integrator::lay_out(layout, policy_, {slots, kept});
        w.order = lay_out_order(layout, policy_.waves.queues, policy_.waves.order_slots(slots));
        return stages(layout, w, 0);
    }
    void allocate(WaveMemory& w, uint32_t kept) {
        const WaveMemory old = std::exchange(w, {});
        Layout plan;
        lay_out(plan, w, kept);
        w.planned_bytes = plan.bytes();
        w.bytes = make_wave_bytes(w.planned_bytes);
        w.layout = Layout(plan, w.bytes.get());
        lay_out(w.layout, w, kept);
        const std::vector<QueueCounter> counters = w.layout.first_counters();
        std::copy(counters.begin(), counters.end(), w.layout.counters());
        for (size_t r = 0; r < old.layout.record_names().size(); ++r) w.layout.records()[r] = old.layout.records()[r];
    }
    typename Integrator::Stages stages(Layout& layout, WaveMemory& w, uint32_t first_tile) {
        Wave wave = wave_;
        wave.state = w.state;
        Lane* const samples = kFilmWide ? film_samples_.data() + size_t(first_tile) * kTilePixels : w.samples;
        const FilmBuffers film = {samples,
                                  {splats_.data(), nullptr},
                                  sums(),
                                  strategies_.empty() ? nullptr : strategies_.data(),
                                  strategies_dropped_.data()};
        if constexpr (!kFilmWide) layout.record(UpdateFilm::kName);
        return {layout, view_, tracer_, policy_, wave, w.queues, film};
    }
    FilmSums sums() { return {film_.sum.data(), film_.sum_squares.data()}; }

    void render_tiles(uint32_t first_tile, uint32_t first_sample, uint32_t count) {
        WaveMemory& w = waves_[size_t(tbb::this_task_arena::current_thread_index())];
        const uint32_t light_subpaths =
            light_subpaths_in(wave_, first_tile, wave_.tiles, policy_.waves.light_subpaths_per_tile);
        const auto stages = this->stages(w.layout, w, first_tile);
        CpuExecutor executor(w.state, view_, w.order);
        for (uint32_t s = 0; s < count; s += wave_.samples) {
            const uint32_t samples = std::min(wave_.samples, count - s);
            *w.state = {first_tile,
                        first_sample + s,
                        samples,
                        0,
                        0,
                        0,
                        samples * light_subpaths,
                        policy_.waves.slots_in_flight};
            Integrator::schedule(executor, stages);
            if (w.state->failed) {
                grow(w);
                return render_tiles(first_tile, first_sample + s, count - s);
            }
            if constexpr (!kFilmWide)
                executor.run_slots(UpdateFilm{stages.wave, w.samples, {}, sums(), w.layout.record(UpdateFilm::kName)},
                                   wave_.tiles * kTilePixels, 1);
        }
    }
    /// A wave had more light vertices than there was capacity for.
    void grow(WaveMemory& w) {
        uint64_t needed = 0;
        for (size_t q = 0; q < w.layout.queue_names().size(); ++q)
            if (w.layout.queue_names()[q] == "light_vertices" || w.layout.queue_names()[q] == "splats")
                needed = std::max(needed, w.layout.counters()[q].peak);
        allocate(w, uint32_t(std::min<uint64_t>(needed + needed / 4, 1u << 30)));
    }

    void update_film(uint32_t sample) {
        const auto start = Clock::now();
        film_state_ = {0, sample, 1, 0, 0, 0, 0};
        parallel_for(uint32_t(film_wave_.tiles), [&](uint32_t tile) {
            StageRecord record{};
            const UpdateFilm stage = {film_wave_, film_samples_.data(), {splats_.data(), nullptr}, sums(), &record};
            for (uint32_t i = 0; i < kTilePixels; ++i) stage(tile * kTilePixels + i);
            if (record.nan + record.inf + record.negative == 0) return;
            __atomic_fetch_add(&film_record_.nan, record.nan, __ATOMIC_RELAXED);
            __atomic_fetch_add(&film_record_.inf, record.inf, __ATOMIC_RELAXED);
            __atomic_fetch_add(&film_record_.negative, record.negative, __ATOMIC_RELAXED);
        });
        film_record_.add(film_wave_.slot_count(), 0, uint64_t(seconds_since(start) * 1e9));
    }

    const Scene& scene_;
    RenderSettings settings_;
    SceneView view_;
    typename Integrator::Policy policy_;
    std::string accel_name_;
    tbb::task_arena arena_;
    Wave wave_{}, film_wave_{};  ///< of one task, and of the whole film
    WaveState film_state_{};
    StageRecord film_record_{};
    HostTracer tracer_;
    std::shared_ptr<const void> accel_;
    std::vector<WaveMemory> waves_;
    std::vector<Lane> film_samples_, kept_;
    std::vector<double> splats_, strategies_;
    std::vector<uint64_t> strategies_dropped_;
    FilmMoments film_;
    uint64_t accel_bytes_ = 0, samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
};

}  // namespace ambilux
