#include "session/bench_frames.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "backends/cuda/mean_on_device.h"
#include "core/flag.h"
#include "film/image.h"

namespace ambilux {
namespace {

constexpr uint32_t kUntimed = 3;  ///< the first ones bear what later ones do not

void read_image(Renderer& renderer, std::vector<float>& rgb) {
    if (const auto image = renderer.device_image())
        copy_to_host(*image, rgb);
    else
        rgb = mean_image(renderer.film()).rgb;
}

}  // namespace

double FrameTimes::quantile(double share) const {
    if (seconds.empty()) return 0.0;
    std::vector<double> sorted = seconds;
    std::sort(sorted.begin(), sorted.end());
    return sorted[size_t(std::max(1.0, std::ceil(share * double(sorted.size())))) - 1];
}

FrameTimes time_frames(Renderer& renderer, uint32_t frames, const volatile bool* interrupt) {
    using Clock = std::chrono::steady_clock;
    const uint32_t k = renderer.iteration_samples();
    FrameTimes times;
    for (uint32_t frame = 0; frame < kUntimed + frames && !is_set(interrupt); ++frame) {
        const auto start = Clock::now();
        renderer.clear_film();
        if (renderer.render(frame * k, k, interrupt) < k) break;
        read_image(renderer, times.rgb);
        if (frame >= kUntimed) times.seconds.push_back(std::chrono::duration<double>(Clock::now() - start).count());
    }
    return times;
}

}  // namespace ambilux
