// Renders on a CUDA device: one graph per wave.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "accel/host_tracer.h"
#include "accel/shared_accels.h"
#include "backends/cuda/device_scene.h"
#include "backends/cuda/executor.cuh"
#include "backends/cuda/handles.h"
#include "backends/cuda/mean_on_device.h"
#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "integrators/integrator.h"
#include "render/device_film.h"
#include "render/device_wave.h"
#include "render/statistics.h"
#include "scene/info.h"

namespace ambilux {

template <class Integrator, Features F>
class CudaRenderer final : public Renderer {
    static constexpr bool kFilmWide = Integrator::kFilmWide;
    /// It keeps something from wave to wave, which is brought up to date after each.
    static constexpr bool kLearns =
        requires(Layout& layout, typename Integrator::Policy& policy) { Integrator::lay_out_kept(layout, policy); };
    using Stages = typename Integrator::Stages;

public:
    CudaRenderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), settings_(settings), policy_(Integrator::plan(scene, settings)),
          traced_(settings.specialise ? scene.features : kAllFeatures), use_graph_(settings.graph) {
        const auto start = Clock::now();
        take_accel(settings, accels);
        double mean = 0;
        if constexpr (kFilmWide) {
            const HostTracer tracer(accels.get<CwbvhAccel>()->tracer());
            mean = Integrator::pilot(policy_, scene.view(), tracer, settings.seed);
            if constexpr (requires { Stages::kTracesConnections; })
                policy_.traces_connections = Stages::kTracesConnections && traces_connections(policy_, accel_->bytes());
        }
        device_scene_->drop_texels();
        if constexpr (kLearns) allocate_kept();
        shape(settings, mean);
        const uint64_t kept = policy_.waves.keeps_light_vertices
                                  ? planned_light_vertices(mean, policy_.waves.most_light_subpaths(wave_.slot_count()))
                                  : 0;
        Layout film;
        lay_out_film(film, wave_, policy_.waves, kFilmWide);
        const Layout queues = plan_queues(kept, film.bytes());
        film_memory_ = DeviceBuffer<std::byte>(film.bytes(), "film");
        film_memory_.zero();
        Layout placed(film, film_memory_.data());
        film_ = lay_out_film(placed, wave_, policy_.waves, kFilmWide);
        clock_ = DeviceBuffer<uint64_t>(1);
        stream_ = make_stream();
        allocate_queues(queues, kept);
        device_scene_->prefetch_texels(stream_.get());
        build_seconds_ = seconds_since(start);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) {
            // All waves of a pass are queued at once; the host waits for the last.
            const uint32_t pass = std::min(count - done, preferred_batch());
            const auto pass_start = Clock::now();
            const uint32_t waves_before = read_state().done;
            uint32_t waves_per_sample = 0;
            for (uint32_t tile = 0; tile < tile_count(wave_); tile += wave_.tiles) ++waves_per_sample;
            film_is_whole_ = false;
            for (uint32_t s = 0; s < pass; s += wave_.samples)
                for (uint32_t tile = 0; tile < tile_count(wave_); tile += wave_.tiles)
                    launch_wave(tile, first + done + s, std::min(wave_.samples, pass - s));
            cuda_check(cudaStreamSynchronize(stream_.get()), "wave");
            const WaveState state = read_state();
            const uint32_t finished = std::min(pass, (state.done - waves_before) / waves_per_sample * wave_.samples);
            film_is_whole_ = true;
            samples_ += finished;
            film_samples_ += finished;
            if (state.failed) grow();
            done += finished;
            if (finished == 0) continue;
            measured_seconds_ = seconds_since(pass_start);
            measured_samples_ = finished;
        }
        render_seconds_ += seconds_since(start);
        return done;
    }

    FilmMoments film() override {
        check_film();
        return read_film(film_.sums, film_samples_);
    }
    void clear_film() override {
        for (double* sums : {film_.sums.sum, film_.sums.sum_squares})
            cuda_check(cudaMemset(sums, 0, film_values() * sizeof(double)), "clear the film");
        cuda_check(cudaDeviceSynchronize(), "clear the film");  // waves run on a stream of their own
        film_samples_ = 0;
        film_is_whole_ = true;
    }
    /// Waits for a copy on the device alone, whose memory is so much faster than the bus.
    std::function<FilmMoments()> take_film() override {
        check_film();
        const uint64_t values = film_values();
        try {
            if (taken_.size() == 0) taken_ = DeviceBuffer<double>(2 * values, "a film that is handed over");
        } catch (const Error&) {
            return Renderer::take_film();  // no room for it
        }
        const FilmSums taken = {taken_.data(), taken_.data() + values};
        for (const auto& [to, from] :
             {std::pair{taken.sum, film_.sums.sum}, {taken.sum_squares, film_.sums.sum_squares}})
            cuda_check(cudaMemcpy(to, from, values * sizeof(double), cudaMemcpyDeviceToDevice), "take the film");
        const uint64_t samples = film_samples_;
        clear_film();
        return [this, taken, samples] { return read_film(taken, samples); };
    }
    std::optional<DeviceImage> device_image() override {
        check_film();
        return mean_on_device(film_.sums.sum, wave_.width, wave_.height, film_samples_);
    }

    RenderStats stats() override {
        RenderStats s;
        s.backend = "cuda";
        s.device = device_name_;
        s.accel = pairs_ ? "bvh2" : "cwbvh";
        s.settings = settings_;
        s.build_seconds = build_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        if (memory_.size() > 0) read_counts();
        fill_stage_stats(layout_.record_names(), records_, s);
        fill_queue_stats(layout_, {counters_.data()}, s);
        s.memory_bytes = fixed_bytes() + memory_.bytes();
        s.memory_bytes_predicted = fixed_bytes() + layout_.bytes();
        s.features = feature_names(F);
        s.skipped = Integrator::skipped(scene_, policy_);
        skipped_features(F, s.skipped);
        return s;
    }

    std::vector<StrategyImage> strategy_images() override {
        const uint32_t depth = policy_.waves.strategy_depth;
        if (depth == 0) return {};
        return ambilux::strategy_images(depth, samples_,
                                        read(film_.strategies, strategy_values(depth, film_values() / 3)),
                                        read(film_.strategies_dropped, strategy_count(depth)));
    }

    uint32_t preferred_batch() const override {
        return whole_waves(batch_of(measured_seconds_, measured_samples_), wave_.samples);
    }

