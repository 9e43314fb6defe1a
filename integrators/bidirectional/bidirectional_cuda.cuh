// Light tracing and bidirectional path tracing on a CUDA device: one graph per wave over the whole film.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>

#include "backends/cuda/device_scene.h"
#include "backends/cuda/executor.cuh"
#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "integrators/bidirectional/bidirectional_cuda.h"
#include "integrators/bidirectional/pilot.h"
#include "integrators/bidirectional/schedule.h"
#include "integrators/path/path_wave.h"
#include "render/feature_levels.h"
#include "render/wave_stats.h"
#include "scene/info.h"

namespace ambilux {

template <Features F>
class BidirectionalCuda final : public Renderer {
public:
    BidirectionalCuda(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), policy_(make_bidirectional_policy(scene, settings)), use_graph_(settings.graph),
          traced_(settings.specialise ? scene.features : kAllFeatures) {
        const auto start = Clock::now();
        policy_.vertex_lanes = VertexItem::lanes<F>();
        policy_.connection_lanes = ConnectionVertex::lanes<F>();
        wave_ = shape_wave(scene, settings, kTilePixels, 1);
        wave_.tiles = tile_count(wave_);  // splats may land anywhere on the film
        const uint32_t slots = wave_.tiles * kTilePixels;
        const std::shared_ptr<const CwbvhAccel> accel = accels.get<CwbvhAccel>();
        const double mean = policy_.light_walks && settings.variant != "streaming"
                                ? mean_light_vertices<F>(scene.view(), accel->tracer(), policy_, settings.seed)
                                : 0.0;
        plan_cache(policy_, mean);
        device_scene_ = accels.get<DeviceScene>();
        device_accel_ = accels.get<DeviceCwbvh>();
        // Where one thread may have all pairs of a path, and their rays need not be sorted.
        policy_.trace_pairs = F.bsdfs == bit(BsdfType::diffuse) && policy_.connect_in_shade &&
                              policy_.technique_depth == 0 && !settings.deterministic &&
                              !policy_.queues.fixed_places() && policy_.queues.ordering != Ordering::morton &&
                              device_accel_->bytes() <= kTracedInPlace;
        // Samples that share a cache of light vertices depend on each other, but by one part in the number of light
        // walks only.
        size_t free = 0, total = 0;
        cuda_check(cudaMemGetInfo(&free, &total), "device memory");
        const bool streaming = settings.variant == "streaming";
        if (streaming) policy_.stream_slots = 1u << 20;
        Layout million;
        lay_out(million, 1u << 20, planned_vertices(mean, policy_.most_light_walks(1u << 20)), policy_);
        const uint64_t bytes_per_path =
            (million.bytes() >> 20) + (settings.deterministic ? 3 * sizeof(int64_t) : sizeof(Lane)) + sizeof(Lane);
        const uint32_t wave_size =
            device_wave_size(scene, settings, streaming ? kStreamPlateau : kWavePlateau, bytes_per_path, free);
        uint64_t samples = wave_size / slots;
        if (streaming) {
            policy_.stream_slots = wave_size;
            // Enough paths for each slot that the last ones, which leave slots idle, matter little.
            samples = std::min<uint64_t>(8ull * wave_size, kLightRay - 1) / slots;
            if (settings.expected_samples > 0) samples = std::min(samples, settings.expected_samples);
        }
        wave_.samples = uint32_t(std::max<uint64_t>(1, samples));
        light_walks_ = light_walks_in(wave_, 0, wave_.tiles, policy_.light_walks_per_tile);
        if (uint64_t(light_walks_) * wave_.samples > 0xffffffffull)
            throw Error(ExitCode::usage,
                        "wave_size=" + std::to_string(settings.wave_size) +
                            ": more light walks than can be numbered; set a smaller one, or fewer light_paths");
        policy_.tail_below = tail_walks(settings, wave_.slot_count());
        values_ = uint64_t(wave_.width) * wave_.height * 3;
        sum_ = DeviceBuffer<double>(values_, "film");
        sum_squares_ = DeviceBuffer<double>(values_, "film");
        const uint64_t cells = values_ / 3 * wave_.samples;
        fixed_splats_ = DeviceBuffer<int64_t>(settings.deterministic ? cells * 3 : 0, "splats");
        splats_ = DeviceBuffer<Lane>(settings.deterministic ? 0 : cells, "splats");
        samples_of_slots_ = DeviceBuffer<Lane>(wave_.slot_count(), "samples");
        fixed_splats_.zero();
        splats_.zero();
        if (policy_.technique_depth > 0) {
            techniques_ = DeviceBuffer<int64_t>(technique_values(policy_, values_ / 3), "images of single strategies");
            technique_dropped_ = DeviceBuffer<uint64_t>(technique_count(policy_.technique_depth));
            techniques_.zero();
            technique_dropped_.zero();
        }
        clock_ = DeviceBuffer<uint64_t>(1);
        clear_film();
        cuda_check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream");
        allocate(planned_vertices(mean, policy_.most_light_walks(wave_.slot_count())));
        build_seconds_ = seconds_since(start);
    }

