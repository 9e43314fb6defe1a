#include "formats/spot_falloff.h"

#include <algorithm>
#include <cmath>

namespace ambilux {

void add_spot_falloff(document::Document& document, document::Object& spot, double outer, double inner,
                      const std::function<double(double)>& profile) {
    constexpr int kRing = 96, kLeast = 64, kMost = 2048;  // texels
    const double c0 = std::cos(outer), c1 = std::cos(inner), edge = std::tan(outer);
    // Width of the ring if the cosine fell everywhere as fast as where it falls fastest along the tangent.
    const double steepest = std::clamp(std::sqrt(0.5), std::tan(inner), edge);
    const double ring = (c1 - c0) * std::pow(1 + steepest * steepest, 1.5) / (steepest * edge);
    const int n = std::clamp(int(std::min(std::ceil(2 * kRing / ring), 1e6)), kLeast, kMost);
    const std::string name = "spot " + std::to_string(document.images.size());
    Texels& image = document::add_image(document, name, uint32_t(n), uint32_t(n));
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const double a = edge * (2 * (x + 0.5) / n - 1), b = edge * (2 * (y + 0.5) / n - 1);
            const double share = std::clamp((1 / std::sqrt(1 + a * a + b * b) - c0) / (c1 - c0), 0.0, 1.0);
            std::fill_n(&image.floats[4 * (size_t(y) * size_t(n) + size_t(x))], 3, float(profile(share)));
        }
    document::add_child(spot, document::add_bitmap(document, spot.where, name), "texture");
}

}  // namespace ambilux
