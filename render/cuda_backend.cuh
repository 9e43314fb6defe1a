// Waves on a CUDA device: one after the other, each phase of them a graph.
#pragma once

#include <optional>

#include "backends/cuda/device_scene.h"
#include "backends/cuda/executor.cuh"
#include "backends/cuda/handles.h"
#include "backends/cuda/mean_on_device.h"
#include "backends/cuda/picture_on_device.h"
#include "backends/cuda_device.h"
#include "backends/fusion.h"
#include "core/flag.h"
#include "core/seconds.h"
#include "render/device_structure.cuh"
#include "render/state_memory.h"

namespace ambilux {

template <class Integrator, Features F>
class CudaBackend {
    using Exec = CudaExecutor<!Integrator::kFilmWide>;  ///< binary BVHs are there for the path tracer
    static_assert(contract::Executor<Exec> && contract::WholeExecutor<Exec>);

public:
    using Maker = WaveMaker<Integrator, F, CwbvhTracer>;
    using Memory = DeviceMemory;
    using Stages = typename Maker::Stages;
    static constexpr bool kHost = false;
    static constexpr const char* kName = "cuda";

    explicit CudaBackend(Maker& maker)
        : maker_(maker), traced_(maker.settings.specialise ? maker.scene.features : kAllFeatures) {}

    static uint32_t threads() { return 0; }
    static BackendBytes bytes() { return {device_primitive_bytes(), order_temporary_bytes}; }
    const std::string& device() const { return device_name_; }
    const char* accel() const { return structure_.name(); }

    // ---- scene and memory ----

    /// The structure on the host, and what the pilot traces with.
    HostTracer find_structure(SharedAccels& accels) {
        constexpr bool kPilot =
            requires(HostTracer t) { Integrator::pilot(maker_.policy, maker_.view, t, uint64_t()); };
        const bool on_device = DeviceStructure::built_on_device(maker_.settings);
        if (on_device) {
            const auto start = Clock::now();
            device_scene_ = accels.get<DeviceScene>();
            upload_seconds_ = seconds_since(start);
        }
        const HostTracer tracer =
            structure_.find(maker_.scene, maker_.settings, accels, on_device ? room(scene_bytes().total()) : 0, kPilot);
        if (const uint64_t peak = structure_.peak_bytes()) peak_ = device_scene_->bytes() + peak;
        accel_bytes_ = structure_.bytes();
        if constexpr (requires { Stages::kTracesConnections; })
            maker_.policy.traces_connections =
                Stages::kTracesConnections && !structure_.optix() && traces_connections(maker_.policy, accel_bytes_);
        if (maker_.picks_by_tree()) accel_bytes_ += light_tree_bytes(maker_.scene);
        return tracer;
    }
    void upload(SharedAccels& accels) {
        device_scene_ = accels.get<DeviceScene>();
        maker_.view = device_scene_->view();
        maker_.view.sensor = maker_.scene.sensor;  // the copy may have been made for a renderer with another camera
        structure_.upload(accels, maker_.tracer);
        if (maker_.picks_by_tree()) {
            light_tree_ = accels.get<DeviceLightTree>();
            maker_.view.light_tree = light_tree_->view();
        }
        device_scene_->drop_texels();
    }
    Build build() const { return structure_.fast() ? Build::fast : Build::good; }
    /// Of what was copied before the structure was made.
    double upload_seconds() const { return upload_seconds_; }
    SceneBytes scene_bytes() const { return ambilux::scene_bytes(maker_.scene, maker_.settings.textures); }
    uint64_t accel_bytes() const { return accel_bytes_; }
    uint64_t resident_scene_bytes() const {
        return device_scene_->bytes() + structure_.resident_bytes() + (light_tree_ ? light_tree_->bytes() : 0);
    }
    /// A clock, and an image and pictures that may be asked for.
    uint64_t other_bytes() const { return sizeof(uint64_t) + image_bytes() + PicturesOnDevice::kBytes; }
    uint64_t waves() const { return 1; }
    /// For film and waves: of what is free, and of what is left of a budget beside `held` bytes.
    uint64_t room(uint64_t held) const {
        const uint64_t free = free_device_bytes(), memory = maker_.settings.memory;
        return memory ? std::min(free, memory - std::min(memory, held)) : free;
    }
    void refuse_if_full(uint64_t needed) const {
        const uint64_t free = device_scene_ ? free_device_bytes() : ~uint64_t(0);
        if (maker_.settings.memory == 0 || needed > free) refuse_wave(needed, free, maker_.plan.wave.slot_count());
    }

