// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 20
// Integrators that merge: closed forms, the mean of the path tracer, and that no thread, wave or budget decides a bit.
#include <cmath>

#include "integrators/bdpt/vcm/merge_keys.h"
#include "integrators/reachability.h"
#include "integrators/registry.h"
#include "tests/support/long_run.h"
#include "tests/support/merging_renders.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

/// All that merge, with the strategies that their names leave on.
const char* const kMerging[] = {"vcm", "bpm", "ppm", "sppm", "pm"};

}  // namespace

TEST_CASE("vcm: inside a glowing sphere all masks of strategies find the same radiance, whatever share merges have") {
    const Scene scene = glowing_sphere();
    for (const char* mask : {"all", "hits", "hits+next_event", "hits+light", "hits+connections+light"})
        for (const char* heuristic : first_or_all<const char*>(1, {"balance", "power"}))
            for (const char* first : {"true", "false"}) {
                RenderSettings s = vcm_settings(scene, "0.1");
                apply_setting(s, "strategies", mask);
                apply_setting(s, "heuristic", heuristic);
                apply_setting(s, "merge_first", first);
                INFO(mask << ", " << heuristic << ", merges at first vertices: " << first);
                check_glow(mean_over_seeds(scene, s, 16, 6));
            }
}

TEST_CASE("Inside a glowing sphere all that merge find the same radiance") {
    const Scene scene = glowing_sphere();
    for (const char* integrator : kMerging) {
        INFO(integrator);
        check_glow(mean_over_seeds(scene, vcm_settings(scene, "0.1", integrator), 16, 6));
    }
}

TEST_CASE(
    "All that merge find light of a point behind glass that is seen through glass, which no other strategy does") {
    const Scene scene = scene_from_text(
        "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='4'/></integrator><sensor "
        "type='perspective'><float name='fov' value='4'/><transform name='to_world'><lookat origin='0,0,2' "
        "target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='8'/><integer "
        "name='height' value='8'/></film></sensor><emitter type='point'><point name='position' x='0.5' y='0' "
        "z='1.5'/><rgb name='intensity' value='3'/></emitter><shape type='rectangle'><bsdf type='diffuse'><rgb "
        "name='reflectance' value='0.6'/></bsdf></shape><shape type='rectangle'><transform name='to_world'><scale "
        "value='2'/><translate z='1'/></transform><bsdf type='thindielectric'/></shape></scene>");
    const auto transmitted = [](double cosine) {  // of a pane of index 1.5046 with all reflections inside it
        const double ior = 1.5046, inside = std::sqrt(1 - (1 - cosine * cosine) / (ior * ior));
        const double s = (cosine - ior * inside) / (cosine + ior * inside),
                     p = (ior * cosine - inside) / (ior * cosine + inside), r = 0.5 * (s * s + p * p);
        return (1 - r) / (1 + r);
    };
    const double d2 = 0.5 * 0.5 + 1.5 * 1.5, cosine = 1.5 / std::sqrt(d2);
    const double expected = 0.6 / 3.14159265358979 * 3 * cosine / d2 * transmitted(cosine) * transmitted(1.0);
    for (const char* integrator : kMerging) {
        RenderSettings s = vcm_settings(scene, "0.02", integrator);
        apply_setting(s, "light_paths", "16");
        INFO(integrator);
        CHECK(missing_light(scene.features, s).find("Ld S E (L: ") != std::string::npos);  // which nothing finds
        const Mean m = mean_over_seeds(scene, s, 64, 8);
        CHECK(std::fabs(m.value - expected) < 4.0 * m.error + 0.005 * expected);
        CHECK(m.error < 0.05 * expected);
    }
    RenderSettings bdpt = cpu_settings(scene, Estimator::mis);
    bdpt.integrator = "bdpt";
    CHECK(mean_of(render_scene(scene, bdpt, 4).film) == 0.0);
    CHECK(missing_light(scene.features, bdpt).find("Ld S D S E (L: ") != std::string::npos);
}

