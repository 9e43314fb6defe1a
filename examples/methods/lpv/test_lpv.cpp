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
    std::vector<lpv::Intensity> flow[2], total;
    std::vector<lpv::Harmonics<float>> blocking;
    lpv::State state{};
    WaveState wave_state{};
    StageRecord record{};

    Volume(uint32_t resolution, uint32_t count) {
        cascades.count = count;
        for (uint32_t c = 0; c < count; ++c) {
            const float edge = 1.0f / float(1u << c);
            cascades.grids[c] = {splat(0.5f - 0.5f * edge), edge / float(resolution), resolution};
        }
        cells = cascades.grids[0].cells();
        for (auto& f : flow) f.resize(cells);
        total.resize(count * cells);
        blocking.resize(count * cascades.grids[0].corners());
        state.flow[0] = flow[0].data(), state.flow[1] = flow[1].data();
        state.total = total.data(), state.blocking = blocking.data();
    }
    uint32_t pairs() const { return uint32_t(lights.size()) * cascades.count; }
    void sort(bool blockers) {
        for (int k = 0; k < 2; ++k) {
            keys[k].resize(pairs()), values[k].resize(pairs());
            state.order.keys[k] = keys[k].data(), state.order.values[k] = values[k].data();
        }
        state.lights = lights.data();
        Wave wave{};
        wave.state = &wave_state;
        const lpv::FindSites find = {wave, cascades, state, uint32_t(lights.size()), blockers, &record};
        std::vector<uint32_t> order(pairs());
        for (uint32_t i = 0; i < pairs(); ++i) find(order[i] = i);
        std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return keys[0][a] < keys[0][b]; });
        for (uint32_t i = 0; i < pairs(); ++i) keys[1][i] = keys[0][order[i]], values[1][i] = values[0][order[i]];
    }
    void block() {
        sort(true);
        for (uint32_t i = 0; i < blocking.size(); ++i) lpv::Block{state, pairs(), &record}(i);
    }
    void inject(uint32_t cascade) {
        sort(false);
        for (uint32_t i = 0; i < cells; ++i) lpv::Inject{state, pairs(), cells, cascade, &record}(i);
    }
    void propagate(uint32_t cascade, uint32_t steps, float occlusion = 0.0f) {
        for (uint32_t step = 0; step < steps; ++step)
            for (uint32_t i = 0; i < cells; ++i) lpv::Propagate{cascades, state, occlusion, cascade, step, &record}(i);
    }
    float flux(const lpv::Intensity* from) const {
        double sum = 0.0;
        for (uint32_t i = 0; i < cells; ++i) sum += from[i].flux().x;
        return float(sum);
    }
    float irradiance(Vec3f p, Vec3f n) const { return lpv::irradiance(cascades, state.total, p, n).x; }
};

