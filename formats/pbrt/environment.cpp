#include "formats/pbrt/environment.h"

#include <algorithm>
#include <cmath>

#include "core/math.h"
#include "core/parallel.h"
#include "formats/file_budget.h"

namespace ambilux::pbrt {

namespace {

/// Equal-area octahedral map (Clarberg 2008): unit direction to [0,1]².
std::pair<double, double> square_of(double x, double y, double z) {
    const double r = std::sqrt(std::max(0.0, 1 - std::fabs(z)));
    double v = std::atan2(std::fabs(y), std::fabs(x)) * (2 / M_PI) * r, u = r - v;
    if (z < 0) {
        std::swap(u, v);
        u = 1 - u, v = 1 - v;
    }
    return {(std::copysign(u, x) + 1) / 2, (std::copysign(v, y) + 1) / 2};
}

/// Its inverse.
Vec3d direction_of(double s, double t) {
    const double u = 2 * s - 1, v = 2 * t - 1, a = std::fabs(u), b = std::fabs(v), distance = 1 - (a + b),
                 r = 1 - std::fabs(distance), phi = (r == 0 ? 1 : (b - a) / r + 1) * M_PI / 4,
                 z = std::copysign(1 - r * r, distance), sine = r * std::sqrt(std::max(0.0, 2 - r * r));
    return {std::copysign(std::cos(phi), u) * sine, std::copysign(std::sin(phi), v) * sine, z};
}

}  // namespace

Rgb SphereImage::at(double x, double y, double z) const {
    const auto [s, t] = square_of(x, y, z);
    const size_t u = std::min(size_t(s * double(size)), size - 1), v = std::min(size_t(t * double(size)), size - 1);
    return texels[v * size + u];
}

SphereImage read_sphere_image(document::Document& document, const std::string& path, const Where& where,
                              const char* light) {
    const Texels texels = document::read_image_file(document, path);
    if (texels.width != texels.height)
        fail(where, "the image of " + std::string(light) + " is " + std::to_string(texels.width) + "x" +
                        std::to_string(texels.height) + "; an equal-area octahedral map is square");
    const size_t n = texels.width;
    SphereImage out{n, std::vector<Rgb>(n * n)};
    for (size_t i = 0; i < n * n; ++i) {
        const Rgb c = texels.linear(i);
        if (!is_finite(c)) fail({path, 0}, "a texel is not finite");
        out.texels[i] = max(c, splat(0));
    }
    return out;
}

Environment read_environment(document::Document& document, const std::string& path, const Where& where) {
    const SphereImage sphere = read_sphere_image(document, path, where, "an infinite light");
    const size_t n = sphere.size;
    const std::vector<Rgb>& colors = sphere.texels;

    Environment out{path + "#latitude-longitude", 0};
    for (size_t y = 0; y < n; ++y)
        for (size_t x = 0; x < n; ++x) {
            const double z = direction_of((double(x) + 0.5) / double(n), (double(y) + 0.5) / double(n)).z;
            if (z > 0) out.illuminance += double(luminance(colors[y * n + x])) * z * 4 * M_PI / double(n * n);
        }
    // pbrt weighs the hemisphere by 2π/n².
    out.illuminance /= 2;

    const size_t width = 2 * n, height = std::max<size_t>(n, 2);
    FileBudget(path, document.limits).bytes(width * height, 16);
    Texels& image = document::add_image(document, out.image, uint32_t(width), uint32_t(height));
    constexpr int kSub = 4;
    parallel_for(height, [&](size_t y) {
        for (size_t x = 0; x < width; ++x) {
            double sum[3] = {0, 0, 0}, weight = 0;
            for (int j = 0; j < kSub; ++j) {
                // Rows lie on the latitudes from pole to pole.
                const double row = double(y) - 0.5 + (j + 0.5) / kSub;
                const double theta = std::clamp(row / double(height - 1), 0.0, 1.0) * M_PI;
                const double sine = std::sin(theta);
                for (int i = 0; i < kSub; ++i) {
                    const double phi = (double(x) + (i + 0.5) / kSub) / double(width) * 2 * M_PI;
                    const Rgb color = sphere.at(std::sin(phi) * sine, std::cos(theta), -std::cos(phi) * sine);
                    const double w = std::max(sine, 1e-6);
                    for (int c = 0; c < 3; ++c) sum[c] += w * double(color[c]);
                    weight += w;
                }
            }
            float* texel = image.floats.data() + (y * width + x) * 4;
            for (int c = 0; c < 3; ++c) texel[c] = float(sum[c] / weight);
        }
    });
    return out;
}

}  // namespace ambilux::pbrt
