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
#include "render/device_kept.cuh"
#include "render/device_plan.h"
#include "render/statistics.h"
#include "render/wave_plan.h"
#include "scene/info.h"

namespace ambilux {

template <class Integrator, Features F>
class CudaRenderer final : public Renderer {
    static constexpr bool kFilmWide = Integrator::kFilmWide;
    static constexpr bool kLearns = KeepsBetweenWaves<Integrator>;
    using Stages = typename Integrator::Stages;

public:
    CudaRenderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), settings_(settings), policy_(Integrator::plan(scene, settings)),
          traced_(settings.specialise ? scene.features : kAllFeatures), use_graph_(settings.graph) {
        const auto start = Clock::now();
        if (settings.accel == AccelKind::bvh2)
            take(PairAccel(scene_).arrays(), accels);
        else
            take(accels.get<CwbvhAccel>()->arrays(), accels);
        device_scene_->drop_texels();
        kept_.allocate(policy_);
        const uint64_t room = room_for_film_and_waves();
        prefer(settings.memory ? room : room / 2);
        fit(room, true);
        allocate_film();
        clock_ = DeviceBuffer<uint64_t>(1);
        stream_ = make_stream();
        allocate_queues();
        if (settings.memory == 0) device_scene_->prefetch_texels(stream_.get());
        build_seconds_ = seconds_since(start);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        while (next_tile_ > 0 || (done < count && !is_set(interrupt))) {
            // All waves of a pass are queued at once; the host waits for the last. Of parts, those of one sample:
            // behind one that failed, those of the next sample would overwrite what is done of this one.
            const bool one = plan_.in_parts() || is_set(interrupt);
            uint32_t pass = one ? 1 : std::min(count - done, preferred_batch());
            if (kLearns) pass = learning_pass(pass, samples_, plan_.wave.samples);
            const auto pass_start = Clock::now();
            const uint32_t waves_before = read_state().done, first_tile = next_tile_;
            film_is_whole_ = false;
            for (uint32_t s = 0; s < pass; s += plan_.wave.samples) {
                for (uint32_t tile = s ? 0 : first_tile; tile < tile_count(plan_.wave); tile += plan_.wave.tiles)
                    launch_wave(tile, first + done + s, std::min(plan_.wave.samples, pass - s));
                if (plan_.in_parts()) finish_whole_sample(first + done + s);
            }
            cuda_check(cudaStreamSynchronize(stream_.get()), "wave");
            const WaveState state = read_state();
            const WaveProgress progress = progress_of(plan_.wave, first_tile, state.done - waves_before);
            next_tile_ = progress.next_tile;
            const uint32_t finished = std::min(pass, progress.samples);
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
        const uint64_t bytes = held_bytes() + 2 * values * sizeof(double) + image_bytes();
        if (taken_.size() == 0 && settings_.memory > 0 && bytes > settings_.memory) return Renderer::take_film();
        try {
            if (taken_.size() == 0) taken_ = DeviceBuffer<double>(2 * values, "a film that is handed over");
        } catch (const Error&) {
            return Renderer::take_film();  // no room for it
        }
        note_peak();
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
        note_peak(image_bytes());
        return mean_on_device(film_.sums.sum, plan_.wave.width, plan_.wave.height, film_samples_);
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
        s.wave_paths = policy_.waves.order_slots(plan_.wave.slot_count());
        if (memory_.size() > 0) read_counts();
        fill_stage_stats(layout_.record_names(), records_, s);
        fill_queue_stats(layout_, {counters_.data()}, s);
        s.memory_bytes = held_bytes();
        s.memory_bytes_predicted = held_bytes() - memory_.bytes() + layout_.bytes();
        s.memory_bytes_peak = peak_;
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
        return whole_waves(batch_of(measured_seconds_, measured_samples_), plan_.wave.samples);
    }

private:
    using Executor = CudaExecutor<!kFilmWide>;  ///< binary BVHs are there for the path tracer

    /// With `arrays` of the structure on the host: the pilot; whether the least fits into a budget; then the copies.
    template <class Arrays>
    void take(const Arrays& arrays, SharedAccels& accels) {
        if constexpr (kFilmWide) {
            const HostTracer tracer(accels.get<CwbvhAccel>()->tracer());
            plan_.mean = Integrator::pilot(policy_, scene_.view(), tracer, settings_.seed);
            if constexpr (requires { Stages::kTracesConnections; })
                policy_.traces_connections = Stages::kTracesConnections && traces_connections(policy_, arrays.bytes());
        }
        kept_.plan(policy_);
        scene_bytes_ = scene_bytes(scene_, settings_.textures);
        accel_bytes_ = arrays.bytes();
        plan_.shape_least();
        if (settings_.memory > 0 && needed_bytes(true) + fixed_bytes() > settings_.memory)
            refuse(needed_bytes(true), true);
        device_scene_ = accels.get<DeviceScene>();
        if constexpr (std::is_same_v<Arrays, PairArrays>)
            pairs_.emplace(arrays);
        else
            accel_ = accels.get<DeviceCwbvh>();
    }
    /// The copy may have been made for a renderer with another camera.
    SceneView device_view() const {
        SceneView view = device_scene_ ? device_scene_->view() : scene_.view();  // of a plan no one looks at it
        view.sensor = scene_.sensor;
        return view;
    }
    /// Makes waves fit into `room` bytes, with the film if that is not there yet.
    void fit(uint64_t room, bool with_film) {
        const bool fits = plan_.fit(room, [&] { return needed_bytes(with_film); });
        if (!fits) refuse(needed_bytes(with_film), with_film);
    }
    /// Slots of a wave that do well are counted from the bytes of a million.
    void prefer(uint64_t room) {
        constexpr uint32_t kMillion = 1u << 20;
        if (plan_.streams()) policy_.waves.slots_in_flight = kMillion;
        Layout million;
        const uint64_t subpaths = policy_.waves.most_light_subpaths(kMillion);
        Integrator::lay_out(million, policy_, {kMillion, planned_light_vertices(plan_.mean, subpaths)});
        const uint64_t splat_bytes = !kFilmWide ? 0 : settings_.deterministic ? 3 * sizeof(double) : sizeof(Lane);
        plan_.shape_preferred((million.bytes() >> 20) + splat_bytes + sizeof(Lane), room);
    }
    [[noreturn]] void refuse(uint64_t needed, bool with_film) {
        const uint64_t free = device_scene_ ? free_device_bytes() : ~uint64_t(0);
        if (settings_.memory == 0 || needed > free) refuse_wave(needed, free, plan_.wave.slot_count());
        Layout plan;
        lay_out_film(plan, plan_.film_wave, policy_.waves, kFilmWide);
        const uint64_t film = with_film ? plan.bytes() : film_memory_.bytes();
        refuse_budget(settings_, {scene_bytes_, accel_bytes_, film + image_bytes() + kept_.planned(),
                                  needed - (with_film ? film : 0)});
    }
    /// Of the scene, its structure, what waves learn, a clock, and an image that may be asked for.
    uint64_t fixed_bytes() const {
        return scene_bytes_.total() + accel_bytes_ + kept_.planned() + sizeof(uint64_t) + image_bytes();
    }
    uint64_t image_bytes() const { return film_values() * sizeof(float); }
    /// Of what is free, and of what is left of a budget.
    uint64_t room_for_film_and_waves() const {
        const uint64_t free = free_device_bytes(), held = fixed_bytes() + film_memory_.bytes() + taken_.bytes();
        return settings_.memory ? std::min(free, settings_.memory - std::min(settings_.memory, held)) : free;
    }
    uint64_t needed_bytes(bool with_film) {
        Layout film, queues;
        if (with_film) lay_out_film(film, plan_.film_wave, policy_.waves, kFilmWide);
        lay_out(queues, plan_.kept());
        return queues.bytes() + (with_film ? film.bytes() : 0);
    }
    uint64_t held_bytes() const {
        return device_scene_->bytes() + (pairs_ ? pairs_->bytes() : accel_->bytes()) + film_memory_.bytes() +
               kept_.bytes() + clock_.bytes() + memory_.bytes() + taken_.bytes();
    }
    /// `more`: what is not the renderer's for long.
    void note_peak(uint64_t more = 0) { peak_ = std::max(peak_, held_bytes() + more); }

    /// Memory of a wave, and what works on it.
    struct WaveParts {
        WaveState* state;
        OrderMemory order;
        Stages stages;
    };
    WaveParts lay_out(Layout& layout, uint32_t kept) {
        const uint32_t slots = plan_.wave.slot_count(), listed = policy_.waves.order_slots(slots);
        WaveState* const state = layout.allocate<WaveState>(1);
        const typename Integrator::Memory queues = Integrator::lay_out(layout, policy_, {slots, kept});
        const OrderMemory order =
            lay_out_order(layout, policy_.waves.queues, listed, order_temporary_bytes(policy_.waves.queues, listed));
        plan_.wave.state = plan_.film_wave.state = state;
        FilmBuffers film = film_;
        if (plan_.in_parts()) film.samples = layout.allocate<Lane>(slots);
        part_samples_ = film.samples;
        const CwbvhTracer tracer = accel_ ? accel_->tracer() : CwbvhTracer();
        layout.record(UpdateFilm::kName);
        if constexpr (kLearns) layout.record(Integrator::kLearnName);
        return {state, order, Stages(layout, device_view(), tracer, policy_, plan_.wave, queues, film)};
    }
    uint64_t film_values() const { return uint64_t(plan_.wave.width) * plan_.wave.height * 3; }

    void allocate_film() {
        Layout plan;
        lay_out_film(plan, plan_.film_wave, policy_.waves, kFilmWide);
        film_memory_ = DeviceBuffer<std::byte>(plan.bytes(), "film");
        film_memory_.zero();
        Layout placed(plan, film_memory_.data());
        film_ = lay_out_film(placed, plan_.film_wave, policy_.waves, kFilmWide);
    }
    /// The queues, and the graph that uses them.
    void allocate_queues() {
        const uint32_t kept = plan_.kept();
        Layout plan;
        lay_out(plan, kept);
        memory_ = DeviceBuffer<std::byte>(plan.bytes(), "queues");
        memory_.zero();
        note_peak();
        layout_ = Layout(plan, memory_.data());
        const WaveParts parts = lay_out(layout_, kept);
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
        if (!plan_.in_parts()) finish_samples(exec);
        exec.finish_wave();
    }
    /// All pixels of plan_.film_wave go to the film, and what waves learn is brought up to date.
    void finish_samples(Executor& exec) {
        const UpdateFilm update = {plan_.film_wave, film_.samples, film_.splats, film_.sums,
                                   layout_.record(UpdateFilm::kName)};
        exec.run_slots(update, plan_.film_wave.tiles * kTilePixels, 1);
        if constexpr (kLearns) {
            const auto learn = Integrator::learn(policy_, state_, layout_.record(Integrator::kLearnName));
            if (const uint32_t items = Integrator::items_to_learn(policy_)) exec.run_slots(learn, items, 1);
        }
    }
    /// After the last part of a sample; nothing if one of them failed.
    void finish_whole_sample(uint32_t sample) {
        const WaveState state = {0, sample, 1, 0, 0, 0, 0};
        detail::set_wave<<<1, 1, 0, stream_.get()>>>(state_, state);
        cuda_check(cudaGetLastError(), "film");
        executor_->launch([&](Executor& exec) { finish_samples(exec); });
    }
    void launch_wave(uint32_t tile, uint32_t sample, uint32_t samples) {
        const WaveState state = {tile, sample, samples, 0, 0, 0, samples * plan_.light_subpaths(tile)};
        detail::set_wave<<<1, 1, 0, stream_.get()>>>(state_, state);
        cuda_check(cudaGetLastError(), "wave");
        if (graph_)
            cuda_check(cudaGraphLaunch(graph_.get(), stream_.get()), "wave");
        else
            executor_->launch([&](Executor& exec) { run(exec); });
        if (!plan_.in_parts()) return;
        const uint64_t lanes =
            uint64_t(std::min(uint32_t(plan_.wave.tiles), tile_count(plan_.wave) - tile)) * kTilePixels;
        cuda_check(cudaMemcpyAsync(film_.samples + uint64_t(tile) * kTilePixels, part_samples_, lanes * sizeof(Lane),
                                   cudaMemcpyDeviceToDevice, stream_.get()),
                   "samples of a part of the film");
    }
    /// A wave had more light vertices than there was capacity for. Where there is no memory for more, waves get
    /// smaller.
    void grow() {
        read_counts();
        uint64_t needed = 0;
        for (size_t q = 0; q < counters_.size(); ++q)
            if (layout_.queue_names()[q] == "light_vertices" || layout_.queue_names()[q] == "splats")
                needed = std::max(needed, counters_[q].peak);
        memory_ = DeviceBuffer<std::byte>();
        plan_.keep(needed);
        fit(room_for_film_and_waves(), false);
        allocate_queues();
        cuda_check(cudaMemcpy(layout_.records(), records_.data(), records_.size() * sizeof(StageRecord),
                              cudaMemcpyHostToDevice),
                   "statistics");
    }
    void read_counts() {
        records_ = read(layout_.records(), layout_.record_names().size());
        counters_ = read(layout_.counters(), layout_.queue_names().size());
    }
    FilmMoments read_film(const FilmSums& sums, uint64_t samples) const {
        return {plan_.wave.width, plan_.wave.height, samples, read(sums.sum, film_values()),
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
    DevicePlan plan_{scene_, settings_, policy_.waves, kFilmWide};
    SceneBytes scene_bytes_{};  ///< on the device
    uint64_t accel_bytes_ = 0, peak_ = 0;
    uint32_t next_tile_ = 0;  ///< where a sample goes on of which only parts are done
    Layout layout_;
    std::vector<StageRecord> records_;    ///< as last read: they outlast a failure to grow
    std::vector<QueueCounter> counters_;  ///< likewise
    bool film_is_whole_ = true;
    uint64_t samples_ = 0, film_samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
    std::shared_ptr<const DeviceScene> device_scene_;
    std::shared_ptr<const DeviceCwbvh> accel_;
    std::optional<DevicePairs> pairs_;  ///< instead, with accel=bvh2
    DeviceBuffer<std::byte> memory_, film_memory_;
    DeviceKept<Integrator> kept_;
    DeviceBuffer<double> taken_;  ///< by take_film
    FilmBuffers film_{};
    Lane* part_samples_ = nullptr;  ///< of eye subpaths, by slot of the wave
    DeviceBuffer<uint64_t> clock_;
    WaveState* state_ = nullptr;
    Owned<cudaStream_t> stream_;
    std::optional<Stages> stages_;
    std::optional<Executor> executor_;
    Owned<cudaGraphExec_t> graph_;
};

}  // namespace ambilux