    ~BidirectionalCuda() override {
        if (graph_) cudaGraphExecDestroy(graph_);
        if (stream_) cudaStreamDestroy(stream_);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) {
            // All waves of a pass are queued at once; the host waits for the last.
            const uint32_t pass = std::min(count - done, preferred_batch());
            const uint32_t waves_before = read_state().done;
            for (uint32_t s = 0; s < pass; s += wave_.samples) {
                const uint32_t samples = std::min(wave_.samples, pass - s);
                detail::set_wave<<<1, 1, 0, stream_>>>(
                    queues_.state,
                    WaveState{0, first + done + s, samples, 0, 0, 0, samples * light_walks_, policy_.stream_slots});
                if (graph_)
                    cuda_check(cudaGraphLaunch(graph_, stream_), "wave");
                else
                    executor_->launch([&](CudaExecutor& exec) { run(exec); });
            }
            cuda_check(cudaStreamSynchronize(stream_), "wave");
            const WaveState state = read_state();
            done += std::min(pass, (state.done - waves_before) * wave_.samples);
            if (state.failed) make_room();
        }
        samples_ += done;
        film_samples_ += done;
        render_seconds_ += seconds_since(start);
        return done;
    }

    FilmMoments film() override {
        FilmMoments film;
        film.width = wave_.width;
        film.height = wave_.height;
        film.samples = film_samples_;
        film.sum = sum_.download();
        film.sum_squares = sum_squares_.download();
        return film;
    }

    void clear_film() override {
        sum_.zero();
        sum_squares_.zero();
        film_samples_ = 0;
    }

    RenderStats stats() override {
        RenderStats s;
        s.backend = "cuda";
        s.device = cuda_device_name();
        s.accel = "cwbvh";
        s.queue_policy = policy_.queues;
        s.fuse = fuse_of(policy_);
        s.build_seconds = build_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        const std::vector<StageRecord> records = read_records();
        const std::vector<QueueCounter> counters = read_counters();
        fill_stage_stats(records.data(), s);
        s.rays_extend += records[uint32_t(StageId::light_extend)].items;
        fill_queue_stats(layout_, {counters.data()}, s);
        s.memory_bytes = fixed_bytes() + memory_.bytes();
        s.memory_bytes_predicted = fixed_bytes() + layout_.bytes();
        s.features = feature_names(F);
        s.skipped = skipped_strategies(scene_, policy_, F);
        return s;
    }

    std::vector<TechniqueImage> technique_images() override {
        if (policy_.technique_depth == 0) return {};
        return ambilux::technique_images(policy_.technique_depth, samples_, techniques_.download(),
                                         technique_dropped_.download());
    }

    uint32_t preferred_batch() const override {
        return whole_waves(batch_of(render_seconds_, samples_), wave_.samples);
    }

private:
    using Clock = std::chrono::steady_clock;
    /// Paths of a wave from which on more do not pay (kCudaWavePlateau tells why); their light vertices take half a
    /// kilobyte each beside.
    static constexpr uint32_t kWavePlateau = 1u << 25;
    static constexpr uint32_t kStreamPlateau =
        1u << 23;  ///< slots of streaming: twice as many bring 3 to 8 %, but it is there to need little memory
    static double seconds_since(Clock::time_point start) {
        return std::chrono::duration<double>(Clock::now() - start).count();
    }

    uint64_t fixed_bytes() const {
        return device_scene_->bytes() + device_accel_->bytes() + sum_.bytes() + sum_squares_.bytes() +
               fixed_splats_.bytes() + splats_.bytes() + techniques_.bytes() + samples_of_slots_.bytes() +
               clock_.bytes();
    }

