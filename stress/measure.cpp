#include "stress/measure.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"
#include "stress/judge.h"

namespace ambilux::stress {
namespace {

/// A round is at most so many times all before it: what a sample costs in small batches says little about large ones.
constexpr double kGrowth = 8;
constexpr uint64_t kMaxSamples = std::numeric_limits<uint32_t>::max();

/// Sums over batches and boxes of a film.
class BoxSums {
public:
    BoxSums(uint32_t width, uint32_t height) : batch_count(batches_of(uint64_t(width) * height)) {
        sums_.boxes_x = std::min(kBoxes, width);
        sums_.boxes_y = std::min(kBoxes, height);
        sums_.boxes.assign(size_t(batch_count) * sums_.box_count(), 0.0);
    }

    void add(uint32_t batch, const FilmMoments& film) {
        const uint32_t boxes = sums_.box_count();
        parallel_for(boxes, [&](uint32_t box) {
            // First row and column of the next box.
            const auto edge = [](uint32_t i, uint32_t parts, uint32_t size) {
                return uint32_t((uint64_t(i) * size + parts - 1) / parts);
            };
            const uint32_t i = box % sums_.boxes_x, j = box / sums_.boxes_x;
            const uint32_t x0 = edge(i, sums_.boxes_x, film.width), x1 = edge(i + 1, sums_.boxes_x, film.width),
                           y0 = edge(j, sums_.boxes_y, film.height), y1 = edge(j + 1, sums_.boxes_y, film.height);
            double sum = 0;
            for (uint32_t y = y0; y < y1; ++y)
                for (size_t k = (size_t(y) * film.width + x0) * 3; k < (size_t(y) * film.width + x1) * 3; ++k)
                    sum += film.sum[k];
            sums_.boxes[size_t(batch) * boxes + box] += sum / (3.0 * (x1 - x0) * (y1 - y0));
        });
    }

    /// Means of the first `count` batches, where each has `samples` of every pixel.
    Batches means(uint64_t samples, uint32_t count) const {
        Batches result = sums_;
        result.boxes.resize(size_t(count) * sums_.box_count());
        for (double& v : result.boxes) v /= double(samples);
        return result;
    }

    const uint32_t batch_count;

private:
    Batches sums_;
};

/// Samples of every batch in the next round; 0 if there shall be none. `samples`: of every batch so far.
uint64_t next_round(const Measurement& m, const Effort& effort, double pixels, uint32_t batches, uint64_t samples,
                    double round_seconds, uint64_t round_samples) {
    const double of_paths = (effort.paths - m.paths) / (pixels * batches),
                 of_time = round_seconds > 0 ? (effort.seconds - m.seconds) / round_seconds * double(round_samples)
                                             : kGrowth * double(samples);
    double next = std::min(of_paths, kGrowth * double(samples));
    if (effort.samples > 0) {
        // Whole waves whatever the error is; the time alone may end it.
        if (m.samples >= effort.samples) return 0;
        next = std::min(std::ceil(double(effort.samples - m.samples) / batches), kGrowth * double(samples));
    } else {
        const Mean mean = mean_of(m.batches);
        const double wanted = effort.relative_error * std::abs(mean.value);
        if (mean.value != 0 && mean.error <= wanted) return 0;
        // A little more than what the error so far asks for.
        if (mean.value != 0) next = std::min(next, 1.2 * double(samples) * (std::pow(mean.error / wanted, 2) - 1) + 1);
    }
    next = std::min({next, of_time, double(kMaxSamples / batches - samples)});
    return next >= 1 && (effort.samples > 0 || next >= 0.1 * double(samples)) ? uint64_t(next) : 0;
}

}  // namespace

Measurement measure(const Hooks& hooks, const Scene& scene, const RenderSettings& settings, const Effort& effort,
                    const volatile bool* interrupt) {
    using Clock = std::chrono::steady_clock;
    if (effort.samples > kMaxSamples) throw Error(ExitCode::usage, "at most 4294967295 samples per pixel are possible");
    const double pixels = double(scene.sensor.crop_width) * scene.sensor.crop_height;
    BoxSums sums(scene.sensor.crop_width, scene.sensor.crop_height);
    RenderSettings s = settings;
    s.expected_samples = std::max(effort.samples, uint64_t(effort.paths / pixels)) / sums.batch_count + 1;
    const auto start = Clock::now();
    const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
    const std::unique_ptr<Renderer> renderer = hooks.make_renderer(scene, s);
    const uint64_t k = renderer->iteration_samples();
    const auto whole = [k](uint64_t wanted) { return (wanted + k - 1) / k * k; };
    Measurement m;
    uint64_t samples = 0;  // of every batch
    uint64_t count = whole(uint64_t(std::max(1.0, std::round(effort.first_paths / (pixels * sums.batch_count)))));
    while (count > 0) {
        const double before = elapsed();
        const auto out_of_time = [&](uint32_t done) {
            return samples == 0 && done >= kLeastBatches && elapsed() > effort.seconds;
        };
        // A round that takes far longer than those before it promised is given up, and what they measured stands.
        const auto too_slow = [&] { return samples > 0 && elapsed() > 2 * effort.seconds; };
        uint64_t rendered = m.samples;
        uint32_t done = 0;
        for (; done < sums.batch_count && !out_of_time(done) && !too_slow(); ++done) {
            if (renderer->render(uint32_t(rendered), uint32_t(count), interrupt) < count) {
                m.interrupted = true;
                return m;
            }
            rendered += count;
            sums.add(done, renderer->film());
            renderer->clear_film();
        }
        if (samples > 0 && done < sums.batch_count) break;
        m.samples = rendered;
        samples += count;
        m.batches = sums.means(samples, done);
        m.paths = double(m.samples) * pixels;
        m.seconds = elapsed();
        if (done < sums.batch_count) break;
        if (samples == count) m.first = mean_of(m.batches).value;
        count = whole(next_round(m, effort, pixels, sums.batch_count, samples, m.seconds - before, count));
    }
    const RenderStats stats = renderer->stats();
    m.invalid = stats.invalid.total();
    m.underflow = stats.invalid.underflow;
    for (const QueueStats& q : stats.queues) m.lost += q.overflow;
    return m;
}

}  // namespace ambilux::stress
