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
#include "integrators/bidirectional/bidirectional.h"
#include "integrators/bidirectional/pilot.h"
#include "integrators/bidirectional/schedule.h"
#include "integrators/path/path_wave.h"
#include "render/feature_levels.h"
#include "render/wave_stats.h"
#include "scene/info.h"

namespace ambilux {
namespace {

constexpr uint32_t kCpuWaveSize = 512;

/// Queues of one thread. They grow when a wave has more light vertices than any before.
struct WaveMemory {
    Layout layout;
    WaveBytes bytes;
    BidirectionalMemory queues;
    OrderMemory order;
    uint32_t kept = 0;

    void allocate(uint32_t slots, uint32_t new_kept, const BidirectionalPolicy& policy) {
        const WaveBytes old = std::move(bytes);
        const BidirectionalMemory before = queues;
        kept = new_kept;
        layout = Layout();
        lay_out(layout, slots, kept, policy);
        lay_out_order(layout, policy.queues, order_slots(policy, slots));
        bytes = make_wave_bytes(layout.bytes());
        Layout real(bytes.get());
        queues = lay_out(real, slots, kept, policy);
        order = lay_out_order(real, policy.queues, order_slots(policy, slots));
        if (old) {
            std::copy_n(before.records, kStageCount, queues.records);
            std::copy_n(before.counters, BidirectionalMemory::kQueues, queues.counters);
        }
        set_capacities(queues.counters, layout);
    }
};

template <Features F, class Accel>
class BidirectionalCpu final : public Renderer {
public:
    BidirectionalCpu(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : scene_(scene), view_(scene.view()), policy_(make_bidirectional_policy(scene, settings)),
          accel_name_(settings.accel == "cwbvh" ? "cwbvh" : "embree") {
        const auto start = Clock::now();
        policy_.vertex_lanes = VertexItem::lanes<F>();
        policy_.connection_lanes = ConnectionVertex::lanes<F>();
        policy_.at_once = policy_.connect_in_shade && !policy_.megakernel;
        const int threads = arena_.max_concurrency();
        const Wave film = shape_wave(scene, settings, kTilePixels, 1);
        const uint32_t max_tiles = std::max(1u, tile_count(film) / uint32_t(8 * threads));
        wave_ = shape_wave(scene, settings, settings.wave_size ? settings.wave_size : kCpuWaveSize, max_tiles);
        wave_.samples = 1;  // splats may land anywhere: a sample is developed when all its waves are done
        film_wave_ = wave_;
        film_wave_.tiles = (tile_count(wave_) + wave_.tiles - 1) / wave_.tiles * wave_.tiles;
        film_wave_.state = &film_state_;
        if (settings.variant == "streaming") policy_.stream_slots = std::max(kTilePixels, wave_.slot_count() / 4);
        const uint64_t values = uint64_t(wave_.width) * wave_.height * 3;
        try {
            accel_ = accels.get<Accel>();
            moments_.sum.resize(values);
            moments_.sum_squares.resize(values);
            samples_of_slots_.resize(film_wave_.slot_count());
            splats_.resize(values);
            techniques_.resize(technique_values(policy_, values / 3));
            technique_dropped_.resize(technique_count(policy_.technique_depth));
            const double mean = policy_.light_walks && !policy_.stream_slots
                                    ? mean_light_vertices<F>(view_, accel_->tracer(), policy_, settings.seed)
                                    : 0.0;
            plan_cache(policy_, mean);
            waves_.resize(size_t(threads));
            for (WaveMemory& w : waves_)
                w.allocate(wave_.slot_count(), planned_vertices(mean, policy_.most_light_walks(wave_.slot_count())),
                           policy_);
        } catch (const std::bad_alloc&) {
            throw Error(
                ExitCode::device,
                fmt::format("out of memory: a film of {}x{} needs more than there is; a smaller --size needs less",
                            wave_.width, wave_.height));
        }
        moments_.width = wave_.width;
        moments_.height = wave_.height;
        build_seconds_ = seconds_since(start);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        arena_.execute([&] {
            while (done < count && !is_set(interrupt)) {
                parallel_for(film_wave_.tiles / wave_.tiles,
                             [&](uint32_t chunk) { render_tiles(chunk * wave_.tiles, first + done); });
                develop(first + done);
                ++done;
            }
        });
        moments_.samples += done;
        samples_ += done;
        render_seconds_ += seconds_since(start);
        return done;
    }

    FilmMoments film() override { return moments_; }

    void clear_film() override {
        std::fill(moments_.sum.begin(), moments_.sum.end(), 0.0);
        std::fill(moments_.sum_squares.begin(), moments_.sum_squares.end(), 0.0);
        moments_.samples = 0;
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
        add_records(total, film_records_);
        std::vector<const QueueCounter*> counters;
        s.memory_bytes = scene_.memory_bytes() + accel_->memory_bytes() +
                         (moments_.sum.size() + moments_.sum_squares.size()) * sizeof(double) +
                         (splats_.size() + techniques_.size()) * sizeof(int64_t) +
                         samples_of_slots_.size() * sizeof(Lane);
        const Layout* largest = &waves_[0].layout;
        for (const WaveMemory& w : waves_) {
            add_records(total, w.queues.records);
            counters.push_back(w.queues.counters);
            s.memory_bytes += w.layout.bytes();
            if (w.layout.bytes() > largest->bytes()) largest = &w.layout;
        }
        s.memory_bytes_predicted = s.memory_bytes;
        fill_stage_stats(total, s);
        s.rays_extend += total[uint32_t(StageId::light_extend)].items;
        fill_queue_stats(*largest, counters, s);
        s.features = feature_names(F);
        s.skipped = skipped_strategies(scene_, policy_, F);
        return s;
    }

    std::vector<TechniqueImage> technique_images() override {
        return ambilux::technique_images(policy_.technique_depth, samples_, techniques_, technique_dropped_);
    }

    uint32_t preferred_batch() const override { return batch_of(render_seconds_, samples_); }

private:
    using Clock = std::chrono::steady_clock;
    static double seconds_since(Clock::time_point start) {
        return std::chrono::duration<double>(Clock::now() - start).count();
    }

    void render_tiles(uint32_t first_tile, uint32_t sample) {
        WaveMemory& memory = waves_[size_t(tbb::this_task_arena::current_thread_index())];
        using Tracer = decltype(accel_->tracer());
        for (;;) {
            const BidirectionalMemory& m = memory.queues;
            const BidirectionalFilm film = {samples_of_slots_.data() + size_t(first_tile) * kTilePixels,
                                            {splats_.data(), nullptr},
                                            nullptr,
                                            nullptr,
                                            techniques_.empty() ? nullptr : techniques_.data(),
                                            technique_dropped_.data()};
            const BidirectionalStages<F, Tracer> stages(view_, accel_->tracer(), policy_, wave_, m, film);
            CpuExecutor executor(m.state, m.records, view_, memory.order);
            *m.state = {first_tile,
                        sample,
                        1,
                        0,
                        0,
                        0,
                        light_walks_in(wave_, first_tile, wave_.tiles, policy_.light_walks_per_tile),
                        policy_.stream_slots};
            run_bidirectional_wave(executor, stages);
            if (!m.state->failed) return;
            const uint64_t needed = std::max(m.light_vertices.counter->peak, m.splats.counter->peak);
            memory.allocate(wave_.slot_count(), uint32_t(std::min<uint64_t>(needed + needed / 4, 1u << 30)), policy_);
        }
    }

    void develop(uint32_t sample) {
        const auto start = Clock::now();
        film_state_ = {0, sample, 1, 0, 0, 0, 0};
        parallel_for(uint32_t(film_wave_.tiles), [&](uint32_t tile) {
            StageRecord record{};
            const DevelopSplats stage = {film_wave_,          samples_of_slots_.data(),    {splats_.data(), nullptr},
                                         moments_.sum.data(), moments_.sum_squares.data(), &record};
            for (uint32_t i = 0; i < kTilePixels; ++i) stage(tile * kTilePixels + i);
            if (record.nan + record.inf + record.negative) {
                StageRecord& total = film_records_[uint32_t(StageId::develop)];
                __atomic_fetch_add(&total.nan, record.nan, __ATOMIC_RELAXED);
                __atomic_fetch_add(&total.inf, record.inf, __ATOMIC_RELAXED);
                __atomic_fetch_add(&total.negative, record.negative, __ATOMIC_RELAXED);
            }
        });
        film_records_[uint32_t(StageId::develop)].add(film_wave_.slot_count(), 0, uint64_t(seconds_since(start) * 1e9));
    }

    const Scene& scene_;
    SceneView view_;
    BidirectionalPolicy policy_;
    std::string accel_name_;
    tbb::task_arena arena_;
    Wave wave_{}, film_wave_{};  ///< of one task, and of the whole film
    WaveState film_state_{};
    StageRecord film_records_[kStageCount] = {};
    std::shared_ptr<const Accel> accel_;
    std::vector<WaveMemory> waves_;
    std::vector<Lane> samples_of_slots_;
    std::vector<int64_t> splats_, techniques_;
    std::vector<uint64_t> technique_dropped_;
    FilmMoments moments_;
    uint64_t samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0;
};

}  // namespace

std::unique_ptr<Renderer> make_bidirectional_cpu(const Scene& scene, const RenderSettings& settings,
                                                 SharedAccels& accels) {
    return with_feature_level(scene.features, settings.specialise, [&](auto level) -> std::unique_ptr<Renderer> {
        constexpr Features F = decltype(level)::value;
        if (settings.accel == "cwbvh")
            return std::make_unique<BidirectionalCpu<F, CwbvhAccel>>(scene, settings, accels);
        return std::make_unique<BidirectionalCpu<F, EmbreeAccel>>(scene, settings, accels);
    });
}

}  // namespace ambilux
