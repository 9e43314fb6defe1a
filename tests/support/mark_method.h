// A method for tests of iterations. It traces nothing: slots leave marks, which are sorted into bins once all of them
// are there, and gather those of one bin. Sums of floats tell in which order marks lay, bins what earlier iterations
// left, and splats whether each arrived once.
#pragma once

#include "core/atomic.h"
#include "integrators/contract.h"
#include "stages/splat.h"

namespace ambilux::test {

constexpr uint32_t kBins = 61, kMostMarks = 200;

/// Numbers that depend on nothing but `a` and `b`.
AMBILUX_HD uint32_t hash(uint32_t a, uint32_t b) {
    uint32_t i = a * 0x9e3779b9u + b;
    i = (i ^ i >> 16) * 0x7feb352du;
    i = (i ^ i >> 15) * 0x846ca68bu;
    return i ^ i >> 16;
}

struct MarkPolicy {
    WavePolicy waves;
    uint32_t room = 0;             ///< for marks of an iteration, beyond what is planned for none
    uint32_t wave_room = 0;        ///< likewise for those of a wave; 0: for the most that there may be
    uint32_t heavy_tile = kNone;   ///< whose slots leave kMostMarks each
    uint32_t heavy_sample = 0;     ///< in this sample of an iteration
    uint32_t heavy_iteration = 0;  ///< of this number

    static MarkPolicy plan(const RenderSettings& settings) {
        MarkPolicy p;
        p.waves.deterministic = settings.deterministic;
        p.waves.light_subpaths_per_tile = kTilePixels;
        const auto read = [&](const char* key, uint32_t& value) {
            if (const auto at = settings.own.find(key); at != settings.own.end())
                value = uint32_t(std::stoul(at->second));
        };
        read("iteration_samples", p.waves.iteration_samples);
        read("room", p.room);
        read("wave_room", p.wave_room);
        read("heavy_tile", p.heavy_tile);
        read("heavy_sample", p.heavy_sample);
        read("heavy_iteration", p.heavy_iteration);
        p.waves.keeps_light_vertices = p.wave_room > 0;
        return p;
    }
    /// That a slot leaves.
    AMBILUX_HD uint32_t marks(const Wave& wave, const PathSlot& p) const {
        const bool heavy = p.y / kTileSide * wave.tiles_x + p.x / kTileSide == heavy_tile &&
                           p.sample == heavy_iteration * waves.iteration_samples + heavy_sample;
        return heavy ? kMostMarks : hash(p.pixel, p.sample) % 4;
    }
};

struct Mark {
    uint32_t subpath;  ///< in its iteration
    uint32_t depth;
    uint32_t bin;
    float value;
};

/// `kLearns`: what bins have had is kept from iteration to iteration, else nothing is but the number of the iteration.
template <bool kLearns>
struct MarkState {
    static constexpr StateKind kKind = kLearns ? StateKind::per_device : StateKind::by_index;

    Queue<Mark> marks;
    SortMemory<uint64_t> order;  ///< by bin, subpath, depth
    ScanMemory scan;
    uint32_t *in_bin, *first;  ///< marks of a bin, and where they begin; kBins + 1 of each
    uint32_t* learned;         ///< for each bin one more than the marks of all iterations
    uint64_t* iterations;      ///< that there have been

