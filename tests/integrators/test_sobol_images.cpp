// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// seconds: 38
// sampler=sobol: closed forms, the means of independent numbers, less variance, bits that depend on no thread and no
// wave, and where it is refused. Errors come from seeds throughout: samples of a render depend on each other.
#include <fmt/format.h>

#include "integrators/offers.h"
#include "render/replay/replay.h"
#include "tests/support/closed_forms.h"
#include "tests/support/long_run.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

struct Method {
    const char *integrator, *variant;
    Estimator estimator = Estimator::mis;
    LightPicks picks = LightPicks::table;
};
constexpr Method kPath = {"path", "wavefront"}, kLight = {"light", "wavefront"}, kPairs = {"bdpt", "wavefront"},
                 kCache = {"bdpt", "lvc"};
constexpr Method kMethods[] = {kPath, {"path", "wavefront", Estimator::nee}, {"path", "ris"}, kPairs, kCache};

std::string name_of(const Method& m) { return fmt::format("{} {} {}", m.integrator, m.variant, int(m.estimator)); }

RenderSettings settings_of(const Scene& scene, const Method& m, Sampler sampler, uint64_t seed = 1) {
    RenderSettings s = cpu_settings(scene, m.estimator, seed);
    s.integrator = m.integrator;
    s.variant = m.variant;
    s.sampler = sampler;
    s.light_picking = m.picks;
    return s;
}

/// Images of several seeds.
std::vector<FilmMoments> images(const Scene& scene, RenderSettings s, uint32_t seeds, uint32_t spp) {
    std::vector<FilmMoments> films;
    for (uint32_t k = 0; k < seeds; ++k) {
        s.seed = 1000 * uint64_t(s.sampler) + k;
        films.push_back(render_scene(scene, s, spp).film);
    }
    return films;
}

/// Variance of a pixel over images of several seeds, mean over pixels and channels.
double variance(const std::vector<FilmMoments>& films) {
    const double n = double(films.size());
    double sum = 0;
    for (size_t i = 0; i < films[0].sum.size(); ++i) {
        double mean = 0, squares = 0;
        for (const FilmMoments& f : films) {
            mean += f.mean(i) / n;
            squares += f.mean(i) * f.mean(i);
        }
        sum += (squares - n * mean * mean) / (n - 1);
    }
    return sum / double(films[0].sum.size());
}

/// Variance of Sobol' points over that of independent numbers.
double variance_ratio(const Scene& scene, const Method& m, uint32_t seeds, uint32_t spp) {
    return variance(images(scene, settings_of(scene, m, Sampler::sobol), seeds, spp)) /
           variance(images(scene, settings_of(scene, m, Sampler::independent), seeds, spp));
}

/// Images of 16 seeds against what they should be, by a test that sees a mean that is off by `sees`.
void check_means(const Scene& scene, const Method& m, uint32_t spp, const Estimate& expected, double sees = 1e-3) {
    ZTestOptions options;
    options.block = 4;
    options.rounding = 1e-5;
    const ZTestResult z =
        z_test(to_estimate(images(scene, settings_of(scene, m, Sampler::sobol), 16, spp)), expected, options);
    INFO(scene.path << ", " << name_of(m) << ": " << z.report());
    CHECK(z.pass);
    CHECK(z.detectable < sees);
}

}  // namespace

TEST_CASE("By Sobol' points a plane under the sky has its closed form", "[path][bidirectional]") {
    constexpr Rgb kAlbedo = {0.8f, 0.5f, 0.2f};
    const Scene scene = scene_from_text(scene_xml(
        2,
        "<sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,0.1' target='0,0,0' "
        "up='0,1,0'/></transform>" +
            square_film(8) +
            "</sensor><shape type='rectangle'><transform name='to_world'><scale value='1.5'/></transform>" +
            diffuse(kAlbedo) + "</shape><emitter type='constant'><rgb name='radiance' value='1'/></emitter>"));
    for (const Method& m : first_or_all(4, std::vector<Method>(std::begin(kMethods), std::end(kMethods))))
        check_means(scene, m, m.estimator == Estimator::nee ? 256 : 1024,
                    exact_estimate(constant_image(8, 8, kAlbedo)));
}

