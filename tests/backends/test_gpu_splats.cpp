// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 300
// G1: thousands of splats on one pixel, as a device adds them up by default.
#include <algorithm>
#include <cmath>

#include "tests/support/bidirectional_images.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

namespace {

constexpr uint32_t kSamples = 256;

/// The plane under a spherical lamp in one pixel of 256, each of which starts 16 light subpaths.
Scene one_pixel() {
    return plane_under(kSphereLight,
                       "<sensor type='orthographic'><transform name='to_world'><scale x='16' y='16'/><lookat "
                       "origin='1,1,0.1' target='1,1,0' up='0,1,0'/></transform>" +
                           film(16) + "</sensor>");
}

RenderResult render_one_pixel(const Scene& scene, const char* backend, bool deterministic) {
    RenderSettings s = method_settings(scene, kLightTracer, 21);
    s.backend = backend;
    s.deterministic = deterministic;
    apply_setting(s, "light_paths", "16");
    return render_scene(scene, s, kSamples);
}

uint64_t splats_of(const RenderResult& r) {
    for (const StageStats& s : r.stats.stages)
        if (s.name == "splat") return s.items;
    return 0;
}

/// Place of the pixel's first value in a film: the brightest.
size_t place_of(const RenderResult& r) {
    return size_t(std::max_element(r.film.sum.begin(), r.film.sum.end()) - r.film.sum.begin()) / 3 * 3;
}

/// The radiance of the pixel, which sees [-1,1]², by quadrature.
double expected_radiance(int channel) {
    const int n = 400;
    double sum = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) sum += sphere_irradiance(-1 + 2 * (i + 0.5) / n, -1 + 2 * (j + 0.5) / n);
    return sum / (double(n) * n) * double(kLight[channel]) * double(kPlaneAlbedo[channel]) / M_PI;
}

void check_mean(const RenderResult& r) {
    for (int c = 0; c < 3; ++c) {
        const size_t i = place_of(r) + size_t(c);
        const double n = kSamples, mean = r.film.sum[i] / n,
                     error = std::sqrt((r.film.sum_squares[i] / n - mean * mean) / (n - 1));
        INFO("channel " << c << ": " << mean << " +- " << error << " for " << expected_radiance(c));
        CHECK(error < 0.005 * mean);  // a loss of 2.3 % would be seen
        CHECK(std::fabs(mean - expected_radiance(c)) < 4.5 * error);
    }
}

}  // namespace

TEST_CASE("G1: light subpaths of one pixel bring its closed form") {
    const RenderResult r = render_one_pixel(one_pixel(), "cpu", false);
    CHECK(splats_of(r) > 300 * kSamples);
    check_mean(r);
}

TEST_CASE("G1: by default a device loses none of the splats that thousands of light subpaths put on one pixel") {
    if (!device()) return;
    const Scene scene = one_pixel();
    const RenderResult exact = render_one_pixel(scene, "cuda", true);
    const uint64_t splats = splats_of(exact);
    CHECK(splats > 300 * kSamples);
    check_mean(exact);
    for (int run = 0; run < 20; ++run) {
        const RenderResult r = render_one_pixel(scene, "cuda", false);
        INFO("run " << run);
        CHECK(splats_of(r) == splats);
        CHECK(r.stats.invalid.total() == 0);
        // Sums of floats, an error of 2^-24 for each splat of a cell; a splat that got lost would be one part in as
        // many as there are.
        const double most = double(splats) / kSamples * 0x1p-24;
        REQUIRE(most < 0.5 * kSamples / double(splats));
        for (size_t i = place_of(exact); i < place_of(exact) + 3; ++i)
            CHECK(std::fabs(r.film.sum[i] - exact.film.sum[i]) <= most * exact.film.sum[i]);
    }
}