TEST_CASE("All that merge have the mean of the path tracer, to within their bias") {
    for (const char* name : first_or_all<const char*>(2, {"cornell", "lights", "glass"})) {
        const Scene scene = project_scene(name, 32, 24);
        INFO(name);
        const Mean path = mean_over_seeds(scene, cpu_settings(scene, Estimator::mis), 128, 6);
        for (const char* integrator : kMerging) {
            INFO(integrator);
            RenderSettings s = vcm_settings(scene, "0.005", integrator);
            const Mean merged = mean_over_seeds(scene, s, 16, 6);
            CHECK(std::fabs(merged.value - path.value) <
                  4.0 * std::hypot(merged.error, path.error) + 0.01 * path.value);
            const RenderResult one = render_scene(scene, s, 4);
            CHECK(one.stats.invalid.total() == 0);
            for (const QueueStats& q : one.stats.queues) CHECK(q.overflow == 0);
        }
    }
}

TEST_CASE("sppm merges where the light of a beam arrives first, which next event estimation cannot sample") {
    const Scene scene = scene_from_text(
        "<scene version='3.0.0'><integrator type='path'/><sensor type='orthographic'><transform name='to_world'>"
        "<lookat origin='0,0,2' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' "
        "value='8'/><integer name='height' value='8'/></film></sensor><shape type='rectangle'><transform "
        "name='to_world'><scale value='3'/><rotate x='1' angle='180'/><translate z='3'/></transform><emitter "
        "type='directionalarea'><rgb name='radiance' value='2'/></emitter></shape><shape type='rectangle'><transform "
        "name='to_world'><scale value='2'/></transform><bsdf type='diffuse'><rgb name='reflectance' "
        "value='0.5'/></bsdf></shape></scene>");
    const Mean m = mean_over_seeds(scene, vcm_settings(scene, "0.05", "sppm"), 256, 8);
    CHECK(std::fabs(m.value - 1 / 3.14159265358979) < 4.0 * m.error);
    CHECK(m.error < 0.005);
}

TEST_CASE("What an image says of its bias follows from its settings") {
    const Scene scene = project_scene("cornell", 8, 8);
    CHECK(bias_text(vcm_settings(scene, "0.01")) ==
          "consistent, biased by a radius of 0.01 of the scene's that shrinks (merge_alpha 0.75)");
    CHECK(bias_text(vcm_settings(scene, "0.01", "pm")) == "biased by a radius of 0.01 of the scene's");
    RenderSettings stays = vcm_settings(scene, "0.01");
    apply_setting(stays, "merge_alpha", "1");
    CHECK(bias_text(stays) == "biased by a radius of 0.01 of the scene's");
    RenderSettings open = vcm_settings(scene, "0", "ppm");
    apply_setting(open, "merge_samples", "9");
    CHECK(bias_text(open) ==
          "consistent, biased by a radius of at most 0.001 of the scene's that shrinks (merge_alpha 0.75)");
    CHECK(bias_text(cpu_settings(scene, Estimator::mis)).empty());
}

TEST_CASE("All that merge: the same bits for any number of threads, size of waves and budget") {
    const Scene scene = project_scene("glass", 56, 40);
    for (const auto& [integrator, samples] : {std::pair("vcm", "1"), {"vcm", "4"}, {"bpm", "2"}, {"sppm", "2"}}) {
        RenderSettings s = vcm_settings(scene, "0.01", integrator);
        apply_setting(s, "merge_samples", samples);
        INFO(integrator << ", " << samples << " samples an iteration");
        check_bits_on_cpu(scene, s, 4, 64);
    }
}

TEST_CASE("Iterations that are done at once have one radius, and leave the same bits as one after the other") {
    for (uint32_t i = 0; i < 16; ++i) CHECK(RadiusStep::of(i).first == i);
    for (uint32_t i = 0; i < 5000; ++i) {
        const RadiusStep step = RadiusStep::of(i);
        CHECK((step.first <= i && i < step.end() && RadiusStep::of(step.end()).first == step.end()));
        CHECK(step.count <= std::max(i / 8, 1u));
    }
    const Scene scene = project_scene("cornell", 16, 16);
    for (const auto& [samples, alpha] : {std::pair("1", "0.75"), {"3", "0.75"}, {"3", "1"}}) {
        INFO("merge_samples=" << samples << " merge_alpha=" << alpha);
        RenderSettings s = vcm_settings(scene, "0.02");
        apply_setting(s, "merge_samples", samples);
        apply_setting(s, "merge_alpha", alpha);
        const RenderResult together = render_on(3, scene, s, 75);
        const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
        const uint32_t k = renderer->iteration_samples();
        for (uint32_t i = 0; i < 75; i += k) renderer->render(i, k);
        CHECK(renderer->film().sum == together.film.sum);
        CHECK(renderer->film().sum_squares == together.film.sum_squares);
    }
}