    /// The wave, beside `held` bytes.
    void allocate_waves(uint64_t held) {
        held_ = held;
        clock_ = DeviceBuffer<uint64_t>(1);
        stream_ = make_stream();
        allocate_queues();
        if (maker_.settings.memory == 0) device_scene_->prefetch_texels(stream_.get());
    }
    uint64_t wave_bytes() const { return clock_.bytes() + memory_.bytes(); }
    uint64_t planned_wave_bytes() const { return clock_.bytes() + layout_.bytes(); }
    uint64_t held_bytes(uint64_t resident) const { return resident + wave_bytes(); }
    uint64_t peak_bytes() const { return peak_; }
    /// `resident`: bytes of all else, some perhaps not for long.
    void note_peak(uint64_t resident) { peak_ = std::max(peak_, held_bytes(resident)); }
    DeviceImage image(const double* sum, uint64_t samples, uint64_t resident) {
        note_peak(resident + image_bytes());
        return mean_on_device(sum, maker_.plan.wave.width, maker_.plan.wave.height, samples);
    }

    ByteImage picture(const double* sum, uint64_t samples, float stops) {
        return pictures_.make(sum, maker_.plan.wave.width, maker_.plan.wave.height, samples, stops);
    }
    /// With the scene's sensor, and without what was counted.
    void begin_anew() {
        maker_.view.sensor = maker_.scene.sensor;
        allocate_queues();
    }

    // ---- rendering ----

    /// What is launched is finished.
    bool gave_up() const { return false; }
    /// Samples to render before clocks and signals are looked at again, at most `batch`, after `done`. All waves of a
    /// pass are queued at once. Of parts of the film, those of one sample: behind one that failed, those of the next
    /// sample would overwrite what is done of this one.
    uint32_t pass(uint32_t batch, const volatile bool* interrupt, uint64_t done) const {
        if (maker_.plan.in_parts() || is_set(interrupt)) return 1;
        if (Integrator::State::kKind != StateKind::per_device) return batch;
        return learning_pass(batch, done, maker_.plan.wave.samples);
    }
    /// Adds samples from `first` on of every pixel to the film, at most `count`. Returns how many are finished.
    template <class State>
    uint32_t run(uint32_t first, uint32_t count, State& state) {
        uint32_t done = 0;
        while (done < count) {
            uint32_t step = count - done;
            if constexpr (kWholeIterations<Integrator>)
                step = maker_.samples_together(first + done, step);
            else if constexpr (contract::HasIteration<Integrator>)
                step = std::min(step, maker_.plan.in_parts() ? 1 : uint32_t(maker_.plan.wave.samples));
            Iteration<State> iteration = {*this, state, first + done, step};
            run_iteration<Integrator>(iteration);
            if (maker_.plan.in_parts()) finish_film(first + done, iteration.count);
            done += iteration.count;
            if (iteration.count < step) break;  // a wave failed; what is left is another pass
        }
        wait();
        return done;
    }

    void fill(RenderStats& stats) {
        stats.device_seconds = cuda_start_seconds();
        stats.kernel_seconds = kernel_seconds_;
        if (memory_.bytes() > 0) read_counts();
        fill_stage_stats(layout_.record_names(), records_, stats);
        fill_queue_stats(layout_, {counters_.data()}, stats);
    }

private:
    /// What is launched for each wave of a phase.
    struct Phase {
        Owned<cudaGraphExec_t> graph;
        bool may_fail = false;  ///< for want of room
    };

    /// What run_iteration calls to capture graphs.
    struct Capture {
        CudaBackend& backend;

        template <class Body>
        void for_waves(const Body& body) {
            Exec& exec = *backend.executor_;
            const size_t phase = backend.phases_.size();
            backend.phases_.emplace_back();
            Owned<cudaGraphExec_t> graph = exec.capture([&](Exec& e) { backend.run_wave(e, phase, body); });
            backend.phases_.back() = {std::move(graph), exec.may_fail()};
        }
        template <class Work>
        void once(const Work&) {}
    };

    /// What run_iteration calls to render.
    template <class State>
    struct Iteration {
        CudaBackend& backend;
        State& state;
        uint32_t first, count;  ///< fewer after a failure: those that are finished
        size_t phase = 0;

