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
        for (const SettingTexts& own :
             std::vector<SettingTexts>{{}, {{"guide_target", "moment"}}, {{"guide_roulette", "false"}}}) {
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

TEST_CASE("Behind a door ajar guided paths have half of the squared error of others", "[data]") {
    const auto scene = published_scene("veach-ajar", 64, 36);
    if (!scene) return;
    constexpr uint32_t kSamples = 256;
    RenderSettings lvc = cpu_settings(*scene, Estimator::mis, 5);
    lvc.integrator = "bdpt";
    lvc.variant = "lvc";
    const FilmMoments truth = render_scene(*scene, lvc, kSamples).film;
    const auto error = [&](const RenderSettings& s) {
        const FilmMoments film = render_scene(*scene, s, kSamples).film;
        const double n = double(kSamples), mean = mean_of(truth);
        double sum = 0;
        for (size_t i = 0; i < film.sum.size(); ++i) {
            const double expected = truth.sum[i] / n, difference = film.sum[i] / n - expected;
            sum += difference * difference / (expected * expected + 0.01 * mean * mean);
        }
        return sum / double(film.sum.size());
    };
    const double plain = error(cpu_settings(*scene, Estimator::mis, 3)), learned = error(guided(*scene, 3));
    INFO(plain << " and " << learned);
    CHECK(learned < plain / 2);
}
