// Renders by waves: budget, film, state and statistics of a render, for every method and backend. How waves run is the
// backend's matter (cpu_backend.h, cuda_backend.cuh).
#pragma once

#include <new>

#include "render/state_memory.h"
#include "scene/info.h"

namespace ambilux {

template <class Backend, class Integrator, Features F>
class WaveRenderer final : public Renderer {
    using Maker = typename Backend::Maker;
    using Memory = typename Backend::Memory;
    using State = typename Maker::State;
    static constexpr bool kFilmWide = Maker::kFilmWide;
    static_assert(contract::check_method<Integrator, typename Maker::Tracer>());

public:
    [[gnu::cold]] WaveRenderer(const Scene& scene, const RenderSettings& settings, SharedAccels& accels)
        : maker_{scene, settings, Backend::threads(), Backend::bytes()} {
        const auto start = Clock::now();
        try {
            const HostTracer tracer = backend_.find_structure(accels);
            structure_seconds_ = seconds_since(start);
            if constexpr (requires { Integrator::pilot(maker_.policy, maker_.view, tracer, settings.seed); })
                maker_.plan.mean = Integrator::pilot(maker_.policy, maker_.view, tracer, settings.seed);
            plan_.choose_iterations([&] {
                plan_appended();
                return needed_bytes(true) + fixed_bytes(maker_.state_bytes()) <= spare(backend_.room(0));
            });
            plan_appended();
            if (settings.memory > 0 && needed_bytes(true) + fixed_bytes(maker_.state_bytes()) > settings.memory)
                refuse(needed_bytes(true), true);
            backend_.upload(accels);
            state_.allocate();
            shape_waves();
            allocate_film();
            backend_.allocate_waves(fixed_bytes(state_.bytes()) + film_memory_.bytes());
        } catch (const std::bad_alloc&) {
            refuse_film(scene);
        }
        build_seconds_ = seconds_since(start);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const uint32_t k = iteration_samples();
        if (first % k != 0 || count % k != 0) refuse_samples(maker_.settings, k, first, count);
        const auto start = Clock::now();
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) {
            const uint32_t most = backend_.pass(preferred_batch(), interrupt, samples_);
            const uint32_t pass = std::min(count - done, whole_waves(most, k));
            const auto pass_start = Clock::now();
            film_is_whole_ = false;
            const uint32_t finished = backend_.run(first + done, pass, state_);
            if (backend_.gave_up()) break;
            film_is_whole_ = true;
            samples_ += finished;
            film_samples_ += finished;
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
            Memory::clear(sums, maker_.film_values() * sizeof(double));
        film_samples_ = 0;
        film_is_whole_ = true;
    }
    /// Waits for a copy on the device alone, whose memory is so much faster than the bus.
    std::function<FilmMoments()> take_film() override {
        if constexpr (Backend::kHost)
            return Renderer::take_film();
        else
            return take_copy();
    }
    std::optional<DeviceImage> device_image() override {
        if constexpr (Backend::kHost) {
            return std::nullopt;
        } else {
            check_film();
            return backend_.image(film_.sums.sum, film_samples_, resident_bytes());
        }
    }

    ByteImage picture(float stops) override {
        check_film();
        const Wave& w = plan_.wave;
        if constexpr (Backend::kHost)
            return tone_mapped(film_.sums.sum, w.width, w.height, film_samples_, stops);
        else
            return backend_.picture(film_.sums.sum, film_samples_, stops);
    }
    bool move_camera() override {
        if constexpr (State::kKind != StateKind::none) return false;
        backend_.begin_anew();
        Memory::clear(film_memory_.data(), film_memory_.bytes());
        samples_ = film_samples_ = measured_samples_ = 0;
        render_seconds_ = measured_seconds_ = 0;
        film_is_whole_ = true;
        return true;
    }
    void give_up_when(const volatile bool* flag) override {
        if constexpr (Backend::kHost) backend_.give_up_when(flag);
    }

    StateKind state_kind() const override { return State::kKind; }
    std::vector<std::byte> save_state() override { return state_.save(); }
    void load_state(std::span<const std::byte> saved) override { state_.load(saved); }
    uint32_t iteration_samples() const override {
        return kWholeIterations<Integrator> ? maker_.policy.waves.iteration_samples : 1;
    }

    [[gnu::cold]] RenderStats stats() override {
        RenderStats s;
        s.backend = Backend::kName;
        s.device = backend_.device();
        s.accel = backend_.accel();
        s.settings = maker_.settings;
        s.build_seconds = build_seconds_;
        s.structure_seconds = structure_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        s.wave_paths = maker_.policy.waves.order_slots(plan_.wave.slot_count());
        s.memory_bytes = resident_bytes() + backend_.wave_bytes();
        s.memory_bytes_predicted = resident_bytes() + backend_.planned_wave_bytes();
        s.memory_bytes_peak = backend_.peak_bytes();
        backend_.fill(s);
        const std::vector<QueueCounter> counters = state_.counters();
        fill_queue_stats(state_.layout(), {counters.data()}, s);
        s.features = feature_names(F);
        s.skipped = Integrator::skipped(maker_.scene, maker_.policy);
        skipped_features(F, s.skipped);
        return s;
    }