RenderSettings settings_of(const Scene& scene, int depth = 3, const char* steps = "24") {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "lpv";
    s.max_depth = depth;
    apply_setting(s, "lpv_resolution", "16");
    apply_setting(s, "lpv_cascades", "2");
    apply_setting(s, "lpv_steps", steps);
    return s;
}
RenderSettings path_of(const Scene& scene, int depth) {
    RenderSettings s = cpu_settings(scene, Estimator::nee, 3);
    s.max_depth = depth;
    return s;
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

TEST_CASE("lpv: injection conserves flux, in the cell before the surface, and leaves out other iterations") {
    Volume v(8, 2);
    for (uint32_t i = 0; i < 1000; ++i) {
        const Vec4f u = random_floats({1, i, 0, Stream::eye}, 0), w = random_floats({1, i, 0, Stream::eye}, 1);
        const Vec3f p = splat(0.1f) + Vec3f{u.x, u.y, u.z} * 0.8f, n = normalize(Vec3f{w.x, w.y, w.z} - splat(0.5f));
        v.lights.push_back({p, n, {u.w, 1.0f, 2.0f}, i % 10 == 0 ? 0u : 1u});
    }
    v.inject(0);
    Rgb expected = {}, sum = {};
    for (const lpv::VirtualLight& l : v.lights)
        if (l.iteration == 1) expected += l.flux;
    for (uint32_t i = 0; i < v.cells; ++i) sum += v.total[i].flux();
    for (int k = 0; k < 3; ++k) CHECK(sum[k] == Approx(expected[k]).epsilon(1e-5));
    v.lights = {{{0.37f, 0.3f, 0.3f}, {1.0f, 0.0f, 0.0f}, splat(2.0f), 1}};  // in cell 2, half a cell before it 3
    v.inject(0);
    CHECK(v.total[lpv::site(8, 3, 2, 2)].flux().x == Approx(2.0).epsilon(1e-6));
}

TEST_CASE("lpv: steps conserve flux up to the border and keep symmetries; distance lowers irradiance as it should") {
    constexpr uint32_t n = 17, middle = 8;
    Volume v(n, 1);
    const auto at = [&](uint32_t x, uint32_t y, uint32_t z) { return v.total[lpv::site(n, x, y, z)].flux().x; };
    v.flow[0][lpv::site(n, middle, middle, middle)].c0 = splat(lpv::kBand0);
    v.propagate(0, 8);
    CHECK(v.flux(v.state.flow[0]) == Approx(1.0).epsilon(1e-5));
    CHECK(v.flux(v.state.total) == Approx(8.0).epsilon(1e-5));
    for (const uint32_t d : {1u, 3u, 5u}) {
        CHECK(at(middle + d, middle, middle) == Approx(at(middle - d, middle, middle)).epsilon(1e-5));
        CHECK(at(middle + d, middle, middle) == Approx(at(middle, middle, middle + d)).epsilon(1e-5));
    }
    v.propagate(0, 9);  // the border takes what reaches it
    CHECK(v.flux(v.state.flow[1]) < 0.999f);
    // Once all of it has left, about 1 / (4 pi r^2); what turns on its way back counts again, up to twice.
    Volume w(n, 1);
    w.flow[0][lpv::site(n, middle, middle, middle)].c0 = splat(lpv::kBand0);
    w.propagate(0, 200);
    for (const float r : {2.0f, 3.0f, 5.0f}) {
        const float distance = r / float(n), cell = 0.5f / float(n);  // it is looked up half a cell before the surface
        const float e = w.irradiance({0.5f + distance + cell, 0.5f, 0.5f}, {-1.0f, 0.0f, 0.0f});
        const float ratio = e * 4.0f * kPi * sqr(distance);
        INFO(r << " cells: " << ratio);
        CHECK(ratio > 0.5f);
        CHECK(ratio < 2.5f);
    }
}

TEST_CASE("lpv: light of the larger grid enters the smaller one, and surfaces hold light back") {
    const auto below = [](uint32_t cascades, float occlusion, bool wall) {
        Volume v(16, cascades);
        v.lights = {{{0.5f, 0.1f, 0.5f}, {0.0f, 1.0f, 0.0f}, splat(1.0f), 1}};
        for (uint32_t i = 0; wall && i < 64 * 64; ++i)
            v.lights.push_back({{(float(i % 64) + 0.5f) / 64.0f, 0.4f, (float(i / 64) + 0.5f) / 64.0f},
                                {0.0f, -1.0f, 0.0f},
                                splat(0.0f),
                                1});
        v.block();
        for (uint32_t c = 0; c < cascades; ++c) v.inject(c), v.propagate(c, 64, occlusion);
        return v.irradiance({0.5f, 0.6f, 0.5f}, {0.0f, -1.0f, 0.0f});
    };
    const float open = below(1, 1.0f, false);
    CHECK(open > 0.0f);
    const float nested = below(2, 1.0f, false) / open, held = below(1, 1.0f, true) / open;
    INFO(nested << " " << held);
    CHECK(nested > 0.6f);
    CHECK(nested < 1.5f);
    CHECK(held < 0.5f);
    CHECK(below(1, 0.0f, true) == Approx(open).epsilon(1e-5));
}

TEST_CASE("lpv: direct light is that of the path tracer, one bounce more is so within a factor") {
    for (const char* name : {"cornell", "glass", "lights"}) {
        const Scene scene = project_scene(name, 48, 36);
        INFO(name);
        for (const int depth : {1, 2})
            CHECK(mean_of(render_scene(scene, settings_of(scene, depth), 16).film) ==
                  Approx(mean_of(render_scene(scene, path_of(scene, depth), 16).film)).epsilon(1e-5));
    }
    const Scene scene = project_scene("cornell", 48, 36);
    const double direct = mean_of(render_scene(scene, path_of(scene, 2), 256).film),
                 bounce = mean_of(render_scene(scene, path_of(scene, 3), 256).film) - direct;
    const RenderResult lpv = render_scene(scene, settings_of(scene), 64);
    const double ratio = (mean_of(lpv.film) - direct) / bounce;
    INFO("bounce: " << ratio << " of the path tracer's");
    CHECK(ratio > 0.4);
    CHECK(ratio < 1.5);
    CHECK(lpv.stats.invalid.total() == 0);
    CHECK(mean_of(render_scene(scene, settings_of(scene, -1), 64).film) == Approx(mean_of(lpv.film)).epsilon(1e-9));
}

TEST_CASE("lpv: the same bits for any number of threads, size of waves and budget") {
    const Scene scene = project_scene("glass", 56, 40);
    for (const char* samples : {"1", "4"}) {
        RenderSettings s = settings_of(scene, 5, "6");
        apply_setting(s, "lpv_samples", samples);
        INFO(samples << " samples an iteration");
        check_bits_on_cpu(scene, s, 8, 64);
    }
}

TEST_CASE("lpv: iterations are whole, and a render goes on from its film alone") {
    const Scene scene = project_scene("cornell", 24, 24);
    RenderSettings s = settings_of(scene);
    apply_setting(s, "lpv_samples", "4");
    check_resumes_from_film(scene, s);
}

TEST_CASE("lpv: scenes without emitters, of glass alone, under an environment") {
    const auto scene = [](const std::string& bsdf, const std::string& emitter) {
        return scene_from_text(
            "<scene version='3.0.0'><sensor type='perspective'><transform name='to_world'>"
            "<lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'>"
            "<integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>"
            "<shape type='sphere'><bsdf type='" +
            bsdf + "'/></shape>" + emitter + "</scene>");
    };
    const std::string sky = "<emitter type='constant'><rgb name='radiance' value='1,1,1'/></emitter>";
    const auto mean = [](const Scene& scene) {
        const RenderResult result = render_scene(scene, settings_of(scene, -1), 16);
        CHECK(result.stats.invalid.total() == 0);
        return mean_of(result.film);
    };
    CHECK(mean(scene("diffuse", "")) == 0.0);
    CHECK(mean(scene("dielectric", sky)) == Approx(1.0).epsilon(0.01));
    const Scene ball = scene("diffuse", sky);
    CHECK(mean(ball) == Approx(mean_of(render_scene(ball, path_of(ball, 2), 64).film)).epsilon(0.1));
}

TEST_CASE("lpv: says its bias, and refuses what is out of range by name") {
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = settings_of(scene);
    CHECK_THAT(bias_text(s),
               ContainsSubstring("biased: one diffuse bounce of light through 2 grids of 16^3 cells, in 24 steps"));
    for (const auto& [key, value] : {std::pair{"lpv_cascades", "7"},
                                     {"lpv_resolution", "129"},
                                     {"lpv_size", "0"},
                                     {"lpv_occlusion", "1.5"},
                                     {"lpv_samples", "0"}})
        CHECK_THROWS_WITH(apply_setting(s, key, value), ContainsSubstring(key) && ContainsSubstring(value));
    apply_setting(s, "light_paths", "2");
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("light_paths=2") && ContainsSubstring("lpv_samples"));
}
