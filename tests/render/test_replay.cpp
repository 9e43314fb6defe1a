// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// A replay brings the bits of the sample that a render made: every integrator and variant that has one.
#include <cmath>

#include "render/replay/replay.h"
#include "tests/support/render_scene.h"

namespace ambilux {
namespace {

/// Settings of a render, by text.
struct Config {
    std::string integrator, variant;
    std::vector<std::pair<std::string, std::string>> set;
};

RenderSettings settings_of(const Scene& scene, const Config& c) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 7);
    s.integrator = c.integrator;
    s.variant = c.variant;
    for (const auto& [key, value] : c.set) apply_setting(s, key, value);
    return s;
}

std::string text_of(const Config& c) {
    std::string text = c.integrator + " " + c.variant;
    for (const auto& [key, value] : c.set) text += " " + key + "=" + value;
    return text;
}

/// The image of one sample.
FilmMoments one_sample(const Scene& scene, const RenderSettings& settings, uint32_t sample) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    REQUIRE(renderer->render(sample, 1) == 1);
    CHECK(renderer->stats().invalid.total() == 0);
    return renderer->film();
}

size_t brightest(const FilmMoments& film) {
    size_t at = 0;
    for (size_t i = 0; i < film.sum.size(); ++i)
        if (film.sum[i] > film.sum[at]) at = i;
    return at / 3;
}

/// Pixels of a film, `step` apart, and the brightest.
std::vector<uint32_t> pixels_of(const FilmMoments& film, uint32_t step) {
    std::vector<uint32_t> pixels = {uint32_t(brightest(film))};
    for (uint32_t p = 0; p < film.width * film.height; p += step) pixels.push_back(p);
    return pixels;
}

/// Every sample of a replay has the bits of the render's. Returns how many of them were not black.
uint32_t check_bits(const Scene& scene, const RenderSettings& settings, uint32_t sample, uint32_t step) {
    const FilmMoments film = one_sample(scene, settings, sample);
    SharedAccels accels(scene);
    const std::unique_ptr<Replay> replay = make_replay(scene, settings, accels);
    uint32_t lit = 0;
    for (const uint32_t pixel : pixels_of(film, step)) {
        const ReplaySample r = replay->sample({pixel % film.width, pixel / film.width, sample, {}, true, true});
        CAPTURE(pixel, r.total[0], r.total[1], r.total[2], film.sum[pixel * 3], r.eye_sum.x, r.splat_sum[0]);
        CHECK(r.complete);
        bool equal = true;
        for (int c = 0; c < 3; ++c) equal = equal && r.total[c] == film.sum[pixel * 3 + uint32_t(c)];
        CHECK(equal);
        lit += r.total[0] + r.total[1] + r.total[2] > 0;
    }
    return lit;
}

const Config kPaths[] = {
    {"path", "wavefront", {}},
    {"path", "wavefront", {{"estimator", "nee"}}},
    {"path", "wavefront", {{"estimator", "naive"}}},
    {"path", "wavefront", {{"heuristic", "power"}, {"rr_depth", "1"}}},
    {"path", "wavefront", {{"cull", "0.3"}}},
    {"path", "wavefront", {{"accel", "cwbvh"}}},
    {"path", "ris", {}},
};
const Config kBidirectional[] = {
    {"light", "wavefront", {}},
    {"light", "wavefront", {{"light_paths", "1.5"}}},
    {"bdpt", "wavefront", {}},
    {"bdpt", "wavefront", {{"heuristic", "power"}, {"rr_depth", "1"}, {"cull", "0.3"}}},
    {"bdpt", "wavefront", {{"strategies", "next_event+connections"}}},
    {"bdpt", "wavefront", {{"fuse", "none"}, {"specialise", "false"}}},
    {"bdpt", "lvc", {}},
    {"bdpt", "lvc", {{"connections", "1"}, {"light_paths", "2.25"}}},
    {"bdpt", "lvc", {{"wave_size", "128"}}},
    {"bdpt", "streaming", {}},
    {"bdpt", "megakernel", {}},
    {"bdpt", "megakernel", {{"heuristic", "power"}}},
};

}  // namespace

TEST_CASE("A replayed sample of the path tracer has the bits of the render's") {
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured", "furnace"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const Config& c : kPaths) {
            CAPTURE(name, text_of(c));
            CHECK(check_bits(scene, settings_of(scene, c), 5, 1) > 100);
        }
    }
}

TEST_CASE("A replayed sample of light tracing and of every variant of bdpt has the bits of the render's") {
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const Config& c : kBidirectional) {
            CAPTURE(name, text_of(c));
            check_bits(scene, settings_of(scene, c), 3, 97);
        }
    }
}

}  // namespace ambilux
