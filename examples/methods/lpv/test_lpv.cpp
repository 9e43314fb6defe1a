// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 20
// Integrator lpv: what its grids conserve, where its images are exact and how far off they are elsewhere, and that no
// thread and wave decides a bit.
#include <algorithm>

#include "gather.h"
#include "inject.h"
#include "integrators/registry.h"
#include "propagate.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

/// Grids on the host, around the unit cube.
struct Volume {
    uint32_t cells;
    lpv::Cascades cascades{};
    std::vector<lpv::VirtualLight> lights;
    std::vector<uint32_t> keys[2], values[2];
    std::vector<lpv::Intensity> light[2], injected, total;
    std::vector<lpv::Harmonics<float>> blocking;
    lpv::State state{};
    WaveState wave_state{};
    StageRecord record{};

    Volume(uint32_t resolution, uint32_t count, std::vector<lpv::VirtualLight> some) : lights(std::move(some)) {
        cascades.count = count;
        for (uint32_t c = 0; c < count; ++c) {
            const float edge = 1.0f / float(1u << c);
            cascades.grids[c] = {splat(0.5f - 0.5f * edge), edge / float(resolution), resolution};
        }
        cells = cascades.grids[0].cells();
        injected.resize(cells), total.resize(count * cells), blocking.resize(count * cascades.grids[0].corners());
        for (int k = 0; k < 2; ++k) {
            light[k].resize(cells), keys[k].resize(pairs()), values[k].resize(pairs());
            state.light[k] = light[k].data();
            state.order.keys[k] = keys[k].data(), state.order.values[k] = values[k].data();
        }
        state.lights = lights.data(), state.injected = injected.data(), state.total = total.data(),
        state.blocking = blocking.data();
    }
    uint32_t pairs() const { return uint32_t(lights.size()) * cascades.count; }
    void sort(bool blockers) {
        Wave wave{};
        wave.state = &wave_state;
        const lpv::FindSites find = {wave, cascades, state, uint32_t(lights.size()), blockers, &record};
        std::vector<uint32_t> order(pairs());
        for (uint32_t i = 0; i < pairs(); ++i) find(order[i] = i);
        std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return keys[0][a] < keys[0][b]; });
        for (uint32_t i = 0; i < pairs(); ++i) keys[1][i] = keys[0][order[i]], values[1][i] = values[0][order[i]];
    }
    void propagate(uint32_t cascade, uint32_t steps, float occlusion) {
        for (uint32_t step = 0; step < steps; ++step)
            for (uint32_t i = 0; i < cells; ++i) lpv::Propagate{cascades, state, occlusion, cascade, step, &record}(i);
    }
    Volume& build(uint32_t steps, float occlusion) {
        sort(true);
        for (uint32_t i = 0; i < blocking.size(); ++i) lpv::Block{state, pairs(), &record}(i);
        sort(false);
        for (uint32_t c = 0; c < cascades.count; ++c) {
            for (uint32_t i = 0; i < cells; ++i) lpv::Inject{cascades, state, pairs(), c, &record}(i);
            propagate(c, steps, occlusion);
        }
        return *this;
    }
    /// Of the first `cells`.
    Rgb flux(const std::vector<lpv::Intensity>& of) const {
        Rgb sum = {0.0f, 0.0f, 0.0f};
        for (uint32_t i = 0; i < cells; ++i) sum += of[i].flux();
        return sum;
    }
    float irradiance(Vec3f p, Vec3f n) const { return lpv::irradiance(cascades, state.total, p, n).x; }
};

RenderSettings settings_of(const Scene& scene, int depth, const char* samples = "1") {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "lpv";
    s.max_depth = depth;
    for (const auto& [key, value] : {std::pair{"lpv_resolution", "16"}, {"lpv_cascades", "2"}, {"lpv_steps", "16"}})
        apply_setting(s, key, value);
    apply_setting(s, "lpv_samples", samples);
    return s;
}
double path_mean(const Scene& scene, int depth, uint32_t samples) {
    RenderSettings s = cpu_settings(scene, Estimator::nee, 3);
    s.max_depth = depth;
    return mean_of(render_scene(scene, s, samples).film);
}

}  // namespace

