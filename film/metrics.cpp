#include "film/metrics.h"

#include <cmath>
#include <limits>

#include "core/error.h"

namespace ambilux {
namespace {

template <class Value>
Metrics compare_values(uint32_t width, uint32_t height, const Reference& reference, Value value) {
    const Image& mean = reference.mean;
    if (width != mean.width || height != mean.height)
        throw Error(ExitCode::bad_input, "the image is " + std::to_string(width) + "x" + std::to_string(height) + " but the reference is " +
                                             std::to_string(mean.width) + "x" + std::to_string(mean.height) + ": render both at the same size");
    const bool errors = reference.standard_error.rgb.size() == mean.rgb.size();
    double squares = 0, relative = 0, absolute = 0, noise = 0, relative_noise = 0, total = 0, reference_total = 0, pixel_squares = 0;
    Metrics m;
    const size_t pixels = size_t(width) * height;
    for (size_t p = 0; p < pixels; ++p) {
        double pixel = 0;
        for (size_t c = 0; c < 3; ++c) {
            const size_t i = 3 * p + c;
            const double x = value(i), r = mean.rgb[i], d = x - r;
            const double se = errors ? double(reference.standard_error.rgb[i]) : std::numeric_limits<double>::quiet_NaN();
            m.non_finite += !std::isfinite(x);
            squares += d * d;
            relative += d * d / (r * r + 0.01);
            absolute += std::abs(d) / (std::abs(r) + 0.01);
            noise += se * se;
            relative_noise += se * se / (r * r + 0.01);
            reference_total += r;
            pixel += d / 3;
        }
        total += pixel;
        pixel_squares += pixel * pixel;
    }
    const double n = 3.0 * double(pixels);
    m.rmse = std::sqrt(squares / n);
    m.relmse = relative / n;
    m.mape = absolute / n;
    m.reference_noise = std::sqrt(noise / n);
    // The comparison keeps NaN: max(0, NaN) would be 0.
    const auto non_negative = [](double v) { return v < 0 ? 0.0 : v; };
    m.rmse_corrected = std::sqrt(non_negative((squares - noise) / n));
    m.relmse_corrected = non_negative((relative - relative_noise) / n);
    m.bias = total / double(pixels);
    m.relative_bias = total == 0 ? 0 : total / (reference_total / 3);
    m.bias_z = pixel_squares == 0 ? 0 : total / std::sqrt(pixel_squares);
    return m;
}

}  // namespace

Metrics compare_images(const Image& image, const Reference& reference) {
    return compare_values(image.width, image.height, reference, [&](size_t i) { return double(image.rgb[i]); });
}

Metrics compare_images(const FilmMoments& image, const Reference& reference) {
    return compare_values(image.width, image.height, reference, [&](size_t i) { return image.mean(i); });
}

nlohmann::json to_json(const Metrics& m) {
    const auto number = [](double v) { return std::isfinite(v) ? nlohmann::json(v) : nlohmann::json(nullptr); };
    return {{"rmse", number(m.rmse)},
            {"rmse_corrected", number(m.rmse_corrected)},
            {"reference_noise", number(m.reference_noise)},
            {"relmse", number(m.relmse)},
            {"relmse_corrected", number(m.relmse_corrected)},
            {"mape", number(m.mape)},
            {"bias", number(m.bias)},
            {"relative_bias", number(m.relative_bias)},
            {"bias_z", number(m.bias_z)},
            {"non_finite", m.non_finite}};
}

}  // namespace ambilux
