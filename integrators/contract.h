// What methods and executors promise each other, checked where a method is registered (cmake/registry.cmake): a failed
// check names what is missing. Concepts lie in a namespace of their own: templates call their parameters by the same
// names.
#pragma once

#include "accel/host_tracer.h"
#include "integrators/integrator.h"
#include "integrators/kept_state.h"
#include "items/candidate_items.h"

namespace ambilux {
namespace contract {
namespace detail {

/// A stage of one item, to ask executors with.
struct AnyStage {
    static constexpr const char* kName = "any";
    Queue<Contribution> queue;
    StageRecord* record;

    const Queue<Contribution>& items() const { return queue; }
    QueueCounter* target() const { return queue.counter; }
    AMBILUX_HD void operator()(uint32_t) const {}
    AMBILUX_HD void operator()(uint32_t, uint32_t) const {}
};

struct AnyCall {
    void operator()() const {}
};
/// An executor, and what runs an iteration, of which methods are asked. It runs nothing.
struct AnyExecutor {
    static constexpr bool kHost = true;
    template <class... A>
    void run(const A&...);
};
struct AnyIteration {
    template <class Body>
    void for_waves(const Body&);
    template <class Body>
    void once(const Body&);
};

}  // namespace detail

// ---- executors ----

/// Sorts and loops over numbers, in a wave and between phases.
template <class E>
concept RunsOverItems = requires(E& exec, const detail::AnyStage& stage, const Queue<Contribution>& queue, uint32_t n) {
    { E::kHost } -> std::convertible_to<bool>;
    exec.for_each(stage, n);
    exec.for_each(stage, queue);
    exec.run_slots(stage, n, n);
    exec.clear(queue);
};
/// What an executor is to the phases of a method. It says whether it runs on the host; runs a stage over its items,
/// which are then gone (run), over those of a queue, which stay (for_each), over slots (run_slots), or as one that
/// claims its slots by itself (run_paths); traces rays (trace, extend); loops until a queue is empty (repeat_while);
/// fails a wave whose queues overflowed; appends to what all waves share; stores one number that stages share; sorts as
/// many pairs as a queue has items.
template <class E>
concept Executor =
    RunsOverItems<E> && requires(E& exec, const detail::AnyStage& stage, const Queue<Contribution>& queue,
                                 const SortMemory<uint32_t>& sort, StageRecord* record, uint32_t* place, uint32_t n) {
        exec.run(stage);
        exec.fail_on_overflow(queue, queue);
        exec.append(stage);
        exec.repeat_while(queue, detail::AnyCall());
        exec.store(place, n);
        exec.sort_pairs(sort, queue, n, record);
        exec.set_depth(n);
        exec.next_depth(n);
    };
/// The same between phases, over what all waves have left: their number is known to the host.
template <class E>
concept WholeExecutor =
    RunsOverItems<E> && requires(E& exec, const Queue<Contribution>& queue, const SortMemory<uint64_t>& sort,
                                 const ScanMemory& scan, StageRecord* record, uint32_t* numbers, uint32_t n) {
        { exec.count(queue) } -> std::convertible_to<uint32_t>;
        exec.sort_pairs(sort, n, n, record);
        exec.scan(scan, numbers, numbers, n, record);
    };

// ---- methods ----

/// Decides on the host what is rendered where.
template <class I>
concept HasPolicy = requires(const Scene& scene, const RenderSettings& settings, typename I::Policy& policy) {
    { I::plan(scene, settings) } -> std::same_as<typename I::Policy>;
    { policy.waves } -> std::convertible_to<WavePolicy>;
    { I::skipped(scene, policy) } -> std::convertible_to<std::vector<std::string>>;
    { I::kFilmWide } -> std::convertible_to<bool>;  // light may land anywhere on the film
};
/// Methods with light subpaths: counts their vertices before the render.
template <class I>
concept HasPilot = !I::kFilmWide || requires(typename I::Policy& policy, const SceneView& scene,
                                             const HostTracer& tracer, uint64_t seed) {
    { I::pilot(policy, scene, tracer, seed) } -> std::convertible_to<double>;
};
/// Queues of a wave.
template <class I>
concept HasMemory = requires(Layout& layout, const typename I::Policy& policy, const WaveSize& size) {
    { I::lay_out(layout, policy, size) } -> std::same_as<typename I::Memory>;
};
/// Stages that are made of them.
template <class I, class Tracer>
concept HasStages = std::constructible_from<typename I::Stages, const WaveParts<Tracer>&, const typename I::Policy&,
                                            const typename I::Memory&, const typename I::State&>;
/// One phase: schedule(executor, stages) is a wave.
template <class I>
concept HasSchedule =
    requires(detail::AnyExecutor& exec, const typename I::Stages& stages) { I::schedule(exec, stages); };
/// Phases: iteration(run) calls run.for_waves(phase) kPhases times, and run.once(work) between them and after them.
template <class I>
concept HasIteration = requires(detail::AnyIteration& run) {
    { I::kPhases } -> std::convertible_to<uint32_t>;
    I::iteration(run);
};

template <class I, class Tracer>
concept Integrator = HasPolicy<I> && HasPilot<I> && HasMemory<I> && KeptState<typename I::State, typename I::Policy> &&
                     HasStages<I, Tracer> && (HasSchedule<I> != HasIteration<I>);

/// The same part by part, so that the first message says what is missing.
template <class I, class Tracer>
consteval bool check_method() {
    static_assert(HasPolicy<I>,
                  "a method needs Policy with WavePolicy waves, plan(scene, settings) -> Policy, "
                  "skipped(scene, policy) and kFilmWide");
    static_assert(HasPilot<I>,
                  "a method with kFilmWide needs pilot(policy, scene, tracer, seed) -> double: the mean "
                  "number of vertices that a light subpath leaves");
    static_assert(HasMemory<I>,
                  "a method needs Memory and lay_out(layout, policy, size) -> Memory: the queues of a wave");
    static_assert(KeptState<typename I::State, typename I::Policy>,
                  "a method needs State: NoState, or a plain struct with kKind, lay_out(layout, policy, size), "
                  "init(policy, put) and for_each_saved(visit)");
    static_assert(HasStages<I, Tracer>, "a method needs Stages(parts, policy, memory, state)");
    static_assert(HasSchedule<I> != HasIteration<I>,
                  "a method needs either schedule(executor, stages), or iteration(run) and kPhases");
    return Integrator<I, Tracer>;
}

}  // namespace contract

/// Phases of an iteration.
template <class I>
constexpr uint32_t phases_of() {
    if constexpr (contract::HasIteration<I>)
        return I::kPhases;
    else
        return 1;
}
/// Iterations have the number of samples that the method says, whatever a device could hold: what is built in one phase
/// is used in another, the state follows from their number, or the method says that it counts them (kKeepsIterations).
template <class I>
constexpr bool kWholeIterations =
    phases_of<I>() > 1 || I::State::kKind == StateKind::by_index || requires { I::kKeepsIterations; };

/// Runs one iteration of a method.
template <class I, class Run>
void run_iteration(Run& run) {
    if constexpr (contract::HasIteration<I>)
        I::iteration(run);
    else
        run.for_waves([](auto& exec, const auto& stages) { I::schedule(exec, stages); });
}

}  // namespace ambilux