TEST_CASE("lpv: coefficients of the clamped cosine and solid angles of faces are those of closed forms") {
    lpv::Harmonics<float> lobe{};
    const Vec3f axis = normalize(Vec3f{1.0f, 2.0f, -2.0f});
    lobe.add_cosine(kInvPi, axis);
    CHECK(lobe.flux() == Approx(1.0).epsilon(1e-6));
    CHECK(lobe.at(axis) * kPi == Approx(0.75).epsilon(1e-6));               // 1/4 + cos/2
    CHECK(lobe.cosine_integral(axis) == Approx(7.0 / 12.0).epsilon(1e-6));  // (pi/4 + pi/3) / pi
    CHECK(lobe.cosine_integral(-axis) == Approx(-1.0 / 12.0).epsilon(1e-6));
    CHECK(lpv::kFrontAngle == Approx(4.0 * std::asin(0.1)).epsilon(1e-6));
    CHECK(6.0 * (lpv::kFrontAngle + 4.0 * lpv::kSideAngle) == Approx(4.0 * kPi).epsilon(1e-6));
}

TEST_CASE("lpv: injection conserves the flux of the iteration's lights, half a cell before their surfaces") {
    std::vector<lpv::VirtualLight> lights;
    Rgb expected = {0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < 1000; ++i) {
        const Vec4f u = random_floats({1, i, 0, Stream::eye}, 0), w = random_floats({1, i, 0, Stream::eye}, 1);
        const Vec3f p = splat(0.1f) + Vec3f{u.x, u.y, u.z} * 0.8f, n = normalize(Vec3f{w.x, w.y, w.z} - splat(0.5f));
        lights.push_back({p, n, {u.w, 1.0f, 2.0f}, i % 10 == 0 ? 0u : 1u});
        if (i % 10 != 0) expected += lights.back().flux;
    }
    Volume many(8, 2, lights);
    const Rgb sum = many.flux(many.build(0, 0.0f).total);
    for (int k = 0; k < 3; ++k) CHECK(sum[k] == Approx(expected[k]).epsilon(1e-5));
    Volume one(8, 1, {{{0.37f, 0.3f, 0.3f}, {1.0f, 0.0f, 0.0f}, splat(2.0f), 1}});  // in cell 2; before it is 3
    CHECK(one.build(0, 0.0f).total[lpv::site(8, 3, 2, 2)].flux().x == Approx(2.0).epsilon(1e-6));
}

TEST_CASE("lpv: steps conserve flux up to the border and symmetry, and irradiance falls with distance as it should") {
    constexpr uint32_t n = 17, middle = 8;
    Volume v(n, 1, {});
    const auto at = [&](uint32_t x, uint32_t y, uint32_t z) { return v.total[lpv::site(n, x, y, z)].flux().x; };
    v.injected[lpv::site(n, middle, middle, middle)].c0 = splat(lpv::kBand0);
    v.propagate(0, 9, 0.0f);  // the first one injects
    CHECK(v.flux(v.total).x == Approx(9.0).epsilon(1e-5));
    for (const uint32_t d : {1u, 3u, 5u})
        for (const float other : {at(middle - d, middle, middle), at(middle, middle + d, middle)})
            CHECK(at(middle + d, middle, middle) == Approx(other).epsilon(1e-5));
    v.light[0] = v.total;
    v.propagate(0, 9, 0.0f);
    CHECK(v.flux(v.total).x < 17.99f);  // the border takes what reaches it
    // 1 / (4 pi r^2); light that turns on its way counts again, and some has not arrived.
    for (const uint32_t r : {1u, 2u, 3u, 4u}) {
        const float cell = 1.0f / float(n), distance = float(r) * cell;
        const float e = v.irradiance({0.5f + distance + 0.5f * cell, 0.5f, 0.5f}, {-1.0f, 0.0f, 0.0f});
        INFO(r << " cells: " << e * 4.0f * kPi * sqr(distance));
        CHECK(e * 4.0f * kPi * sqr(distance) > 0.5f);
        CHECK(e * 4.0f * kPi * sqr(distance) < 2.0f);
    }
}

