// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Weights where pixels differ by their number of connections (integrators/bdpt/aware/pixel_mis.h) against the densities
// of all strategies enumerated.
#include "integrators/bdpt/aware/pixel_mis.h"
#include "tests/support/bidirectional_paths.h"

namespace ambilux {

constexpr uint32_t kColumns = 5, kRows = 3;
constexpr uint16_t kCounts[kColumns * kRows] = {0, 1, 2, 4, 8, 8, 0, 4, 1, 2, 1, 8, 0, 2, 4};

inline PixelMis by_pixel(BidirectionalMis mis) {
    PixelMis own(mis);
    own.counts = {kCounts, kColumns, kRows};
    own.per_draw = mis.connections;
    return own;
}

/// From the path alone: where on the film its last segment ends, and which block that pixel's centre lies in.
inline double connections_of(const PixelMis& mis, const SceneView& scene, const test::OraclePath& path) {
    if (path.k < 3) return 0;  // no path of connections
    const Sensor& s = scene.sensor;
    Vec2f film{};
    CHECK(project_to_film<test::F>(s, path.vertices[path.k - 1].point.p, lens_point(s, path.lens_u), film));
    const auto block = [](double place, uint32_t pixels, uint32_t blocks) {
        const double pixel = std::clamp(std::floor(place), 0.0, double(pixels) - 1);
        return uint32_t(std::floor((pixel + 0.5) * blocks / pixels));
    };
    return double(mis.per_draw) * kCounts[block(double(film.y), s.crop_height, kRows) * kColumns +
                                          block(double(film.x), s.crop_width, kColumns)];
}

}  // namespace ambilux

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("Weights with connections by pixel equal those of all strategies enumerated, and sum to one") {
    const std::map<std::string, uint64_t> seen =
        compare_weights(0.05, [&](uint32_t i) { return by_pixel(settings(i)); });
    for (const char* kind : {"hit", "escape", "next event", "connection", "light tracing", "visible light"})
        CHECK(seen.at(std::string(kind) + ", perspective") >= 20);
    for (const char* sensor : {"thinlens", "orthographic", "spherical"})
        CHECK(seen.at(std::string("connection, ") + sensor) >= 20);
}

TEST_CASE("With as many for all pixels weights are those of bdpt") {
    const uint16_t three = 3;
    BidirectionalMis two = settings(0);
    PixelMis mis(two);
    mis.counts = {&three, 1, 1};
    mis.per_draw = 0.25f;
    two.connections = 0.75f;
    // As sums of a vertex: those behind it, with and without connections.
    const PixelSums y{2.0f, 3.0f, 5.0f, 0.0f}, z{7.0f, 0.5f, 4.0f, 3.0f};
    const auto both = [&](const PixelSums& s) { return MisSums{s.dvcm, two.norm(s.dvc, 0.75f * s.dvk)}; };
    const ConnectionDensities p{0.3f, 0.2f, 0.7f, 1.1f};
    CHECK(mis.connection_ratio(y, false, z, false, p) ==
          Approx(two.connection_ratio(both(y), false, both(z), false, p)));
    const PixelSums next = mis.sums_after_scatter(z, false, false, 0.4f, 0.6f, 0.5f);
    const MisSums plain = two.sums_after_scatter(both(z), false, false, 0.4f, 0.6f, 0.5f);
    CHECK(next.dvcm == plain.dvcm);
    CHECK(both(next).dvc == Approx(plain.dvc));
    CHECK(next.draws == 3.0f);
}
