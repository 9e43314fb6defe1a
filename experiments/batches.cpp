#include "experiments/batches.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "film/metrics.h"

namespace ambilux {

Budget batch_end(const ExperimentConfig& config, const RenderPosition& at, const Budget& checkpoint) {
    Budget budget = checkpoint;
    const auto end = [](double now, double step) { return (std::floor(now / step + 0.5) + 1) * step; };
    if (!config.seconds.empty()) {
        const double step = config.seconds.back() / kBatches, next = end(at.seconds, step);
        // A batch for which half an iteration is too long would never begin.
        const bool has_room = next - at.seconds >= 0.5 * at.per_iteration();
        if (has_room && (budget.seconds == 0 || next <= budget.seconds - 0.5 * step)) budget.seconds = next;
    } else {
        const double step = std::max(1.0, double(config.spp.back()) / kBatches);
        const uint32_t k = at.iteration_samples;
        const uint64_t next = (uint64_t(std::llround(end(double(at.samples), step))) + k - 1) / k * k;
        if (double(next) <= double(budget.samples) - 0.5 * step) budget.samples = next;
    }
    return budget;
}

Budget next_budget(const ExperimentConfig& config, const std::vector<size_t>& pending, const RenderPosition& at) {
    const std::vector<Checkpoint> checkpoints = config.checkpoints();
    Budget budget;
    for (const size_t k : pending) {
        const Checkpoint& c = checkpoints[k];
        if (c.samples) budget.samples = budget.samples ? std::min(budget.samples, c.samples) : c.samples;
        if (c.seconds > 0) budget.seconds = budget.seconds > 0 ? std::min(budget.seconds, c.seconds) : c.seconds;
    }
    return batch_end(config, at, budget);
}

std::vector<std::pair<size_t, size_t>> render_order(size_t scenes, size_t runs, uint64_t seed, bool random) {
    std::vector<std::pair<size_t, size_t>> order;
    for (size_t i = 0; i < scenes; ++i)
        for (size_t k = 0; k < runs; ++k) order.emplace_back(i, k);
    if (!random) return order;
    // Fisher and Yates; the same on every machine, so that a resumed experiment goes on in its order.
    std::mt19937_64 generator(seed);
    for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[generator() % i]);
    return order;
}

BatchRow measure_batch(const FilmMoments& film, const Reference& reference, double seconds) {
    const Metrics m = compare_images(film, reference);
    BatchRow b;
    b.spp = film.samples;
    b.time = seconds;
    const double error = std::isnan(m.rmse_corrected) ? m.rmse : m.rmse_corrected;
    b.mse = error * error;
    b.relmse = std::isnan(m.relmse_corrected) ? m.relmse : m.relmse_corrected;
    return b;
}

}  // namespace ambilux
