// Renders on the CPU: small waves, one per task, so that a wave stays in a core's cache.
#pragma once

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <new>

#include "accel/faces.h"
#include "accel/host_tracer.h"
#include "accel/shared_accels.h"
#include "backends/cpu/executor.h"
#include "backends/cpu/wave_bytes.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/parallel.h"
#include "integrators/integrator.h"
#include "integrators/keeps.h"
#include "render/cpu_wave.h"
#include "render/statistics.h"
#include "render/wave_plan.h"
#include "scene/info.h"

namespace ambilux {

template <class Integrator, Features F>
class CpuRenderer final : public Renderer {
public:
    CpuRenderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), settings_(settings), view_(scene.view()), policy_(Integrator::plan(scene, settings)),
          accel_name_(settings.accel == AccelKind::cwbvh ? "cwbvh" : "embree") {
        const auto start = Clock::now();
        shape(cpu_wave_size(settings));
        try {
            take_accel(settings, accels);
            double mean = 0;
            if constexpr (kFilmWide) mean = Integrator::pilot(policy_, view_, tracer_, settings.seed);
            if constexpr (kLearns) allocate_kept();
            fit(mean);
            allocate_film();
            waves_.resize(size_t(arena_.max_concurrency()));
            for (WaveMemory& w : waves_) allocate(w, planned_kept(mean));
            held_ = peak_ = planned_bytes(mean);
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
                parallel_for(chunks,
                             [&](uint32_t c) { render_tiles(c * wave_.tiles, wave_.tiles, first + done, pass); });
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
        s.wave_paths = policy_.waves.order_slots(wave_.slot_count());
        s.memory_bytes = s.memory_bytes_predicted = fixed_bytes().total();
        s.memory_bytes_peak = peak_;
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
    static constexpr bool kLearns = KeepsBetweenWaves<Integrator>;

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

    /// A wave of about `size` paths.
    void shape(uint32_t size) {
        wave_ = cpu_wave(scene_, settings_, arena_.max_concurrency(), size);
        if (!kFilmWide) return;
        wave_.samples = 1;  // a sample is complete when all its waves are done
        film_wave_ = wave_;
        film_wave_.tiles = (tile_count(wave_) + wave_.tiles - 1) / wave_.tiles * wave_.tiles;
        film_wave_.state = &film_state_;
        if (policy_.waves.slots_in_flight)
            policy_.waves.slots_in_flight = std::max(kTilePixels, wave_.slot_count() / 4);
    }
    /// Makes waves smaller until all of them fit into settings.memory, beside all else.
    void fit(double mean) {
        if (settings_.memory == 0) return;
        const auto fits = [&](uint32_t tiles) {
            shape(tiles * kTilePixels);
            return planned_bytes(mean) <= settings_.memory;
        };
        const uint32_t most = std::max(1u, cpu_wave_size(settings_) / kTilePixels);
        const uint32_t best = largest_that_fits(settings_.wave_size ? most : 1, most, fits);
        shape(std::max(best, settings_.wave_size ? most : 1) * kTilePixels);
        if (best > 0) return;
        RenderBytes least = fixed_bytes();
        least.waves = planned_bytes(mean) - least.total();
        refuse_budget(settings_, least);
    }
    uint64_t planned_bytes(double mean) {
        return fixed_bytes().total() + uint64_t(arena_.max_concurrency()) * wave_bytes(planned_kept(mean));
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
        faces_ = accels.get<Faces>();
        view_.faces = faces_->data();
        accel_bytes_ += faces_->memory_bytes();
    }
    /// Each array of the film with its number of values.
    template <class Function>
    void each_array(Function f) {
        const uint64_t values = uint64_t(wave_.width) * wave_.height * 3;
        f(film_.sum, values);
        f(film_.sum_squares, values);
        if (!kFilmWide) return;
        f(film_samples_, film_wave_.slot_count());
        f(splats_, values);
        f(strategies_, strategy_values(policy_.waves.strategy_depth, values / 3));
        f(strategies_dropped_, strategy_count(policy_.waves.strategy_depth));
    }
    void allocate_film() {
        film_.width = wave_.width;
        film_.height = wave_.height;
        each_array([](auto& array, uint64_t values) { array.resize(values); });
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
    RenderBytes fixed_bytes() {
        uint64_t film = kept_.size() * sizeof(Lane);
        each_array([&](const auto& array, uint64_t values) { film += values * sizeof(array[0]); });
        return {scene_bytes(scene_, TextureMemory::device), accel_bytes_, film, 0};
    }
    uint32_t planned_kept(double mean) const {
        const uint64_t subpaths = policy_.waves.most_light_subpaths(wave_.slot_count());
        return policy_.waves.keeps_light_vertices ? planned_light_vertices(mean, subpaths) : 0;
    }

    typename Integrator::Stages lay_out(Layout& layout, WaveMemory& w, uint32_t kept) {
        const uint32_t slots = wave_.slot_count();
        w.state = layout.allocate<WaveState>(1);
        w.samples = layout.allocate<Lane>(kFilmWide ? 0 : slots);
        w.queues = Integrator::lay_out(layout, policy_, {slots, kept});
        w.order = lay_out_order(layout, policy_.waves.queues, policy_.waves.order_slots(slots));
        return stages(layout, w, 0, wave_.tiles);
    }
    uint64_t wave_bytes(uint32_t kept) {
        WaveMemory w;
        Layout plan;
        lay_out(plan, w, kept);
        return plan.bytes();
    }
    void allocate(WaveMemory& w, uint32_t kept) {
        const StageRecord* const old = w.layout.records();
        const std::vector<StageRecord> records(old, old + w.layout.record_names().size());
        w = {};
        Layout plan;
        lay_out(plan, w, kept);
        w.planned_bytes = plan.bytes();
        w.bytes = make_wave_bytes(w.planned_bytes);
        w.layout = Layout(plan, w.bytes.get());
        lay_out(w.layout, w, kept);
        const std::vector<QueueCounter> counters = w.layout.first_counters();
        std::copy(counters.begin(), counters.end(), w.layout.counters());
        std::copy(records.begin(), records.end(), w.layout.records());
    }
    typename Integrator::Stages stages(Layout& layout, WaveMemory& w, uint32_t first_tile, uint32_t tiles) {
        Wave wave = wave_;
        wave.tiles = tiles;
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

    void render_tiles(uint32_t first_tile, uint32_t tiles, uint32_t first_sample, uint32_t count) {
        WaveMemory& w = waves_[size_t(tbb::this_task_arena::current_thread_index())];
        const uint32_t light_subpaths =
            light_subpaths_in(wave_, first_tile, tiles, policy_.waves.light_subpaths_per_tile);
        const auto stages = this->stages(w.layout, w, first_tile, tiles);
        CpuExecutor executor(w.state, view_, w.order);
        for (uint32_t s = 0; s < count; s += wave_.samples) {
            const uint32_t samples = std::min(wave_.samples, count - s);
            *w.state = {first_tile, first_sample + s, samples, 0, 0, 0, samples * light_subpaths};
            Integrator::schedule(executor, stages);
            if (w.state->failed) {
                if (grow(w, tiles)) return render_tiles(first_tile, tiles, first_sample + s, count - s);
                render_tiles(first_tile, tiles / 2, first_sample + s, count - s);
                return render_tiles(first_tile + tiles / 2, tiles - tiles / 2, first_sample + s, count - s);
            }
            if constexpr (!kFilmWide)
                executor.run_slots(UpdateFilm{stages.wave, w.samples, {}, sums(), w.layout.record(UpdateFilm::kName)},
                                   tiles * kTilePixels, 1);
        }
    }
    /// A wave of `tiles` had more light vertices than there was capacity for. False if a budget leaves no room: then
    /// each half of the wave is a wave of its own. Light subpaths are alike, so that what they bring does not depend on
    /// why they were divided.
    bool grow(WaveMemory& w, uint32_t tiles) {
        uint64_t needed = 0;
        for (size_t q = 0; q < w.layout.queue_names().size(); ++q)
            if (w.layout.queue_names()[q] == "light_vertices" || w.layout.queue_names()[q] == "splats")
                needed = std::max(needed, w.layout.counters()[q].peak);
        const uint32_t kept = uint32_t(std::min<uint64_t>(needed + needed / 4, 1u << 30));
        if (reserve(wave_bytes(kept) - w.planned_bytes)) return allocate(w, kept), true;
        QueueCounter* const counters = w.layout.counters();
        for (size_t q = 0; q < w.layout.queue_names().size(); ++q)
            counters[q].peak = std::min<uint64_t>(counters[q].peak, counters[q].capacity);
        if (tiles > 1) return false;
        RenderBytes least = fixed_bytes();
        least.waves = held_ + wave_bytes(kept) - w.planned_bytes - least.total();
        refuse_budget(settings_, least);
    }
    /// False if a budget has no room for so many bytes more.
    bool reserve(uint64_t more) {
        uint64_t held = held_;
        do {
            if (settings_.memory > 0 && held + more > settings_.memory) return false;
        } while (!held_.compare_exchange_weak(held, held + more));
        for (uint64_t peak = peak_; peak < held + more && !peak_.compare_exchange_weak(peak, held + more);) {}
        return true;
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
    std::shared_ptr<const Faces> faces_;
    std::vector<WaveMemory> waves_;
    std::vector<Lane> film_samples_, kept_;
    std::vector<double> splats_, strategies_;
    std::vector<uint64_t> strategies_dropped_;
    FilmMoments film_;
    std::atomic<uint64_t> held_ = 0, peak_ = 0;  ///< bytes, by all waves and all else
    uint64_t accel_bytes_ = 0, samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
};

}  // namespace ambilux
