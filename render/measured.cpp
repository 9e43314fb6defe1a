#include "render/measured.h"

#include <algorithm>

#include "integrators/auto/film_footprint.h"
#include "render/statistics.h"

namespace ambilux {
namespace {

constexpr uint32_t kLeastSamples = 4;

std::vector<double> variance_by_block(const FilmMoments& film) {
    const FilmBlocks all = FilmBlocks::of(film.width, film.height);
    const double n = double(film.samples);
    std::vector<double> variance;
    for (uint32_t b = 0; b < all.count(); ++b) {
        const uint32_t x0 = FilmBlocks::edge(b % all.x, film.width, all.x),
                       x1 = FilmBlocks::edge(b % all.x + 1, film.width, all.x),
                       y0 = FilmBlocks::edge(b / all.x, film.height, all.y),
                       y1 = FilmBlocks::edge(b / all.x + 1, film.height, all.y);
        double sum[3] = {}, of_pixels[3] = {};
        for (uint32_t y = y0; y < y1; ++y)
            for (uint32_t x = x0; x < x1; ++x)
                for (size_t c = 0; c < 3; ++c) {
                    const size_t i = (size_t(y) * film.width + x) * 3 + c;
                    const double mean = film.sum[i] / n;
                    sum[c] += mean;
                    of_pixels[c] += std::max(0.0, film.sum_squares[i] / n - mean * mean) * n / (n - 1);
                }
        const double pixels = double(x1 - x0) * (y1 - y0);
        double relative = 0;
        for (int c = 0; c < 3; ++c) {
            const double mean = sum[c] / pixels;
            relative += of_pixels[c] / pixels / (mean * mean + 0.01) / 3;
        }
        variance.push_back(relative);
    }
    return variance;
}

}  // namespace

Measured measure(const RenderSettings& settings, const MakeRenderer& make, uint32_t first, double seconds) {
    const std::unique_ptr<Renderer> renderer = make(settings);
    renderer->render(first, 1);
    // Of the longest batch, whose launches cost the least beside their items.
    double spent = 0, longest = 0, of_sample = 0;
    for (uint32_t done = 1, batch = kLeastSamples - 1; done < kLeastSamples || spent < seconds;) {
        const auto start = Clock::now();
        const uint32_t samples = renderer->render(first + done, batch);
        const double took = seconds_since(start);
        if (took > longest) of_sample = took / samples;
        longest = std::max(longest, took);
        spent += took;
        done += samples;
        batch = std::clamp(uint32_t(std::max(0.0, seconds - spent) / took * batch), 1u, 4 * batch);
    }
    const FilmMoments film = renderer->film();
    return {variance_by_block(film), of_sample, double(film.samples)};
}

}  // namespace ambilux