TEST_CASE("By Sobol' points a plane under lamps has its closed form", "[path][bidirectional]") {
    constexpr uint32_t kSize = 16;
    constexpr Rgb kAlbedo = {0.5f, 0.7f, 0.3f};
    constexpr double kRadius = 0.1;
    std::string xml =
        "<sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,0.1' target='0,0,0' "
        "up='0,1,0'/></transform>" +
        square_film(kSize) +
        "</sensor><shape type='rectangle'><transform name='to_world'><scale value='1.5'/></transform>" +
        diffuse(kAlbedo) + "</shape>";
    struct Lamp {
        double x, y, z, strength;  // W/sr
    };
    // No lamp's shadow of another falls onto what the camera sees.
    constexpr Lamp kLamps[] = {{-0.6, 0.1, 0.8, 2}, {0.7, -0.2, 1.1, 3}, {0.1, 0.9, 1.4, 1}};
    for (const Lamp& b : kLamps)
        xml += fmt::format(
            "<shape type='sphere'><point name='center' x='{}' y='{}' z='{}'/><float name='radius' value='{}'/>"
            "<emitter type='area'><rgb name='radiance' value='{}'/></emitter></shape>",
            b.x, b.y, b.z, kRadius, b.strength / (M_PI * kRadius * kRadius));
    const Scene scene = scene_from_text(scene_xml(2, xml));
    const Image expected = image_of(kSize, kSize, kAlbedo, [&](double film_x, double film_y) {
        const double x = -1 + 2 * film_x / kSize, y = 1 - 2 * film_y / kSize;
        double sum = 0;
        for (const Lamp& b : kLamps) {
            const double d2 = (x - b.x) * (x - b.x) + (y - b.y) * (y - b.y) + b.z * b.z;
            sum += b.strength * b.z / (d2 * std::sqrt(d2)) / M_PI;
        }
        return sum;
    });
    // Most light subpaths miss the plane.
    check_means(scene, kPath, 512, exact_estimate(expected), 1.5e-3);
    // By a tree over the three as well.
    for (Method m : first_or_all<Method>(2, {kPath, kCache, kPairs})) {
        m.picks = LightPicks::tree;
        check_means(scene, m, 192, exact_estimate(expected), 5e-3);
    }
    check_means(scene, kLight, 512, exact_estimate(expected), 2e-2);
}

TEST_CASE("Sobol' points give the means of independent numbers", "[path][bidirectional]") {
    const Scene scene = project_scene("cornell", 16, 16);
    const Estimate independent = to_estimate(images(scene, settings_of(scene, kPairs, Sampler::independent), 16, 192));
    for (const Method& m : first_or_all<Method>(1, {kCache, kPairs})) check_means(scene, m, 64, independent, 1.5e-2);
}

TEST_CASE("Variance over seeds is less by Sobol' points", "[path][bidirectional]") {
    const auto check = [](const char* name, const Method& m, uint32_t spp, double most) {
        const double ratio = variance_ratio(project_scene(name, 16, 12), m, 10, spp);
        INFO(name << ", " << name_of(m) << ", " << spp << " samples: " << ratio);
        CHECK(ratio < most);
    };
    for (const Method& m : first_or_all<Method>(2, {kPath, kCache, kPairs, {"path", "ris"}}))
        check("cornell", m, 64, 0.95);
    for (const Method& m : first_or_all<Method>(1, {kPath, kCache})) check("lights", m, 64, 0.8);
    if (!is_long_run()) return;
    check("cornell", kPath, 256, 0.8);
    check("materials", kPath, 64, 0.95);
}

TEST_CASE("Light subpaths of a film are even among each other from the first sample on", "[bidirectional]") {
    const Scene scene = project_scene("cornell", 32, 32);
    for (const uint32_t spp : {1u, 16u}) {
        const double ratio = variance_ratio(scene, kLight, 24, spp);
        INFO(spp << " samples: " << ratio);
        CHECK(ratio < 0.95);
    }
}

TEST_CASE("Numbers of light subpaths leave no gaps and do not depend on waves") {
    for (const auto& [width, height] : {std::pair{16u, 24u}, {21u, 13u}})
        for (const uint32_t per_tile : {1u, 24u, 64u, 160u}) {
            const uint32_t tiles_x = (width + 7) / 8, tiles_y = (height + 7) / 8, rounds = (per_tile + 63) / 64;
            std::vector<uint32_t> met(size_t(tiles_x) * tiles_y * per_tile * 4);
            for (const auto& [first_tile, tiles, samples] :
                 {std::tuple{0u, 1u, 4u}, {1u, tiles_x * tiles_y - 1, 3u}, {1u, tiles_x * tiles_y - 1, 1u}}) {
                WaveState state{};
                state.first_tile = first_tile;
                state.first_sample = samples == 1 ? 3 : 0;
                state.samples = samples;
                Wave wave = {&state, 1, width, height, tiles_x, tiles, samples};
                for (uint32_t round = 0; round < rounds; ++round) {
                    wave.first_key = round * width * height;
                    for (uint32_t slot = 0; slot < wave.slot_count(); ++slot)
                        if (round < light_subpaths_of(slot, per_tile))
                            ++met[light_subpath_number(wave, slot, per_tile)];
                }
            }
            INFO(width << "x" << height << ", " << per_tile << " light subpaths per tile");
            CHECK(std::all_of(met.begin(), met.end(), [](uint32_t n) { return n == 1; }));
        }
}