    std::vector<StrategyImage> strategy_images() override {
        const uint32_t images = maker_.policy.waves.strategy_images();
        return ambilux::strategy_images(maker_.policy.waves.strategy_depth, samples_,
                                        read(film_.strategies, strategy_values(images, maker_.film_values() / 3)),
                                        read(film_.strategies_dropped, images));
    }

    uint32_t preferred_batch() const override {
        return whole_waves(batch_of(measured_seconds_, measured_samples_), plan_.wave.samples);
    }

private:
    /// Of room that nobody has set a budget for, a half.
    uint64_t spare(uint64_t room) const { return maker_.settings.memory ? room : room / 2; }
    void plan_appended() {
        if constexpr (AppendedState<State>)
            maker_.appended = planned_light_vertices(plan_.mean, plan_.light_subpaths_together());
    }
    /// Scene, structure, state, and what the backend has beside.
    uint64_t fixed_bytes(uint64_t state) const {
        return backend_.scene_bytes().total() + backend_.accel_bytes() + state + backend_.other_bytes();
    }
    /// What is there but for waves.
    uint64_t resident_bytes() const {
        return backend_.resident_scene_bytes() + state_.bytes() + film_memory_.bytes() + taken_.bytes();
    }
    uint64_t needed_bytes(bool with_film) {
        return backend_.waves() * maker_.wave_bytes(plan_.kept()) + (with_film ? maker_.film_bytes() : 0);
    }
    /// Waves that do well in the memory that there is. Slots of a device are counted from the bytes of a million.
    [[gnu::cold]] void shape_waves() {
        const uint64_t room = backend_.room(fixed_bytes(state_.bytes()));
        uint64_t per_path = 0;
        if constexpr (!Backend::kHost) {
            constexpr uint32_t kMillion = 1u << 20;
            WavePolicy& waves = maker_.policy.waves;
            if (plan_.streams()) waves.slots_in_flight = kMillion;
            Layout million;
            Integrator::lay_out(million, maker_.policy,
                                {kMillion, planned_light_vertices(plan_.mean, waves.most_light_subpaths(kMillion)),
                                 maker_.bytes.primitives});
            const uint64_t splat = !kFilmWide ? 0 : waves.deterministic ? 3 * sizeof(double) : sizeof(Lane);
            per_path = (million.bytes() >> 20) + splat + sizeof(Lane);
        }
        plan_.shape_preferred(per_path, room);
        if (!plan_.fit(room, [&] { return needed_bytes(true); })) refuse(needed_bytes(true), true);
    }
    [[noreturn]] void refuse(uint64_t needed, bool with_film) {
        backend_.refuse_if_full(needed);
        const uint64_t film = with_film ? maker_.film_bytes() : film_memory_.bytes(),
                       state = state_.bytes() ? state_.bytes() : maker_.state_bytes();
        refuse_budget(maker_.settings, {backend_.scene_bytes(), backend_.accel_bytes(),
                                        film + state + backend_.other_bytes(), needed - (with_film ? film : 0)});
    }
    std::function<FilmMoments()> take_copy() {
        check_film();
        const uint64_t values = maker_.film_values(), bytes = 2 * values * sizeof(double);
        if (taken_.bytes() == 0) {
            if (maker_.settings.memory > 0 && backend_.held_bytes(resident_bytes()) + bytes > maker_.settings.memory)
                return Renderer::take_film();
            try {
                taken_ = Memory(bytes, "a film that is handed over");
            } catch (const Error&) {
                return Renderer::take_film();  // no room for it
            }
        }
        backend_.note_peak(resident_bytes());
        auto* const sum = reinterpret_cast<double*>(taken_.data());
        const FilmSums taken = {sum, sum + values};
        Memory::copy(taken.sum, film_.sums.sum, bytes / 2);
        Memory::copy(taken.sum_squares, film_.sums.sum_squares, bytes / 2);
        const uint64_t samples = film_samples_;
        clear_film();
        return [this, taken, samples] { return read_film(taken, samples); };
    }
    void allocate_film() {
        Layout dry;
        maker_.lay_out_film(dry);
        film_memory_ = Memory(dry.bytes(), "film");
        Layout placed(dry, film_memory_.data());
        film_ = maker_.lay_out_film(placed);
    }

    template <class T>
    static std::vector<T> read(const T* place, size_t count) {
        std::vector<T> values(count);
        Memory::get(values.data(), place, count * sizeof(T));
        return values;
    }
    FilmMoments read_film(const FilmSums& sums, uint64_t samples) const {
        return {plan_.wave.width, plan_.wave.height, samples, read(sums.sum, maker_.film_values()),
                read(sums.sum_squares, maker_.film_values())};
    }
    /// What a fault interrupts leaves waves in the film that are not counted.
    void check_film() const {
        if (!film_is_whole_)
            throw Error(ExitCode::device, "the device failed in the middle of a sample: its film is lost");
    }

    Maker maker_;
    WavePlan& plan_ = maker_.plan;
    FilmBuffers& film_ = maker_.film;
    Backend backend_{maker_};
    Memory film_memory_, taken_;
    StateMemory<Memory, Maker> state_{maker_};
    bool film_is_whole_ = true;
    uint64_t samples_ = 0, film_samples_ = 0, measured_samples_ = 0;
    double build_seconds_ = 0, structure_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
};

}  // namespace ambilux
