// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Resampled next event estimation has the expectation of the path tracer, whatever the number of candidates, and less
// variance where many lights differ in what they bring.
#include <fmt/format.h>

#include "tests/support/enough_samples.h"

using namespace ambilux;

namespace {

RenderSettings ris_settings(const Scene& scene, const char* candidates, uint64_t seed) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.variant = "ris";
    apply_setting(s, "candidates", candidates);
    return s;
}

/// A floor under 400 square lamps of unequal size and radiance, half of them behind a wall.
std::string many_lights() {
    std::string xml =
        "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>"
        "<sensor type='perspective'><float name='fov' value='60'/><transform name='to_world'><lookat origin='0,9,4' "
        "target='0,4,0' up='0,0,1'/></transform><film type='hdrfilm'><integer name='width' value='32'/>"
        "<integer name='height' value='24'/><rfilter type='box'/></film></sensor>"
        "<shape type='rectangle'><transform name='to_world'><scale value='20'/></transform></shape>"
        "<shape type='rectangle'><transform name='to_world'><scale value='20'/><rotate x='1' angle='90'/>"
        "<translate y='-1'/></transform></shape>";
    for (int i = 0; i < 400; ++i) {
        const double x = -9.5 + i % 20, row = i / 20, y = row < 10 ? row : -3.0 - (row - 10);
        const int k = i * 37 % 101;
        xml += fmt::format(
            "<shape type='rectangle'><transform name='to_world'><scale value='{}'/><rotate x='1' angle='180'/>"
            "<translate x='{}' y='{}' z='{}'/></transform><emitter type='area'><rgb name='radiance' value='{}'/>"
            "</emitter></shape>",
            0.03 + 0.05 * (k % 7) / 7.0, x, y, 1.5 + 0.8 * (k % 5) / 5.0, 2.0 + k);
    }
    return xml + "</scene>";
}

/// Variance of one sample over the squared mean plus 0.01 of the image's, mean over pixels and channels.
double relative_variance(const FilmMoments& m) {
    const double n = double(m.samples);
    double mean_all = 0, sum = 0;
    for (const double s : m.sum) mean_all += s / n / double(m.sum.size());
    for (size_t i = 0; i < m.sum.size(); ++i) {
        const double mean = m.sum[i] / n, variance = (m.sum_squares[i] / n - mean * mean) * n / (n - 1);
        sum += variance / (mean * mean + 0.01 * mean_all * mean_all);
    }
    return sum / double(m.sum.size());
}

}  // namespace

TEST_CASE("ris agrees with the path tracer for any number of candidates", "[path]") {
    for (const char* name : {"cornell", "lights", "materials"}) {
        Scene scene = project_scene(name, 48, 32);
        scene.integrator.hide_emitters = true;
        const uint32_t spp = 768;
        const Estimate path = to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis, 11), spp).film);
        for (const char* candidates : {"1", "4", "16"}) {
            const Estimate image = render_until_seen(scene, ris_settings(scene, candidates, 12), spp, path, 0.03);
            const ZTestResult z = z_test(image, path);
            INFO(name << ", " << candidates << " candidates: " << z.report());
            CHECK(z.pass);
            CHECK(z.detectable < 0.03);
            CHECK(sees_bias(image, path, 0.03));
        }
    }
}

TEST_CASE("ris with every estimator and as stages of its own agrees too", "[path]") {
    Scene scene = project_scene("lights", 48, 32);
    scene.integrator.hide_emitters = true;
    const Estimate path = to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis, 11), 512).film);
    RenderSettings s = ris_settings(scene, "4", 13);
    s.estimator = Estimator::nee;
    const ZTestResult z = z_test(to_estimate(render_scene(scene, s, 512).film), path);
    INFO(z.report());
    CHECK(z.pass);
    const RenderResult fused = render_scene(scene, s, 8);
    s.fuse = Fuse::none;
    CHECK(render_scene(scene, s, 8).film.sum == fused.film.sum);
}

TEST_CASE("with many lights, choosing one of eight candidates halves the variance of a sample at least", "[path]") {
    const Scene scene = scene_from_text(many_lights());
    REQUIRE(scene.emitters.size() == 400);
    const FilmMoments one = render_scene(scene, ris_settings(scene, "1", 1), 512).film;
    const FilmMoments eight = render_scene(scene, ris_settings(scene, "8", 2), 512).film;
    const FilmMoments path = render_scene(scene, cpu_settings(scene, Estimator::mis, 3), 512).film;
    const double v1 = relative_variance(one), v8 = relative_variance(eight), v = relative_variance(path);
    INFO("variance of a sample: " << v << " path, " << v1 << " one candidate, " << v8 << " eight");
    CHECK(v8 < 0.5 * v1);
    CHECK(v1 == Approx(v).epsilon(0.2));
    const ZTestResult z = z_test(to_estimate(eight), to_estimate(path));
    INFO(z.report());
    CHECK(z.pass);
}

TEST_CASE("candidates is a setting of path ris alone") {
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = ris_settings(scene, "5", 1);
    CHECK(setting_text(s, "candidates") == "5");
    for (const char* value : {"0", "65", "many"})
        CHECK_THROWS_WITH(apply_setting(s, "candidates", value),
                          ContainsSubstring("candidates=") && ContainsSubstring("from 1 to 64"));
    s.variant = "wavefront";
    CHECK_THROWS_WITH(make_renderer(scene, s), StartsWith("candidates=5") && ContainsSubstring("path ris"));
}