TEST_CASE("Bits of Sobol' points depend on no thread and no wave") {
    for (const char* name : {"cornell", "lights"}) {
        const Scene scene = project_scene(name, 20, 12);
        for (const Method& m : {kPath, Method{"path", "ris"}, kPairs}) {
            INFO(name << ", " << name_of(m));
            RenderSettings s = settings_of(scene, m, Sampler::sobol);
            const RenderResult one = render_on(1, scene, s, 6);
            for (const int threads : {2, 7}) check_same_bits(render_on(threads, scene, s, 6), one);
            for (const uint32_t wave_size : {64u, 256u, 4096u}) {
                s.wave_size = wave_size;
                check_same_bits(render_on(2, scene, s, 6), one);
            }
        }
        const RenderSettings s = settings_of(scene, kCache, Sampler::sobol);
        check_same_bits(render_on(2, scene, s, 6), render_on(1, scene, s, 6));
    }
}

TEST_CASE("Ranges of samples by Sobol' points add up to the whole") {
    const Scene scene = project_scene("cornell", 24, 16);
    for (const Method& m : {kPath, kPairs, kLight}) {
        const RenderSettings s = settings_of(scene, m, Sampler::sobol);
        const FilmMoments whole = render_scene(scene, s, 9).film;
        FilmMoments parts = whole;
        std::fill(parts.sum.begin(), parts.sum.end(), 0.0);
        for (const auto& [first, count] : {std::pair{5u, 4u}, {0u, 2u}, {2u, 3u}}) {
            const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
            renderer->render(first, count);
            const FilmMoments film = renderer->film();
            for (size_t i = 0; i < film.sum.size(); ++i) parts.sum[i] += film.sum[i];
        }
        INFO(name_of(m));
        for (size_t i = 0; i < parts.sum.size(); ++i) REQUIRE(parts.sum[i] == Approx(whole.sum[i]).epsilon(1e-5));
    }
}

TEST_CASE("Kernels know of Sobol' points where they are asked for alone") {
    const Scene scene = project_scene("cornell", 16, 16);
    const auto features = [&](Sampler sampler) {
        const std::vector<std::string> f = make_renderer(scene, settings_of(scene, kPath, sampler))->stats().features;
        return std::count(f.begin(), f.end(), "sampling");
    };
    CHECK(features(Sampler::sobol) == 1);
    CHECK(features(Sampler::independent) == 0);
}

TEST_CASE("sampler=sobol is refused by name where there is none") {
    const Scene scene = project_scene("lights", 16, 16);
    const auto refused = [&](const Method& m, const SettingTexts& texts, const char* why) {
        RenderSettings s = settings_of(scene, m, Sampler::sobol);
        for (const auto& [key, value] : texts) apply_setting(s, key, value);
        INFO(m.integrator << " " << m.variant);
        CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring(why));
    };
    for (const Method& m : {Method{"bdpt", "streaming"},
                            {"bdpt", "megakernel"},
                            {"bdpt", "learned"},
                            {"vcm", "wavefront"},
                            {"vpl", "wavefront"}})
        refused(m, {}, "sampler=sobol: its kernels have independent numbers alone");
    refused(kPath, {{"precision", "double"}}, "sampler=sobol: precision=double");
    refused(kPath, {{"fuse", "none"}}, "fuse=none: there are no such kernels with sampler=sobol");
    refused(kPairs, {{"bdpt.auto", "true"}}, "sampler=sobol: its pilot");
    CHECK_THROWS_WITH(check_replay(settings_of(scene, kPath, Sampler::sobol)), ContainsSubstring("sampler=sobol"));
    RenderSettings s;
    CHECK_THROWS_WITH(apply_setting(s, "sampler", "best"), ContainsSubstring("independent"));
}