    static MarkState lay_out(Layout& layout, const MarkPolicy& p, const StateSize& size) {
        const uint32_t room = size.appended + p.room;
        MarkState s;
        s.marks = layout.growing_queue<Mark>("marks", room);
        s.order = SortMemory<uint64_t>::lay_out(layout, room, size.primitives);
        s.scan = ScanMemory::lay_out(layout, kBins + 1, size.primitives);
        for (uint32_t** numbers : {&s.in_bin, &s.first}) *numbers = layout.allocate<uint32_t>(kBins + 1);
        s.learned = layout.allocate<uint32_t>(kBins);
        s.iterations = layout.allocate<uint64_t>(1);
        return s;
    }
    template <class Put>
    void init(const MarkPolicy&, Put put) const {
        put(learned, std::vector<uint32_t>(kBins, 1));
    }
    template <class Visit>
    void for_each_saved(Visit visit) const {
        if constexpr (kLearns) {
            visit("learned", learned, uint64_t(kBins));
            visit("iterations", iterations, uint64_t(1));
        }
    }
    template <class Copy>
    void take_items(const MarkState& old, uint32_t items, Copy copy) const {
        copy(marks.items.base, old.marks.items.base, items);
        copy(order.keys[0], old.order.keys[0], items);
        copy(order.values[0], old.order.values[0], items);
        copy(learned, old.learned, kBins);
        copy(iterations, old.iterations, 1);
    }
};

struct LeaveMarks {
    static constexpr const char* kName = "leave_marks";

    Wave wave;
    MarkPolicy policy;
    Queue<Mark> marks;
    Queue<SplatItem> splats;
    bool splat;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        const PathSlot p = wave.locate(slot);
        if (!p.active) return;
        const uint32_t pixels = wave.width * wave.height, k = policy.waves.iteration_samples;
        for (uint32_t depth = 0; depth < policy.marks(wave, p); ++depth) {
            const uint32_t h = hash(p.sample * pixels + p.pixel, depth);
            marks.push({p.sample % k * pixels + p.pixel, depth, h % kBins, float(h >> 8) * 0x1p-20f});
        }
        if (!splat) return;
        const uint32_t other = hash(p.pixel, p.sample + 7) % pixels;
        splats.push({{0.0f, 0.0f, 1.0f},
                     slot,
                     {float(other % wave.width) + 0.5f, float(other / wave.width) + 0.5f},
                     Strategy::make(1, 1),
                     0.0f});
    }
};

template <class State>
struct AppendMarks {
    static constexpr const char* kName = "append_marks";

    Queue<Mark> mine;
    State all;
    StageRecord* record;

    AMBILUX_HD const Queue<Mark>& items() const { return mine; }
    AMBILUX_HD QueueCounter* target() const { return all.marks.counter; }
    AMBILUX_HD void operator()(uint32_t i, uint32_t place) const {
        const Mark m = mine.load(i);
        all.marks.store(place, m);
        all.order.keys[0][place] = uint64_t(m.bin) << 40 | uint64_t(m.subpath) << 8 | m.depth;
        all.order.values[0][place] = place;
    }
};

template <class State>
struct CountBins {
    static constexpr const char* kName = "count_bins";

    State all;
    uint32_t marks;
    StageRecord* record;

    AMBILUX_HD uint32_t first(uint32_t bin) const {
        return lower_bound<uint64_t>(all.order.keys[1], marks, uint64_t(bin) << 40);
    }
    AMBILUX_HD void operator()(uint32_t bin) const { all.in_bin[bin] = first(bin + 1) - first(bin); }
};

template <class State>
struct GatherMarks {
    static constexpr const char* kName = "gather_marks";

    Wave wave;
    State all;
    Lane* samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        samples[slot] = {};
        const PathSlot p = wave.locate(slot);
        if (!p.active) return;
        const uint32_t bin = hash(p.sample, p.pixel) % kBins;
        float sum = 0.0f;
        for (uint32_t i = all.first[bin]; i < all.first[bin + 1]; ++i)
            sum += all.marks.load(all.order.values[1][i]).value;
        set_start(samples[slot], Rgb{sum, float(all.learned[bin] + wave.state->iteration), 0.0f});
    }
};

template <class State>
struct LearnBins {
    static constexpr const char* kName = "learn_bins";

    State all;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t bin) const {
        all.learned[bin] += all.in_bin[bin];
        if (bin == 0) ++*all.iterations;
    }
};

/// `kWide`: with splats, else without.
template <Features F, class Tracer, bool kWide, bool kLearns>
struct MarkIntegrator {
    using Policy = MarkPolicy;
    using State = MarkState<kLearns>;
    static constexpr bool kFilmWide = kWide;
    static constexpr uint32_t kPhases = 2;