private:
    using Executor = CudaExecutor<!kFilmWide>;  ///< binary BVHs are there for the path tracer

    void take_accel(const RenderSettings& settings, SharedAccels& accels) {
        if (settings.accel != AccelKind::bvh2) accels.get<CwbvhAccel>();  // its bytes count where the scene is checked
        device_scene_ = accels.get<DeviceScene>();
        if (settings.accel == AccelKind::bvh2)
            pairs_.emplace(PairAccel(scene_).arrays());
        else
            accel_ = accels.get<DeviceCwbvh>();
    }
    /// The copy may have been made for a renderer with another camera.
    SceneView device_view() const {
        SceneView view = device_scene_->view();
        view.sensor = scene_.sensor;
        return view;
    }
    /// Which tiles and how many samples a wave holds.
    void shape(const RenderSettings& settings, double mean) {
        constexpr uint32_t kMillion = 1u << 20;
        const bool streams = policy_.waves.slots_in_flight > 0;
        if (streams) policy_.waves.slots_in_flight = kMillion;
        Layout million;
        Integrator::lay_out(
            million, policy_,
            {kMillion, uint32_t(planned_light_vertices(mean, policy_.waves.most_light_subpaths(kMillion)))});
        const uint64_t splat_bytes = !kFilmWide ? 0 : settings.deterministic ? 3 * sizeof(double) : sizeof(Lane);
        const uint64_t bytes_per_path = (million.bytes() >> 20) + splat_bytes + sizeof(Lane);
        const uint32_t plateau = streams ? kStreamPlateau : kFilmWide ? kFilmWidePlateau : kWavePlateau;
        const uint32_t size = device_wave_size(scene_, settings, plateau, bytes_per_path, free_device_bytes());
        wave_ = shape_wave(scene_, settings.seed, size, ~0u);
        if (kFilmWide) {  // splats may land anywhere
            wave_.tiles = tile_count(wave_);
            wave_.samples = std::max(1u, size / (wave_.tiles * kTilePixels));
        }
        if (streams) {
            policy_.waves.slots_in_flight = size;
            wave_.samples = stream_samples(size, wave_.tiles * kTilePixels, settings.expected_samples, kLightRay - 1);
        }
        light_subpaths_ = light_subpaths_in(wave_, 0, wave_.tiles, policy_.waves.light_subpaths_per_tile);
        if (uint64_t(light_subpaths_) * wave_.samples > 0xffffffffull)
            throw Error(ExitCode::usage, "wave_size=" + std::to_string(settings.wave_size) +
                                             ": more light subpaths than can be numbered; set a smaller one, or fewer "
                                             "light_paths");
        policy_.waves.multi_bounce_below = multi_bounce_below(settings, wave_.slot_count());
    }
    void allocate_kept() {
        Layout plan;
        Integrator::lay_out_kept(plan, policy_);
        kept_ = DeviceBuffer<std::byte>(plan.bytes(), "what waves learn");
        kept_.zero();
        Layout placed(plan, kept_.data());
        Integrator::lay_out_kept(placed, policy_);
        Integrator::fill_kept(policy_, [](auto* to, const auto& values) {
            cuda_check(cudaMemcpy(to, values.data(), values.size() * sizeof(*to), cudaMemcpyHostToDevice),
                       "what waves learn");
        });
    }
    uint64_t fixed_bytes() const {
        return kept_.bytes() + device_scene_->bytes() + (pairs_ ? pairs_->bytes() : accel_->bytes()) +
               film_memory_.bytes() + clock_.bytes();
    }

    /// Memory of a wave, and what works on it.
    struct WaveParts {
        WaveState* state;
        OrderMemory order;
        Stages stages;
    };
    WaveParts lay_out(Layout& layout, uint32_t kept) {
        const uint32_t slots = wave_.slot_count(), listed = policy_.waves.order_slots(slots);
        WaveState* const state = layout.allocate<WaveState>(1);
        const typename Integrator::Memory queues = Integrator::lay_out(layout, policy_, {slots, kept});
        const OrderMemory order =
            lay_out_order(layout, policy_.waves.queues, listed, order_temporary_bytes(policy_.waves.queues, listed));
        wave_.state = state;
        const CwbvhTracer tracer = accel_ ? accel_->tracer() : CwbvhTracer();
        layout.record(UpdateFilm::kName);
        if constexpr (kLearns) layout.record(Integrator::kLearnName);
        return {state, order, Stages(layout, device_view(), tracer, policy_, wave_, queues, film_)};
    }
    uint64_t film_values() const { return uint64_t(wave_.width) * wave_.height * 3; }

    /// Queues for `kept` light vertices, which must fit beside `other_bytes`.
    Layout plan_queues(uint64_t kept, uint64_t other_bytes) {
        if (kept > 0xf0000000ull)
            throw Error(ExitCode::device,
                        "light subpaths have more vertices than can be numbered: set a max_depth or "
                        "a smaller wave_size");
        Layout plan;
        lay_out(plan, uint32_t(kept));
        check_memory(plan.bytes() + other_bytes, free_device_bytes(), wave_.slot_count());
        return plan;
    }
    /// The queues, and the graph that uses them.
    void allocate_queues(const Layout& plan, uint64_t kept) {
        memory_ = DeviceBuffer<std::byte>(plan.bytes(), "queues");
        memory_.zero();
        layout_ = Layout(plan, memory_.data());
        const WaveParts parts = lay_out(layout_, uint32_t(kept));
        const std::vector<QueueCounter> counters = layout_.first_counters();
        cuda_check(cudaMemcpy(layout_.counters(), counters.data(), counters.size() * sizeof(QueueCounter),
                              cudaMemcpyHostToDevice),
                   "queue counters");
        state_ = parts.state;
        stages_.emplace(parts.stages);
        executor_.emplace(stream_.get(), traced_, state_, clock_.data(), device_view(), parts.order);
        if constexpr (!kFilmWide)
            if (pairs_) executor_->use(pairs_->tracer());
        graph_.reset();
        if (use_graph_) graph_ = executor_->capture([&](Executor& exec) { run(exec); });
        cuda_check(cudaDeviceSynchronize(), "preparation");
    }
    void run(Executor& exec) {
        Integrator::schedule(exec, *stages_);
        const UpdateFilm update = {wave_, film_.samples, film_.splats, film_.sums, layout_.record(UpdateFilm::kName)};
        exec.run_slots(update, wave_.tiles * kTilePixels, 1);
        if constexpr (kLearns) {
            const auto learn = Integrator::learn(policy_, state_, layout_.record(Integrator::kLearnName));
            if (const uint32_t items = Integrator::items_to_learn(policy_)) exec.run_slots(learn, items, 1);
        }
        exec.finish_wave();
    }
    void launch_wave(uint32_t tile, uint32_t sample, uint32_t samples) {
        const WaveState state = {
            tile, sample, samples, 0, 0, 0, samples * light_subpaths_, policy_.waves.slots_in_flight};
        detail::set_wave<<<1, 1, 0, stream_.get()>>>(state_, state);
        cuda_check(cudaGetLastError(), "wave");
        if (graph_)
            cuda_check(cudaGraphLaunch(graph_.get(), stream_.get()), "wave");
        else
            executor_->launch([&](Executor& exec) { run(exec); });
    }
    /// A wave had more light vertices than there was capacity for.
    void grow() {
        read_counts();
        uint64_t needed = 0;
        for (size_t q = 0; q < counters_.size(); ++q)
            if (layout_.queue_names()[q] == "light_vertices" || layout_.queue_names()[q] == "splats")
                needed = std::max(needed, counters_[q].peak);
        memory_ = DeviceBuffer<std::byte>();
        needed += needed / 4;
        allocate_queues(plan_queues(needed, 0), needed);
        cuda_check(cudaMemcpy(layout_.records(), records_.data(), records_.size() * sizeof(StageRecord),
                              cudaMemcpyHostToDevice),
                   "statistics");
    }
    void read_counts() {
        records_ = read(layout_.records(), layout_.record_names().size());
        counters_ = read(layout_.counters(), layout_.queue_names().size());
    }
    FilmMoments read_film(const FilmSums& sums, uint64_t samples) const {
        return {wave_.width, wave_.height, samples, read(sums.sum, film_values()),
                read(sums.sum_squares, film_values())};
    }
    /// What a fault interrupts leaves waves in the film that are not counted.
    void check_film() const {
        if (!film_is_whole_)
            throw Error(ExitCode::device, "the device failed in the middle of a sample: its film is lost");
    }

    template <class T>
    static std::vector<T> read(const T* place, size_t count) {
        std::vector<T> values(count);
        cuda_check(cudaMemcpy(values.data(), place, count * sizeof(T), cudaMemcpyDeviceToHost), "statistics");
        return values;
    }
    WaveState read_state() const { return read(static_cast<const WaveState*>(state_), 1)[0]; }

    const Scene& scene_;
    RenderSettings settings_;
    typename Integrator::Policy policy_;
    Features traced_;  ///< what rays are traced for
    bool use_graph_;
    std::string device_name_ = cuda_device_name();  ///< asked for once: stats() is called often
    Wave wave_{};
    Layout layout_;
    std::vector<StageRecord> records_;    ///< as last read: they outlast a failure to grow
    std::vector<QueueCounter> counters_;  ///< likewise
    bool film_is_whole_ = true;
    uint32_t light_subpaths_ = 0;  ///< of one sample
    uint64_t samples_ = 0, film_samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
    std::shared_ptr<const DeviceScene> device_scene_;
    std::shared_ptr<const DeviceCwbvh> accel_;
    std::optional<DevicePairs> pairs_;  ///< instead, with accel=bvh2
    DeviceBuffer<std::byte> memory_, film_memory_, kept_;
    DeviceBuffer<double> taken_;  ///< by take_film
    FilmBuffers film_{};
    DeviceBuffer<uint64_t> clock_;
    WaveState* state_ = nullptr;
    Owned<cudaStream_t> stream_;
    std::optional<Stages> stages_;
    std::optional<Executor> executor_;
    Owned<cudaGraphExec_t> graph_;
};

}  // namespace ambilux