    /// Queues for `kept` light vertices, and the graph that uses them.
    void allocate(uint64_t kept) {
        if (kept > 0xf0000000ull)
            throw Error(ExitCode::device,
                        "light walks have more vertices than can be numbered: set a max_depth or a smaller wave_size");
        layout_ = Layout();
        lay_out(layout_, wave_.slot_count(), uint32_t(kept), policy_);
        const uint64_t temporary = order_temporary_bytes(policy_.queues, order_slots(policy_, wave_.slot_count()));
        lay_out_order(layout_, policy_.queues, order_slots(policy_, wave_.slot_count()), temporary);
        size_t free = 0, total = 0;
        cuda_check(cudaMemGetInfo(&free, &total), "device memory");
        check_memory(layout_.bytes(), free, wave_.slot_count());
        memory_ = DeviceBuffer<std::byte>(layout_.bytes(), "queues");
        memory_.zero();
        Layout layout(memory_.data());
        queues_ = lay_out(layout, wave_.slot_count(), uint32_t(kept), policy_);
        const OrderMemory order =
            lay_out_order(layout, policy_.queues, order_slots(policy_, wave_.slot_count()), temporary);
        std::vector<QueueCounter> counters(BidirectionalMemory::kQueues);
        for (size_t q = 0; q < counters.size(); ++q) counters[q].capacity = layout.queue_capacities()[q];
        cuda_check(cudaMemcpy(queues_.counters, counters.data(), counters.size() * sizeof(QueueCounter),
                              cudaMemcpyHostToDevice),
                   "queue counters");
        stages_.emplace(device_scene_->view(), device_accel_->tracer(), policy_, wave_, queues_,
                        BidirectionalFilm{samples_of_slots_.data(),
                                          {fixed_splats_.data(), splats_.data()},
                                          sum_.data(),
                                          sum_squares_.data(),
                                          techniques_.data(),
                                          technique_dropped_.data()});
        executor_.emplace(stream_, traced_, queues_.state, queues_.records, clock_.data(), device_scene_->view(),
                          order);
        if (graph_) cudaGraphExecDestroy(graph_);
        graph_ = nullptr;
        if (use_graph_) graph_ = executor_->capture([&](CudaExecutor& exec) { run(exec); });
        cuda_check(cudaDeviceSynchronize(), "preparation");
    }

    void run(CudaExecutor& exec) {
        run_bidirectional_wave(exec, *stages_);
        exec.run_slots(StageId::develop, stages_->develop, wave_.tiles * kTilePixels, 1);
        exec.finish_wave();
    }

    /// A wave had more light vertices than there was room for.
    void make_room() {
        const std::vector<StageRecord> records = read_records();
        uint64_t needed = 0;
        const std::vector<QueueCounter> counters = read_counters();
        for (size_t q = 0; q < counters.size(); ++q)
            if (layout_.queue_names()[q] == "light_vertices" || layout_.queue_names()[q] == "splats")
                needed = std::max(needed, counters[q].peak);
        memory_ = DeviceBuffer<std::byte>();
        allocate(needed + needed / 4);
        cuda_check(
            cudaMemcpy(queues_.records, records.data(), records.size() * sizeof(StageRecord), cudaMemcpyHostToDevice),
            "statistics");
    }

    WaveState read_state() const {
        WaveState state;
        cuda_check(cudaMemcpy(&state, queues_.state, sizeof(state), cudaMemcpyDeviceToHost), "state");
        return state;
    }
    std::vector<StageRecord> read_records() const {
        std::vector<StageRecord> records(kStageCount);
        cuda_check(
            cudaMemcpy(records.data(), queues_.records, records.size() * sizeof(StageRecord), cudaMemcpyDeviceToHost),
            "statistics");
        return records;
    }
    std::vector<QueueCounter> read_counters() const {
        std::vector<QueueCounter> counters(BidirectionalMemory::kQueues);
        cuda_check(cudaMemcpy(counters.data(), queues_.counters, counters.size() * sizeof(QueueCounter),
                              cudaMemcpyDeviceToHost),
                   "statistics");
        return counters;
    }

    const Scene& scene_;
    BidirectionalPolicy policy_;
    bool use_graph_;
    Features traced_;  ///< what rays are traced for
    Wave wave_{};
    Layout layout_;
    uint32_t light_walks_ = 0;  ///< of one sample
    uint64_t values_ = 0, samples_ = 0, film_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0;
    std::shared_ptr<const DeviceScene> device_scene_;
    std::shared_ptr<const DeviceCwbvh> device_accel_;
    DeviceBuffer<std::byte> memory_;
    DeviceBuffer<double> sum_, sum_squares_;
    DeviceBuffer<int64_t> fixed_splats_, techniques_;
    DeviceBuffer<Lane> splats_;
    DeviceBuffer<uint64_t> technique_dropped_;
    DeviceBuffer<Lane> samples_of_slots_;
    DeviceBuffer<uint64_t> clock_;
    BidirectionalMemory queues_{};
    cudaStream_t stream_ = nullptr;
    std::optional<BidirectionalStages<F, CwbvhTracer>> stages_;
    std::optional<CudaExecutor> executor_;
    cudaGraphExec_t graph_ = nullptr;
};

}  // namespace ambilux
