// libs: ambilux_session ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_core
// What tells errors of means by the scatter of samples knows sampler=sobol, whose samples depend on each other.
#include "session/reference.h"
#include "session/statistics.h"
#include "tests/support/catch.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

TEST_CASE("statistics and images say what tells the error of a mean") {
    const Scene scene = project_scene("cornell", 8, 8);
    for (const auto& [sampler, from] : {std::pair(Sampler::independent, "samples"), {Sampler::sobol, "seeds"}}) {
        RenderSettings s = cpu_settings(scene, Estimator::mis);
        s.sampler = sampler;
        const RenderStats stats = render_scene(scene, s, 2).stats;
        const nlohmann::json json = stats_json(scene, s, stats, 0.0);
        const Attributes attributes = image_attributes(scene, s, stats);
        CHECK(json["errors_from"] == from);
        CHECK(attributes.at("errors_from") == from);
        CHECK(json["sampler"] == setting_text(s, "sampler"));
        CHECK(attributes.at("sampler") == setting_text(s, "sampler"));
        CHECK((method_text(s).find("sampler=sobol") != std::string::npos) == (sampler == Sampler::sobol));
    }
}

TEST_CASE("a reference, which states standard errors, refuses sampler=sobol") {
    const Scene scene = project_scene("cornell", 8, 8);
    const test::TempFolder folder;
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.sampler = Sampler::sobol;
    CHECK_THROWS_WITH(make_reference(scene, reference_request(folder / "r.exr", 4, s), default_hooks()),
                      ContainsSubstring("sampler=sobol: a reference states standard errors"));
}
