#include "render/sample_watch.h"

#include <algorithm>

#include "core/flag.h"

namespace ambilux {

uint32_t SampleWatch::render(uint32_t first, uint32_t count, const volatile bool* interrupt) {
    for (uint32_t done = 0; done < count; ++done) {
        if (is_set(interrupt)) return done;
        renderer_->clear_film();
        if (renderer_->render(first + done, 1, interrupt) == 0) return done;
        look(first + done, renderer_->film());
    }
    return count;
}

void SampleWatch::clear_film() {
    renderer_->clear_film();
    film_ = {};
    largest_.clear();
}

void SampleWatch::look(uint32_t sample, const FilmMoments& one) {
    if (film_.samples == 0) {
        film_ = one;
        largest_.resize(one.sum.size() / 3);
    } else {
        film_.add(one);
    }
    for (size_t pixel = 0; pixel < largest_.size(); ++pixel) {
        Largest& l = largest_[pixel];
        const double* const value = &one.sum[pixel * 3];
        const double most = std::max({value[0], value[1], value[2]});
        if (film_.samples > 1 && !(most > std::max({l.value[0], l.value[1], l.value[2]}))) continue;
        l = {{value[0], value[1], value[2]}, sample};
    }
}

std::vector<WatchedPixel> SampleWatch::worst(uint32_t count) const {
    std::vector<WatchedPixel> all;
    for (size_t pixel = 0; pixel < largest_.size(); ++pixel) {
        WatchedPixel w;
        w.x = uint32_t(pixel % film_.width);
        w.y = uint32_t(pixel / film_.width);
        w.sample = largest_[pixel].sample;
        const double others = double(std::max<uint64_t>(1, film_.samples - 1));
        for (size_t c = 0; c < 3; ++c) {
            w.value[c] = largest_[pixel].value[c];
            w.excess = std::max(w.excess, w.value[c] - (film_.sum[pixel * 3 + c] - w.value[c]) / others);
        }
        all.push_back(w);
    }
    const size_t n = std::min<size_t>(count, all.size());
    std::partial_sort(all.begin(), all.begin() + ptrdiff_t(n), all.end(),
                      [](const WatchedPixel& a, const WatchedPixel& b) { return a.excess > b.excess; });
    all.resize(n);
    return all;
}

}  // namespace ambilux
