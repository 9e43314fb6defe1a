#include "film/tone.h"

#include <algorithm>

#include "core/parallel.h"
#include "core/srgb.h"

namespace ambilux {

const std::array<uint8_t, kToneSteps>& tone_table() {
    static const auto table = [] {
        std::array<uint8_t, kToneSteps> t{};
        for (size_t i = 0; i < t.size(); ++i) {
            const float root = float(i) / float(t.size() - 1);
            t[i] = uint8_t(linear_to_srgb(root * root) * 255.0f + 0.5f);
        }
        return t;
    }();
    return table;
}

double tone_scale(float stops, uint64_t samples) {
    return std::exp2(double(stops)) / double(std::max<uint64_t>(1, samples));
}

ByteImage tone_mapped(const double* sum, uint32_t width, uint32_t height, uint64_t samples, float stops) {
    const ToneMap tone = {tone_table().data(), tone_scale(stops, samples)};
    const size_t row = size_t(width) * 3;
    const std::shared_ptr<uint8_t> rgb(new uint8_t[row * height], std::default_delete<uint8_t[]>());
    parallel_for(height, [&](uint32_t y) {
        for (size_t i = y * row, end = i + row; i < end; ++i) rgb.get()[i] = tone(sum[i]);
    });
    return {width, height, samples, rgb};
}

}  // namespace ambilux
