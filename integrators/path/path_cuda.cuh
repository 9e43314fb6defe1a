// The path tracer on a CUDA device: one graph per wave.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

#include "backends/cuda/device_scene.h"
#include "backends/cuda/executor.cuh"
#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "integrators/path/path_cuda.h"
#include "integrators/path/schedule.h"
#include "render/feature_levels.h"
#include "render/wave_stats.h"
#include "scene/info.h"

namespace ambilux {

/// Paths of one wave from which on more bring less than 5 %, measured on scenes of short paths and long ones
/// (docs/performance.md): the last bounces, which few paths reach, cost as much for few as for many.
constexpr uint32_t kCudaWavePlateau = 1u << 26;

template <Features F>
class PathCuda final : public Renderer {
public:
    PathCuda(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), policy_(make_path_policy(scene, settings)) {
        const auto start = Clock::now();
        const bool binary = settings.accel == "bvh2";
        device_scene_ = accels.get<DeviceScene>();
        uint64_t structure_bytes;
        if (binary) {
            const PairAccel pairs(scene);
            structure_bytes = pairs.memory_bytes();
            device_pairs_.emplace(pairs.arrays());
        } else {
            structure_bytes = accels.get<CwbvhAccel>()->memory_bytes();
            device_accel_ = accels.get<DeviceCwbvh>();
        }
        size_t free = 0, total = 0;
        cuda_check(cudaMemGetInfo(&free, &total), "device memory");
        Layout million;
        lay_out(million, 1u << 20, policy_);
        wave_ = shape_wave(scene, settings,
                           device_wave_size(scene, settings, kCudaWavePlateau, million.bytes() >> 20, free), ~0u);
        policy_.tail_below = tail_walks(settings, wave_.slot_count());
        lay_out(layout_, wave_.slot_count(), policy_);
        const uint64_t temporary = order_temporary_bytes(policy_.queues, wave_.slot_count());
        lay_out_order(layout_, policy_.queues, wave_.slot_count(), temporary);
        values_ = uint64_t(wave_.width) * wave_.height * 3;
        const uint64_t own = layout_.bytes() + 2 * values_ * sizeof(double) + sizeof(uint64_t);
        predicted_bytes_ = DeviceScene::predicted_bytes(scene) + structure_bytes + own;
        check_memory(own, free, wave_.slot_count());

        memory_ = DeviceBuffer<std::byte>(layout_.bytes());
        memory_.zero();
        sum_ = DeviceBuffer<double>(values_);
        sum_squares_ = DeviceBuffer<double>(values_);
        clock_ = DeviceBuffer<uint64_t>(1);
        clear_film();
        Layout layout(memory_.data());
        queues_ = lay_out(layout, wave_.slot_count(), policy_);
        const OrderMemory order = lay_out_order(layout, policy_.queues, wave_.slot_count(), temporary);
        std::vector<QueueCounter> counters(PathMemory::kQueues);
        for (size_t q = 0; q < counters.size(); ++q) counters[q].capacity = layout.queue_capacities()[q];
        cuda_check(cudaMemcpy(queues_.counters, counters.data(), counters.size() * sizeof(QueueCounter),
                              cudaMemcpyHostToDevice),
                   "queue counters");

        cuda_check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream");
        stages_.emplace(device_scene_->view(), binary ? CwbvhTracer() : device_accel_->tracer(), policy_, wave_,
                        queues_, FilmPointers{sum_.data(), sum_squares_.data()});
        executor_.emplace(stream_, settings.specialise ? scene.features : kAllFeatures, queues_.state, queues_.records,
                          clock_.data(), device_scene_->view(), order);
        if (binary) executor_->use(device_pairs_->tracer());
        if (settings.graph) graph_ = executor_->capture([&](auto& exec) { run_path_wave(exec, *stages_); });
        cuda_check(cudaDeviceSynchronize(), "preparation");
        build_seconds_ = seconds_since(start);
    }

    ~PathCuda() override {
        if (graph_) cudaGraphExecDestroy(graph_);
        if (stream_) cudaStreamDestroy(stream_);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) {
            // All waves of a pass are queued at once; the host waits for the last.
            const uint32_t pass = std::min(count - done, preferred_batch());
            const auto pass_start = Clock::now();
            for (uint32_t s = 0; s < pass; s += wave_.samples) {
                for (uint32_t tile = 0; tile < tile_count(wave_); tile += wave_.tiles) {
                    detail::set_wave<<<1, 1, 0, stream_>>>(
                        queues_.state,
                        WaveState{tile, first + done + s, std::min(wave_.samples, pass - s), 0, 0, 0, 0});
                    if (graph_)
                        cuda_check(cudaGraphLaunch(graph_, stream_), "wave");
                    else
                        executor_->launch([&](auto& exec) { run_path_wave(exec, *stages_); });
                }
            }
            cuda_check(cudaStreamSynchronize(stream_), "wave");
            done += pass;
            measured_seconds_ = seconds_since(pass_start);
            measured_samples_ = pass;
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
        s.accel = device_pairs_ ? "bvh2" : "cwbvh";
        s.queue_policy = policy_.queues;
        s.fuse = fuse_of(policy_);
        s.build_seconds = build_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        std::vector<StageRecord> records(kStageCount);
        std::vector<QueueCounter> counters(PathMemory::kQueues);
        cuda_check(
            cudaMemcpy(records.data(), queues_.records, records.size() * sizeof(StageRecord), cudaMemcpyDeviceToHost),
            "statistics");
        cuda_check(cudaMemcpy(counters.data(), queues_.counters, counters.size() * sizeof(QueueCounter),
                              cudaMemcpyDeviceToHost),
                   "statistics");
        fill_stage_stats(records.data(), s);
        fill_queue_stats(layout_, {counters.data()}, s);
        s.memory_bytes = device_scene_->bytes() + (device_pairs_ ? device_pairs_->bytes() : device_accel_->bytes()) +
                         memory_.bytes() + sum_.bytes() + sum_squares_.bytes() + clock_.bytes();
        s.memory_bytes_predicted = predicted_bytes_;
        s.features = feature_names(F);
        s.skipped = skipped_parts(scene_, policy_, F);
        return s;
    }

    uint32_t preferred_batch() const override {
        return whole_waves(batch_of(measured_seconds_, measured_samples_), wave_.samples);
    }

private:
    using Clock = std::chrono::steady_clock;
    static double seconds_since(Clock::time_point start) {
        return std::chrono::duration<double>(Clock::now() - start).count();
    }

    const Scene& scene_;
    PathPolicy policy_;
    Wave wave_{};
    Layout layout_;
    uint64_t values_ = 0, predicted_bytes_ = 0, samples_ = 0, film_samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
    std::shared_ptr<const DeviceScene> device_scene_;
    using Executor = BasicCudaExecutor<true>;

    std::shared_ptr<const DeviceCwbvh> device_accel_;
    std::optional<DevicePairs> device_pairs_;  ///< instead, with accel=bvh2
    DeviceBuffer<std::byte> memory_;
    DeviceBuffer<double> sum_, sum_squares_;
    DeviceBuffer<uint64_t> clock_;
    PathMemory queues_{};
    cudaStream_t stream_ = nullptr;
    std::optional<PathStages<F, CwbvhTracer>> stages_;
    std::optional<Executor> executor_;
    cudaGraphExec_t graph_ = nullptr;
};

}  // namespace ambilux