TEST_CASE("vcm: iterations are whole, a render goes on from its film alone, and impossible settings are refused") {
    const Scene scene = project_scene("cornell", 24, 24);
    RenderSettings s = vcm_settings(scene);
    apply_setting(s, "merge_samples", "4");
    check_resumes_from_film(scene, s);
    const Scene large = project_scene("cornell", 4096, 4096);
    apply_setting(s, "merge_samples", "64");
    CHECK_THROWS_WITH(make_renderer(large, s), ContainsSubstring("merge_samples=64") && ContainsSubstring("4096x4096"));
    CHECK_THROWS_WITH(make_renderer(scene, vcm_settings(scene, "1e-7")), ContainsSubstring("merge_radius=1e-07"));
    CHECK_THROWS_WITH(make_renderer(scene, vcm_settings(scene, "2")), ContainsSubstring("merge_unit=world"));
}

TEST_CASE("The radius of merges in other units is the same radius") {
    const Scene scene = project_scene("cornell", 24, 24);
    const double bounds = double(scene.view().bounds_radius);
    const FilmMoments film = render_scene(scene, vcm_settings(scene, "0.0625"), 2).film;
    RenderSettings world = vcm_settings(scene, std::to_string(float(0.0625 * bounds)).c_str());
    apply_setting(world, "merge_unit", "world");
    const FilmMoments in_world = render_scene(scene, world, 2).film;
    CHECK(mean_of(in_world) == Approx(mean_of(film)).epsilon(1e-5));
    CHECK(bias_text(world).find("units of the scene that shrinks") != std::string::npos);
    RenderSettings open = vcm_settings(scene, "0"), pixel = vcm_settings(scene, "1");
    apply_setting(pixel, "merge_unit", "pixel");
    // At 24 x 24 a pixel is larger than 0.003 of the scene, which is what an open radius has.
    CHECK(mean_of(render_scene(scene, vcm_settings(scene, "0.003"), 2).film) ==
          Approx(mean_of(render_scene(scene, open, 2).film)).epsilon(1e-6));
    CHECK(mean_of(render_scene(scene, pixel, 2).film) != mean_of(render_scene(scene, open, 2).film));
    CHECK(bias_text(pixel).find("a radius of 1 pixels") != std::string::npos);
    // An orthographic camera sees all places with pixels of one size: the largest footprint is twice that.
    const Scene parallel = scene_from_text(
        "<scene version='3.0.0'><sensor type='orthographic'><transform name='to_world'><scale value='2'/><lookat "
        "origin='0,4,0' target='0,0,0' up='0,0,1'/></transform><film type='hdrfilm'><integer name='width' value='16'/>"
        "<integer name='height' value='16'/></film></sensor><shape type='sphere'><bsdf type='diffuse'/></shape><shape "
        "type='rectangle'><transform name='to_world'><scale value='3'/><rotate x='1' angle='-90'/><translate "
        "y='-1'/></transform><bsdf type='diffuse'/></shape><emitter type='point'><point name='position' x='1' y='3' "
        "z='1'/></emitter></scene>");
    RenderSettings one = vcm_settings(parallel, "2", "bpm"), each = vcm_settings(parallel, "2", "bpm");
    apply_setting(one, "merge_unit", "pixel");
    apply_setting(each, "merge_unit", "footprint");
    CHECK(mean_of(render_scene(parallel, each, 2).film) ==
          Approx(mean_of(render_scene(parallel, one, 2).film)).epsilon(1e-5));
    CHECK(bias_text(each).find("a radius of 2 footprints of the pixel that shrinks") != std::string::npos);
}

TEST_CASE("With a radius as large as each pixel vcm has the mean of the path tracer") {
    const Scene scene = project_scene("cornell", 24, 24);
    const Mean path = mean_over_seeds(scene, cpu_settings(scene, Estimator::mis, 3), 64, 8);
    RenderSettings s = vcm_settings(scene, "0.5");
    apply_setting(s, "merge_unit", "footprint");
    const Mean merged = mean_over_seeds(scene, s, 16, 12);
    CHECK(std::fabs(merged.value / path.value - 1) < 4.0 * std::hypot(merged.error, path.error) / path.value + 0.005);
    CHECK(merged.error / path.value < 0.01);
}
