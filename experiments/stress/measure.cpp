#include "experiments/stress/measure.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/flag.h"
#include "experiments/stress/judge.h"
#include "render/renderer.h"

namespace ambilux::stress {
namespace {

/// Paths of the first round, over all batches.
constexpr double kFirstPaths = 3.2e4;

/// Means of boxes of a film, times its samples.
class BoxSums {
public:
    BoxSums(uint32_t width, uint32_t height) {
        batches.boxes_x = std::min(kBoxes, width);
        batches.boxes_y = std::min(kBoxes, height);
        batches.boxes.assign(size_t(kBatches) * batches.box_count(), 0.0);
    }

    void add(uint32_t batch, const FilmMoments& film) {
        const uint32_t boxes = batches.box_count();
        std::vector<double> sums(boxes, 0.0), counts(boxes, 0.0);
        for (uint32_t y = 0; y < film.height; ++y)
            for (uint32_t x = 0; x < film.width; ++x) {
                const size_t box = size_t(uint64_t(y) * batches.boxes_y / film.height) * batches.boxes_x +
                                   size_t(uint64_t(x) * batches.boxes_x / film.width);
                const size_t i = (size_t(y) * film.width + x) * 3;
                sums[box] += film.sum[i] + film.sum[i + 1] + film.sum[i + 2];
                counts[box] += 3;
            }
        for (uint32_t k = 0; k < boxes; ++k) batches.boxes[size_t(batch) * boxes + k] += sums[k] / counts[k];
    }

    /// Means, where `samples` of every pixel are in every batch.
    Batches means(uint64_t samples) const {
        Batches result = batches;
        for (double& v : result.boxes) v /= double(samples);
        result.samples = samples * kBatches;
        return result;
    }

    Batches batches;
};

}  // namespace

Measurement measure(const Scene& scene, const RenderSettings& settings, const Effort& effort,
                    const volatile bool* interrupt) {
    const double pixels = double(scene.sensor.crop_width) * scene.sensor.crop_height;
    RenderSettings s = settings;
    uint32_t count = uint32_t(std::max(1.0, std::round(kFirstPaths / (pixels * kBatches))));
    s.expected_samples = uint64_t(count) * kBatches;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    Measurement m;
    BoxSums sums(scene.sensor.crop_width, scene.sensor.crop_height);
    const auto start = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    uint32_t first = 0;
    uint64_t samples = 0;
    for (;;) {
        for (uint32_t b = 0; b < kBatches; ++b) {
            if (renderer->render(first, count, interrupt) < count) {
                m.interrupted = true;
                return m;
            }
            first += count;
            sums.add(b, renderer->film());
            renderer->clear_film();
        }
        samples += count;
        m.batches = sums.means(samples);
        m.paths = double(samples) * kBatches * pixels;
        m.seconds = elapsed();
        const Mean mean = mean_of(m.batches);
        if (mean.value != 0 && mean.error <= effort.relative_error * std::abs(mean.value)) break;
        // The next round doubles what there is: it costs as much as all so far.
        if (2 * m.paths > effort.paths || 2 * m.seconds > effort.seconds) break;
        count = uint32_t(samples);
    }
    const RenderStats stats = renderer->stats();
    m.invalid = stats.invalid.total();
    for (const QueueStats& q : stats.queues) m.lost += q.overflow;
    return m;
}

}  // namespace ambilux::stress