        /// Launches all waves, and those again that failed, in larger memory. The host waits, and reads, only if some
        /// may have failed.
        template <class Body>
        void for_waves(const Body& body) {
            WavePlan& plan = backend.maker_.plan;
            for (uint32_t tile = 0;;) {
                for (uint32_t s = 0; s < count; s += plan.wave.samples)
                    for (uint32_t t = s ? 0 : tile; t < tile_count(plan.wave); t += plan.wave.tiles)
                        backend.launch_wave(phase, body, kWholeIterations<Integrator> ? first : first + s, t, first + s,
                                            std::min<uint32_t>(plan.wave.samples, count - s));
                if (!backend.may_fail(phase)) break;
                backend.wait();
                const WaveState read = backend.read_state();
                const WaveProgress progress = progress_of(plan.wave, tile, read.done - backend.waves_done_);
                backend.waves_done_ = read.done;
                if (!read.failed) break;
                tile = progress.next_tile;
                backend.grow(WaveFailure(read.failed), state);
                if (progress.samples > 0 && tile == 0) {
                    count = std::min(count, progress.samples);
                    break;
                }
                if (plan.in_parts() && !kWholeIterations<Integrator>) count = 1;
                if (kWholeIterations<Integrator> && phase == 0)  // iterations that no longer fit into the wave
                    count = std::min(count, uint32_t(plan.wave.samples));
            }
            ++phase;
        }
        /// On the same stream, over what all waves have left.
        template <class Work>
        void once(const Work& work) {
            Exec& exec = *backend.executor_;
            backend.set_film_state(first, count);
            exec.launch([&](Exec& e) { work(e, *backend.stages_); });
        }
    };

    bool may_fail(size_t phase) const { return phases_.empty() ? executor_->may_fail() : phases_[phase].may_fail; }
    uint64_t image_bytes() const { return maker_.film_values() * sizeof(float); }

    /// A wave of a phase; the last also adds its samples to the film, unless they are a part of it.
    template <class Body>
    void run_wave(Exec& exec, size_t phase, const Body& body) {
        exec.expect_no_failure();
        body(exec, *stages_);
        if (phase + 1 == phases_of<Integrator>() && !maker_.plan.in_parts()) update_film(exec, maker_.plan.wave);
        if (exec.may_fail()) exec.finish_wave();
    }
    void update_film(Exec& exec, Wave wave) {
        wave.state = state_;
        FilmBuffers film = maker_.film;
        if constexpr (!Maker::kFilmWide) film.samples = wave_.samples;
        exec.run_slots(maker_.update_film(wave, film, layout_.record(UpdateFilm::kName)), wave.tiles * kTilePixels, 1);
    }
    /// `first`: sample of the iterations that are done at once.
    WaveState wave_state(uint32_t first, uint32_t tile, uint32_t sample, uint32_t samples) const {
        WaveState s = {};
        s.first_tile = tile;
        s.first_sample = sample;
        s.samples = samples;
        s.iteration = first / maker_.policy.waves.iteration_samples;
        return s;
    }
    void wait() {
        if (std::exchange(launched_, false)) cuda_check(cudaStreamSynchronize(stream_.get()), "wave");
    }
    /// What is launched next is of this wave.
    void set_state(const WaveState& state) {
        launched_ = true;
        detail::set_wave<<<1, 1, 0, stream_.get()>>>(state_, state);
        cuda_check(cudaGetLastError(), "wave");
    }
    void set_film_state(uint32_t first, uint32_t count) { set_state(wave_state(first, 0, first, count)); }
    /// After the last part of the film; nothing if one of them failed.
    void finish_film(uint32_t first, uint32_t count) {
        set_film_state(first, count);
        executor_->launch([&](Exec& exec) { update_film(exec, maker_.plan.film_wave); });
    }
    template <class Body>
    void launch_wave(size_t phase, const Body& body, uint32_t first, uint32_t tile, uint32_t sample, uint32_t samples) {
        WaveState state = wave_state(first, tile, sample, samples);
        state.light_subpaths = samples * maker_.plan.light_subpaths(tile);
        set_state(state);
        if (!phases_.empty())
            cuda_check(cudaGraphLaunch(phases_[phase].graph.get(), stream_.get()), "wave");
        else
            executor_->launch([&](Exec& exec) { run_wave(exec, phase, body); });
        if (maker_.plan.in_parts() && phase + 1 == phases_of<Integrator>()) keep_samples(tile, samples);
    }
    /// Of a part of the film, until all of it is there.
    void keep_samples(uint32_t tile, uint32_t samples) {
        const Wave& wave = maker_.plan.wave;
        const uint64_t tiles = std::min<uint64_t>(wave.tiles, tile_count(wave) - tile);
        constexpr uint64_t kTileBytes = kTilePixels * sizeof(Lane);
        cuda_check(cudaMemcpy2DAsync(maker_.film.samples + uint64_t(tile) * kTilePixels,
                                     maker_.plan.film_wave.tiles * kTileBytes, wave_.samples, wave.tiles * kTileBytes,
                                     tiles * kTileBytes, samples, cudaMemcpyDeviceToDevice, stream_.get()),
                   "samples of a part of the film");
    }

