#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <new>
#include <optional>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "backends/cpu/executor.h"
#include "backends/cpu/wave_bytes.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/parallel.h"
#include "integrators/path/path.h"
#include "integrators/path/schedule.h"
#include "render/feature_levels.h"
#include "render/wave_stats.h"
#include "scene/info.h"

namespace ambilux {
namespace {

/// Paths of one wave: with the surfaces and texels that they meet, about 1 KiB each, they stay in a core's second-level
/// cache from stage to stage.
constexpr uint32_t kCpuWaveSize = 512;

/// Queues of one thread.
struct WaveMemory {
    WaveBytes bytes;
    PathMemory queues;
    OrderMemory order;

    WaveMemory(uint64_t size, uint32_t slots, const PathPolicy& policy) : bytes(make_wave_bytes(size)) {
        Layout layout(bytes.get());
        queues = lay_out(layout, slots, policy);
        order = lay_out_order(layout, policy.queues, slots);
        set_capacities(queues.counters, layout);
    }
};

template <Features F, class Accel>
class PathCpu final : public Renderer {
public:
    PathCpu(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), view_(scene.view()), policy_(make_path_policy(scene, settings)),
          accel_name_(settings.accel == "cwbvh" ? "cwbvh" : "embree") {
        const auto start = Clock::now();
        const int threads = arena_.max_concurrency();
        // Enough tasks that threads end together.
        const Wave film = shape_wave(scene, settings, kTilePixels, 1);
        const uint32_t max_tiles = std::max(1u, tile_count(film) / uint32_t(8 * threads));
        wave_ = shape_wave(scene, settings, settings.wave_size ? settings.wave_size : kCpuWaveSize, max_tiles);

        lay_out(layout_, wave_.slot_count(), policy_);
        lay_out_order(layout_, policy_.queues, wave_.slot_count());
        const uint64_t values = uint64_t(wave_.width) * wave_.height * 3;
        const uint64_t own = layout_.bytes() * uint64_t(threads) + 2 * values * sizeof(double);
        try {
            accel_ = accels.get<Accel>();
            film_.sum.resize(values);
            film_.sum_squares.resize(values);
            for (int t = 0; t < threads; ++t) waves_.emplace_back(layout_.bytes(), wave_.slot_count(), policy_);
        } catch (const std::bad_alloc&) {
            throw Error(ExitCode::device, fmt::format("out of memory: film and queues need {} MiB beside the scene; a "
                                                      "smaller --size or wave_size needs less",
                                                      own >> 20));
        }
        film_.width = wave_.width;
        film_.height = wave_.height;
        predicted_bytes_ = scene.memory_bytes() + accel_->memory_bytes() + own;
        build_seconds_ = seconds_since(start);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) {
            const uint32_t pass = std::min(count - done, preferred_batch());
            const auto pass_start = Clock::now();
            arena_.execute([&] {
                const uint32_t tiles = tile_count(wave_);
                parallel_for((tiles + wave_.tiles - 1) / wave_.tiles,
                             [&](uint32_t chunk) { render_tiles(chunk * wave_.tiles, first + done, pass); });
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
        s.queue_policy = policy_.queues;
        s.fuse = fuse_of(policy_);
        s.build_seconds = build_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        StageRecord total[kStageCount] = {};
        std::vector<const QueueCounter*> counters;
        uint64_t bytes = scene_.memory_bytes() + accel_->memory_bytes() +
                         (film_.sum.size() + film_.sum_squares.size()) * sizeof(double);
        for (const WaveMemory& w : waves_) {
            add_records(total, w.queues.records);
            counters.push_back(w.queues.counters);
            bytes += layout_.bytes();
        }
        fill_stage_stats(total, s);
        fill_queue_stats(layout_, counters, s);
        s.memory_bytes = bytes;
        s.memory_bytes_predicted = predicted_bytes_;
        s.features = feature_names(F);
        s.skipped = skipped_parts(scene_, policy_, F);
        return s;
    }

    uint32_t preferred_batch() const override { return batch_of(measured_seconds_, measured_samples_); }

private:
    using Clock = std::chrono::steady_clock;
    static double seconds_since(Clock::time_point start) {
        return std::chrono::duration<double>(Clock::now() - start).count();
    }

    void render_tiles(uint32_t first_tile, uint32_t first_sample, uint32_t count) {
        const WaveMemory& wave = waves_[size_t(tbb::this_task_arena::current_thread_index())];
        const PathMemory& memory = wave.queues;
        using Tracer = decltype(accel_->tracer());
        const PathStages<F, Tracer> stages(view_, accel_->tracer(), policy_, wave_, memory,
                                           {film_.sum.data(), film_.sum_squares.data()});
        CpuExecutor executor(memory.state, memory.records, view_, wave.order);
        for (uint32_t s = 0; s < count; s += wave_.samples) {
            *memory.state = {first_tile, first_sample + s, std::min(wave_.samples, count - s), 0, 0, 0, 0};
            run_path_wave(executor, stages);
        }
    }

    const Scene& scene_;
    SceneView view_;
    PathPolicy policy_;
    std::string accel_name_;
    tbb::task_arena arena_;
    Wave wave_{};
    Layout layout_;
    std::shared_ptr<const Accel> accel_;
    std::vector<WaveMemory> waves_;
    FilmMoments film_;
    uint64_t predicted_bytes_ = 0, samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
};

}  // namespace

std::unique_ptr<Renderer> make_path_cpu(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    return with_feature_level(scene.features, settings.specialise, [&](auto level) -> std::unique_ptr<Renderer> {
        constexpr Features F = decltype(level)::value;
        if (settings.accel == "cwbvh") return std::make_unique<PathCpu<F, CwbvhAccel>>(scene, settings, accels);
        return std::make_unique<PathCpu<F, EmbreeAccel>>(scene, settings, accels);
    });
}

}  // namespace ambilux
