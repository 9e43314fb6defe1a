#include "integrators/auto/variance_prediction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "core/parallel.h"

namespace ambilux {
namespace {

struct Mean {
    double of[3] = {};
};

/// Means over a block and its neighbours: a few samples are no scale.
void blur(uint32_t width, uint32_t height, const std::vector<Mean>& of, std::vector<Mean>& to) {
    for (uint32_t b = 0; b < width * height; ++b) {
        const uint32_t x = b % width, y = b / width;
        double n = 0;
        for (uint32_t ny = y ? y - 1 : 0; ny < std::min(height, y + 2); ++ny)
            for (uint32_t nx = x ? x - 1 : 0; nx < std::min(width, x + 2); ++nx, n += 1)
                for (int k = 0; k < 3; ++k) to[b].of[k] += of[ny * width + nx].of[k];
        for (double& m : to[b].of) m /= n;
    }
}

/// The variance of one candidate in every block.
class Prediction {
public:
    Prediction(const SecondMoments& moments, const PilotPaths& paths, uint32_t candidate,
               const std::vector<Mean>& scale, std::vector<double>& variance)
        : moments_(moments), paths_(paths), c_(candidate), scale_(scale), variance_(variance),
          samples_(double(paths.pixels_per_block) * paths.samples_per_pixel) {}

    void predict(uint32_t width, uint32_t height) {
        add_pixels();
        add_splats();
        std::vector<Mean> lost(scale_.size()), smooth(scale_.size());
        leave_out(outliers(), lost);
        blur(width, height, lost, smooth);
        for (uint32_t b = 0; b < scale_.size(); ++b)
            for (int k = 0; k < 3; ++k)
                variance_[b] += paths_.expected_samples * sqr(smooth[b].of[k]) / (3.0 * (sqr(scale_[b].of[k]) + 0.01));
    }

private:
    struct Rare {
        double size;
        const PilotEvent* event;
        uint32_t block;
        float sum;
        std::array<double, 3> scale2;
    };

    template <class Radiance>
    std::array<double, 3> scale2_of(uint32_t b, const Radiance& seen) const {
        std::array<double, 3> scale2;
        for (int k = 0; k < 3; ++k) scale2[k] = sqr(std::max(scale_[b].of[k], double(seen[k]))) + 0.01;
        return scale2;
    }

    void add_rare(const PilotEvent& e, uint32_t b, const std::array<double, 3>& scale2, float sum) {
        if (!(sum > 0.0f && sum < kRareShare * e.total())) return;
        double size = 0;
        for (int k = 0; k < 3; ++k) size = std::max(size, double(e.value[k]) / (double(sum) * std::sqrt(scale2[k])));
        rare_.push_back({size, &e, b, sum, scale2});
    }

    void add_pixels() {
        for (size_t p = 0; p < paths_.pixels.size(); ++p) {
            const PilotSums& s = paths_.pixels[p];
            const uint32_t b = uint32_t(p / paths_.pixels_per_block);
            const std::array<double, 3> scale2 = scale2_of(b, s.seen);
            for (int k = 0; k < 3; ++k) variance_[b] += s.variance[c_][k] / (3.0 * samples_ * scale2[k]);
            for (const PilotEvent& e : s.rare) add_rare(e, b, scale2, moments_.sum_of(c_, e.shares));
        }
    }

    void add_splats() {
        for (const PilotSplat* s : paths_.splats) {
            const PilotEvent& e = s->event;
            const float sum = moments_.sum_of(c_, e.shares);
            if (!(sum > 0.0f)) continue;
            const std::array<double, 3> scale2 = scale2_of(s->block, s->seen ? s->radiance : Rgb{0.0f, 0.0f, 0.0f});
            const double moment = moments_.second_moment(c_, e, sum);
            for (int k = 0; k < 3; ++k)
                variance_[s->block] += moment * sqr(double(e.value[k])) / (3.0 * samples_ * scale2[k]);
            add_rare(e, s->block, scale2, sum);
        }
    }

    /// The brightest contributions, of which the whole render is expected to have kUnexpected. Which are the largest
    /// matters, not their order: of what is in question the larger half is taken, or the other half is
    /// left.
    std::span<const Rare> outliers() {
        double share = 0;
        auto taken = rare_.begin();
        for (auto end = rare_.end(); taken != end;) {
            const auto middle = taken + (end - taken) / 2 + 1;
            std::nth_element(taken, middle - 1, end, [](const Rare& a, const Rare& b) { return a.size > b.size; });
            double more = 0;
            for (auto r = taken; r != middle; ++r)
                more +=
                    double(r->event->coverage) * double(r->sum) / double(r->event->total()) / double(moments_.samples);
            if (share + more <= kUnexpected / (double(paths_.film_pixels) * paths_.expected_samples)) {
                share += more;
                taken = middle;
            } else {
                end = middle - 1;
            }
        }
        return {rare_.begin(), taken};
    }

    /// In their pixels outliers are left out; elsewhere their light is missing.
    void leave_out(std::span<const Rare> outliers, std::vector<Mean>& lost) {
        for (const Rare& r : outliers) {
            const PilotEvent& e = *r.event;
            for (int k = 0; k < 3; ++k) {
                variance_[r.block] -=
                    moments_.second_moment(c_, e, r.sum) * sqr(double(e.value[k])) / (3.0 * samples_ * r.scale2[k]);
                lost[r.block].of[k] += double(e.coverage) * double(e.value[k]) / double(e.total()) / samples_;
            }
        }
    }

    const SecondMoments& moments_;
    const PilotPaths& paths_;
    const uint32_t c_;
    const std::vector<Mean>& scale_;
    std::vector<double>& variance_;
    const double samples_;
    std::vector<Rare> rare_;
};

}  // namespace

void predict_variances(const SecondMoments& moments, const PilotPaths& paths, Pilot& result) {
    const uint32_t count = result.blocks_x * result.blocks_y;
    const double samples = double(paths.pixels_per_block) * paths.samples_per_pixel;
    std::vector<Mean> block(count), scale(count);
    for (size_t p = 0; p < paths.pixels.size(); ++p)
        for (int k = 0; k < 3; ++k) block[p / paths.pixels_per_block].of[k] += paths.pixels[p].mean[k] / samples;
    for (const PilotSplat* s : paths.splats)
        for (int k = 0; k < 3; ++k)
            block[s->block].of[k] += double(s->event.value[k] * (s->event.coverage / s->event.total())) / samples;
    blur(result.blocks_x, result.blocks_y, block, scale);
    result.variance.assign(moments.candidates.size(), std::vector<double>(count));
    parallel_for(uint32_t(moments.candidates.size()), [&](uint32_t c) {
        Prediction(moments, paths, c, scale, result.variance[c]).predict(result.blocks_x, result.blocks_y);
    });
}

}  // namespace ambilux