TEST_CASE("lpv: light of the larger grid enters the smaller one, and surfaces hold light back") {
    const auto beyond = [](uint32_t cascades, float occlusion, bool wall) {
        std::vector<lpv::VirtualLight> lights = {{{0.5f, 0.1f, 0.5f}, {0.0f, 1.0f, 0.0f}, splat(1.0f), 1}};
        for (uint32_t i = 0; wall && i < 64 * 64; ++i)  // black, between light and receiver
            lights.push_back({{(float(i % 64) + 0.5f) / 64.0f, 0.4f, (float(i / 64) + 0.5f) / 64.0f},
                              {0.0f, -1.0f, 0.0f},
                              splat(0.0f),
                              1});
        return Volume(16, cascades, lights).build(32, occlusion).irradiance({0.5f, 0.6f, 0.5f}, {0.0f, -1.0f, 0.0f});
    };
    const float open = beyond(1, 1.0f, false);
    CHECK(open > 0.0f);
    const float nested = beyond(2, 1.0f, false) / open;
    INFO(nested);
    CHECK(nested > 0.5f);
    CHECK(nested < 1.5f);
    CHECK(beyond(1, 1.0f, true) < 0.25f * open);
    CHECK(beyond(1, 0.0f, true) == beyond(1, 0.0f, false));
}

TEST_CASE("lpv: direct light is that of the path tracer, one bounce more is so within a factor, and others are none") {
    for (const char* name : {"cornell", "glass", "lights"}) {
        const Scene scene = project_scene(name, 48, 36);
        INFO(name);
        for (const int depth : {1, 2})
            CHECK(mean_of(render_scene(scene, settings_of(scene, depth), 16).film) ==
                  Approx(path_mean(scene, depth, 16)).epsilon(1e-5));
    }
    const Scene scene = project_scene("cornell", 48, 36);
    const double direct = path_mean(scene, 2, 256), bounce = path_mean(scene, 3, 256) - direct;
    const auto ratio = [&](const char* occlusion) {
        RenderSettings s = settings_of(scene, 3, "64");
        apply_setting(s, "lpv_occlusion", occlusion);
        const RenderResult lpv = render_scene(scene, s, 256);
        CHECK(lpv.stats.invalid.total() == 0);
        return (mean_of(lpv.film) - direct) / bounce;
    };
    const double held = ratio("1"), free = ratio("0");
    INFO("of the bounce: " << held << ", nothing held back: " << free);
    CHECK(held > 0.6);
    CHECK(held < 1.3);
    CHECK(free > held);
    CHECK(free < 2.5);
    CHECK(mean_of(render_scene(scene, settings_of(scene, -1, "16"), 16).film) ==
          Approx(mean_of(render_scene(scene, settings_of(scene, 3, "16"), 16).film)).epsilon(1e-9));
}

TEST_CASE("lpv: the same bits for any number of threads, size of waves and budget; a render goes on from its film") {
    const Scene scene = project_scene("glass", 56, 40);
    for (const char* samples : {"1", "4"}) check_bits_on_cpu(scene, settings_of(scene, 5, samples), 8, 64);
    check_resumes_from_film(scene, settings_of(scene, 3, "4"));
}

TEST_CASE("lpv: scenes without emitters, of glass alone, and under an environment") {
    const auto mean = [](const std::string& bsdf, const std::string& emitter) {
        const Scene scene = scene_from_text(
            "<scene version='3.0.0'><sensor type='perspective'><transform name='to_world'>"
            "<lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'>"
            "<integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>"
            "<shape type='sphere'><bsdf type='" +
            bsdf + "'/></shape>" + emitter + "</scene>");
        const RenderResult result = render_scene(scene, settings_of(scene, -1, "16"), 32);
        CHECK(result.stats.invalid.total() == 0);
        return mean_of(result.film) - (emitter.empty() ? 0.0 : path_mean(scene, 2, 64));
    };
    const std::string sky = "<emitter type='constant'><rgb name='radiance' value='1,1,1'/></emitter>";
    CHECK(mean("diffuse", "") == 0.0);
    CHECK(mean("dielectric", sky) > 0.0);          // what glass shows of the sky needs more than two segments
    CHECK(std::fabs(mean("diffuse", sky)) < 0.1);  // a ball does not light itself: what its cells leak
}

TEST_CASE("lpv: says its bias, and refuses by name what is out of range") {
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = settings_of(scene, 3);
    CHECK_THAT(bias_text(s), ContainsSubstring("biased: one diffuse bounce of light through 2 grids of 16^3 cells"));
    for (const auto& [key, value] : {std::pair{"lpv_cascades", "7"},
                                     {"lpv_resolution", "129"},
                                     {"lpv_size", "0"},
                                     {"lpv_occlusion", "1.5"},
                                     {"lpv_samples", "0"}})
        CHECK_THROWS_WITH(apply_setting(s, key, value), ContainsSubstring(key) && ContainsSubstring(value));
    apply_setting(s, "light_paths", "2");
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("light_paths=2") && ContainsSubstring("lpv_samples"));
}
