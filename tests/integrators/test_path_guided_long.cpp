// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: long
// timeout: 900
// data: tagged
// Path guiding: whatever was learned, the image is that of the path tracer.
#include "integrators/offers.h"
#include "tests/support/enough_samples.h"
#include "tests/support/guided_settings.h"

using namespace ambilux;

TEST_CASE("Guided paths have the expectation of the path tracer", "[path]") {
    for (const char* name : {"cornell", "materials", "lights"}) {
        Scene scene = project_scene(name, 48, 32);
        scene.integrator.hide_emitters = true;
        const Estimate path = to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis, 11), 768).film);
        for (const SettingTexts& own : std::vector<SettingTexts>{
                 {}, {{"guide_target", "moment"}}, {{"guide_roulette", "false"}}}) {
            const Estimate image = render_until_seen(scene, guided(scene, 12, own), 512, path, 0.03);
            const ZTestResult z = z_test(image, path);
            INFO(name << ", " << (own.empty() ? "" : own[0].first) << ": " << z.report());
            CHECK(z.pass);
            CHECK(sees_bias(image, path, 0.03));
        }
    }
}

TEST_CASE("Guided paths with other estimators, shares and stages of their own agree too", "[path]") {
    Scene scene = project_scene("cornell", 32, 32);
    const Estimate path = to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis, 11), 512).film);
    for (const Estimator estimator : {Estimator::naive, Estimator::nee}) {
        RenderSettings s = guided(scene, 13, {{"guide_bsdf", "0.2"}, {"guide_filter", "false"}});
        s.estimator = estimator;
        const ZTestResult z = z_test(render_until_seen(scene, s, 4096, path, 0.06), path);
        INFO(z.report());
        CHECK(z.pass);
        s.specialise = false;
        const RenderResult fused = render_scene(scene, s, 8);
        s.fuse = Fuse::none;
        CHECK(render_scene(scene, s, 8).film.sum == fused.film.sum);
    }
}

TEST_CASE("Behind a door ajar guided paths have a third of the variance of others", "[data]") {
    const auto scene = published_scene("veach-ajar", 64, 36);
    if (!scene) return;
    const auto variance = [&](const RenderSettings& s) {
        const FilmMoments film = render_scene(*scene, s, 256).film;
        double sum = 0;
        const double n = double(film.samples);
        for (size_t i = 0; i < film.sum.size(); ++i) {
            const double mean = film.sum[i] / n;
            sum += (film.sum_squares[i] / n - mean * mean) / (mean * mean + 0.01);
        }
        return sum / double(film.sum.size());
    };
    const double plain = variance(cpu_settings(*scene, Estimator::mis, 3)), learned = variance(guided(*scene, 3));
    INFO(plain << " and " << learned);
    CHECK(learned < plain / 3);
}