    /// The queues, and the graphs that use them.
    void allocate_queues() {
        Layout dry;
        const uint32_t kept = maker_.plan.kept();
        maker_.lay_out(dry, wave_, kept);
        if (memory_.bytes() == dry.bytes())
            DeviceMemory::clear(memory_.data(), memory_.bytes());
        else
            memory_ = DeviceMemory(dry.bytes(), "queues");
        peak_ = std::max(peak_, held_ + held_bytes(0) - other_bytes());
        layout_ = Layout(dry, memory_.data());
        stages_.emplace(maker_.lay_out(layout_, wave_, kept));
        state_ = wave_.state;
        waves_done_ = 0;
        const std::vector<QueueCounter> counters = layout_.first_counters();
        DeviceMemory::put(layout_.counters(), counters.data(), counters.size() * sizeof(QueueCounter));
        executor_.emplace(stream_.get(), traced_, state_, clock_.data(), maker_.view, wave_.order);
        if constexpr (!Maker::kFilmWide)
            if (structure_.pairs()) executor_->use(structure_.pairs()->tracer());
        if (DeviceOptix* const optix = structure_.optix()) {
            optix->take(wave_.handed, stream_.get());
            executor_->use(*optix, wave_.handed);
        }
        phases_.clear();
        const auto start = Clock::now();
        if (maker_.settings.graph) {
            Capture capture = {*this};
            run_iteration<Integrator>(capture);
        }
        wait_for_default_stream("preparation");
        cuda_check(cudaStreamSynchronize(stream_.get()), "preparation");
        if (kernel_seconds_ == 0 && maker_.settings.graph) kernel_seconds_ = seconds_since(start);
    }
    /// A wave had more than there was capacity for. Where there is no memory for more light vertices, waves get
    /// smaller.
    template <class State>
    void grow(WaveFailure failure, State& state) {
        read_counts();
        WavePlan& plan = maker_.plan;
        if (failure == kAppendedFull) {
            if (const uint64_t more = state.grown_bytes(); more > room(held_)) refuse_more(more);
            const uint64_t old = state.bytes();
            state.grow();
            held_ += state.bytes() - old;
        } else {
            plan.keep(layout_.most_grown(counters_.data()));
        }
        memory_ = DeviceMemory();
        const auto needed = [&] { return maker_.wave_bytes(plan.kept()); };
        if (!plan.fit(room(held_), needed)) refuse_more(needed());
        allocate_queues();
        DeviceMemory::put(layout_.records(), records_.data(), records_.size() * sizeof(StageRecord));
    }
    [[noreturn]] void refuse_more(uint64_t needed) const {
        refuse_if_full(needed);
        const SceneBytes scene = scene_bytes();
        refuse_budget(maker_.settings, {scene, accel_bytes_, held_ - scene.total() - accel_bytes_, needed});
    }
    void read_counts() {
        records_.resize(layout_.record_names().size());
        counters_.resize(layout_.queue_names().size());
        DeviceMemory::get(records_.data(), layout_.records(), records_.size() * sizeof(StageRecord));
        DeviceMemory::get(counters_.data(), layout_.counters(), counters_.size() * sizeof(QueueCounter));
    }
    WaveState read_state() const {
        WaveState state;
        DeviceMemory::get(&state, state_, sizeof(state));
        return state;
    }

    Maker& maker_;
    Features traced_;                               ///< what rays are traced for
    std::string device_name_ = cuda_device_name();  ///< asked for once: statistics are read often
    std::shared_ptr<const DeviceScene> device_scene_;
    std::shared_ptr<const DeviceLightTree> light_tree_;  ///< light_picking=tree only
    DeviceStructure structure_;
    double upload_seconds_ = 0;  ///< of the scene, before the structure
    uint64_t accel_bytes_ = 0, held_ = 0, peak_ = 0;
    DeviceMemory memory_;
    Layout layout_;
    typename Maker::Memory wave_;
    WaveState* state_ = nullptr;
    uint32_t waves_done_ = 0;             ///< as last read
    bool launched_ = false;               ///< something that nobody has waited for
    std::vector<StageRecord> records_;    ///< as last read: they outlast a failure to grow
    std::vector<QueueCounter> counters_;  ///< likewise
    DeviceBuffer<uint64_t> clock_;
    PicturesOnDevice pictures_;
    Owned<cudaStream_t> stream_;
    std::optional<Stages> stages_;
    std::optional<Exec> executor_;
    std::vector<Phase> phases_;
    double kernel_seconds_ = 0;  ///< loaded or compiled, and made graphs of
};

}  // namespace ambilux
