#include "experiments/peers/pass_film.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace ambilux {

void PassFilm::add(const Image& image, uint32_t count, double seconds) {
    Image kept = image;
    for (float& v : kept.rgb) {
        invalid_.negative += v < 0 && std::isfinite(v);
        if (v < 0 && std::isfinite(v)) v = 0;
    }
    add_signed(kept, count, seconds);
}

void PassFilm::add_signed(const Image& image, uint32_t count, double seconds) {
    for (size_t i = 0; i < image.rgb.size(); ++i) {
        double v = image.rgb[i];
        invalid_.nan += std::isnan(v);
        invalid_.inf += std::isinf(v);
        if (!std::isfinite(v)) v = 0;
        moments_.sum[i] += v * count;
        moments_.sum_squares[i] += v * v * count;
    }
    moments_.samples += count;
    last_seconds_ = seconds;
    per_sample_ = seconds / count;
    seconds_ += seconds;
    ++passes_;
}

void PassFilm::clear() {
    moments_.samples = 0;
    moments_.sum.assign(size_t(moments_.width) * moments_.height * 3, 0.0);
    moments_.sum_squares = moments_.sum;
}

uint32_t PassFilm::preferred_batch() const {
    constexpr double kSeconds = 0.2;
    if (!(per_sample_ > 0)) return 1;
    return std::bit_floor(uint32_t(std::clamp(kSeconds / per_sample_, 1.0, 65536.0)));
}

void PassFilm::state(RenderStats& stats) const {
    stats.samples = moments_.samples;
    stats.render_seconds = seconds_;
    stats.invalid = invalid_;
    stats.stages = {{"pass", passes_, passes_ * moments_.width * moments_.height, seconds_, {}}};
}

uint32_t pass_seed(uint64_t seed, uint64_t first) {
    // SplitMix64 (Steele et al. 2014): neighbouring seeds and passes get unrelated numbers.
    uint64_t z = seed * 0xd1342543de82ef95ull + first + 0x9e3779b97f4a7c15ull;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return uint32_t((z ^ (z >> 31)) >> 33);  // 31 bits: some programs read a signed number
}

}  // namespace ambilux
