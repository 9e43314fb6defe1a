#include "session/drive.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>

#include "core/error.h"
#include "core/flag.h"

namespace ambilux {

void check_iterations(const std::string& name, uint64_t samples, uint32_t k, const RenderSettings& method) {
    const uint64_t whole = samples / k * k;
    if (samples == whole) return;
    throw Error(ExitCode::usage,
                fmt::format("{}={}: integrator {}, variant {}, has iterations of {} samples: {}{} would be whole ones",
                            name, samples, method.integrator, method.variant, k,
                            whole ? fmt::format("{} or ", whole) : "", whole + k));
}

RenderPosition drive(Renderer& renderer, RenderPosition position, const Budget& budget, const volatile bool* interrupt,
                     const std::function<void(const RenderPosition&)>& on_batch) {
    constexpr uint64_t kMaxSamples = std::numeric_limits<uint32_t>::max();
    if (budget.samples == 0 && !(budget.seconds > 0))
        throw Error(ExitCode::usage, "a render needs a number of samples or a time");
    if (budget.samples > kMaxSamples) throw Error(ExitCode::usage, "at most 4294967295 samples per pixel are possible");
    const uint32_t k = position.iteration_samples = renderer.iteration_samples();
    if (k > 1) check_iterations("spp", budget.samples, k, renderer.stats().settings);
    const auto whole = [k](uint64_t samples) { return std::max<uint64_t>(k, samples / k * k); };
    double& per_sample = position.per_sample;
    uint64_t& last_count = position.last_count;
    const auto* const self_timed = dynamic_cast<const SelfTimed*>(&renderer);
    while (!position.interrupted) {
        if (is_set(interrupt)) {
            position.interrupted = true;
            break;
        }
        const uint64_t ready = position.samples == 0 ? renderer.ready() : 0;
        uint64_t count = whole(std::max<uint64_t>(renderer.preferred_batch(), ready));
        if (budget.samples) {
            if (position.samples >= budget.samples) break;
            count = std::min(count, budget.samples - position.samples);
        }
        if (budget.seconds > 0) {
            // Begin small, since nothing is known, and grow by at most four, since the first sample may not be typical.
            count = std::min(count, ready ? ready : whole(4 * last_count));
            const double left = budget.seconds - position.seconds;
            if (left <= 0 && position.samples > 0) break;
            if (per_sample > 0) {
                // One call of a few samples that the system delayed is no measure.
                const double mean = position.samples ? position.seconds / double(position.samples) : per_sample;
                if (left < 0.5 * k * std::min(per_sample, mean)) break;
                count = std::min(count, whole(uint64_t(left / per_sample)));
            }
        }
        count = std::min(count, (kMaxSamples - position.samples) / k * k);
        if (count == 0) break;
        const auto start = std::chrono::steady_clock::now();
        const uint32_t done = renderer.render(uint32_t(position.samples), uint32_t(count), interrupt);
        const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
                     seconds = self_timed && done > 0 ? self_timed->last_seconds() : wall;
        position.samples += done;
        position.seconds += seconds;
        if (done < count) {
            if (!is_set(interrupt)) throw Error(ExitCode::device, "the renderer stopped without a reason");
            position.interrupted = true;
        }
        if (done > 0 && !ready) per_sample = seconds / done;
        last_count = ready ? std::max<uint64_t>(1, count / 4) : count;
        if (on_batch) on_batch(position);
    }
    return position;
}

}  // namespace ambilux