    static Policy plan(const Scene&, const RenderSettings& settings) { return MarkPolicy::plan(settings); }
    static double pilot(Policy&, const SceneView&, const HostTracer&, uint64_t) { return 0.0; }
    static std::vector<std::string> skipped(const Scene&, const Policy&) { return {}; }

    struct Memory {
        Queue<Mark> marks;
        Queue<SplatItem> splats;
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        Memory m;
        m.marks = layout.growing_queue<Mark>("wave_marks", p.wave_room ? n.kept + p.wave_room : n.slots * kMostMarks);
        m.splats = layout.growing_queue<SplatItem>("splats", kWide ? n.slots : 0);
        return m;
    }

    struct Stages {
        Wave wave;
        State state;
        LeaveMarks leave;
        AppendMarks<State> append;
        Splat<F> splat;
        CountBins<State> count;
        GatherMarks<State> gather;
        LearnBins<State> learn;
        StageRecord *sort, *scan;

        Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State& all)
            : wave(parts.wave), state(all) {
            const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
            leave = {wave, p, m.marks, m.splats, kWide, record(leave)};
            append = {m.marks, all, record(append)};
            splat = {parts.scene, wave, m.splats, parts.film.splats, {}, record(splat)};
            count = {all, 0, record(count)};
            gather = {wave, all, parts.film.samples, record(gather)};
            learn = {all, record(learn)};
            sort = parts.layout.record("sort_marks");
            scan = parts.layout.record("scan_bins");
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& s) {
            exec.run_slots(s.leave, s.wave.tiles * kTilePixels);
            exec.fail_on_overflow(s.append.mine, s.splat.splats);
            exec.append(s.append, s.splat.splats);
            exec.clear(s.append.mine);
            if constexpr (kWide) exec.run(s.splat);
        });
        // The host knows how many marks there are, and tells a stage.
        run.once([](auto& exec, const Stages& s) {
            auto count = s.count;
            count.marks = exec.count(s.state.marks);
            if (count.marks > 0) exec.sort_pairs(s.state.order, count.marks, 64, s.sort);
            exec.for_each(count, kBins + 1);
            exec.scan(s.state.scan, s.state.in_bin, s.state.first, kBins + 1, s.scan);
        });
        run.for_waves([](auto& exec, const Stages& s) { exec.run_slots(s.gather, s.wave.tiles * kTilePixels); });
        run.once([](auto& exec, const Stages& s) {
            if constexpr (kLearns) exec.for_each(s.learn, kBins);
            exec.clear(s.state.marks);
        });
    }
};

/// A method of one phase whose state follows from the number of the iteration, which it writes into its film.
template <Features F, class Tracer>
struct NumberIntegrator {
    using Policy = MarkPolicy;
    struct State : NoState {
        static constexpr StateKind kKind = StateKind::by_index;

        static State lay_out(Layout&, const Policy&, const StateSize&) { return {}; }
    };
    static constexpr bool kFilmWide = false;

    static Policy plan(const Scene&, const RenderSettings& settings) { return MarkPolicy::plan(settings); }
    static std::vector<std::string> skipped(const Scene&, const Policy&) { return {}; }

    struct Memory {};
    static Memory lay_out(Layout&, const Policy&, const WaveSize&) { return {}; }

    struct Write {
        static constexpr const char* kName = "write";

        Wave wave;
        Lane* samples;
        StageRecord* record;

        AMBILUX_HD void operator()(uint32_t slot) const {
            const float number = float(wave.state->iteration);
            set_start(samples[slot], Rgb{number, number, number});
        }
    };
    struct Stages {
        Write write;

        Stages(const WaveParts<Tracer>& parts, const Policy&, const Memory&, const State&)
            : write{parts.wave, parts.film.samples, parts.layout.record(Write::kName)} {}
    };
    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        exec.run_slots(s.write, s.write.wave.tiles * kTilePixels);
    }
};

}  // namespace ambilux::test
