// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Ambient occlusion against what is known: an open plane, a closed box, a plane under a disk.
#include <cmath>

#include "accel/embree_tracer.h"
#include "core/sampling.h"
#include "film/ztest.h"
#include "tests/support/injected_bias.h"
#include "tests/support/render_scene.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/start.h"
#include "transport/subpath/trace.h"

using namespace ambilux;

namespace {

const char* const kDown =
    "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='30'/><transform name='to_world'>"
    "<lookat origin='0,0,0.5' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' "
    "value='16'/><integer name='height' value='16'/><rfilter type='box'/></film></sensor>"
    "<emitter type='constant'/><shape type='rectangle'><transform name='to_world'><scale value='1000'/></transform>"
    "</shape>";

RenderSettings toy_settings(const Scene& scene, const char* radius = "0") {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = "toy";
    apply_setting(s, "radius", radius);
    return s;
}

void check_constant(const Scene& scene, const RenderSettings& settings, double value) {
    const RenderResult r = render_scene(scene, settings, 16);
    CHECK(r.stats.invalid.total() == 0);
    for (const double sum : r.film.sum) CHECK(sum == 16 * value);
}

}  // namespace

TEST_CASE("an open plane sees all of the sky, the inside of a box none of it") {
    const Scene plane = scene_from_text(std::string(kDown) + "</scene>");
    check_constant(plane, toy_settings(plane), 1);
    const Scene box = scene_from_text(std::string(kDown) +
                                      "<shape type='cube'><transform name='to_world'><scale value='3'/>"
                                      "</transform></shape></scene>");
    check_constant(box, toy_settings(box), 0);
    // Nothing lies within a tenth of the floor where the camera looks.
    check_constant(box, toy_settings(box, "0.1"), 1);
    RenderSettings staged = toy_settings(box);
    staged.fuse = Fuse::none;
    check_constant(box, staged, 0);
}

TEST_CASE("a disk above a plane hides its form factor from the point below") {
    // A disk of radius r at height h covers r² / (r² + h²) of the cosine-weighted sky. The film is a small spot below
    // it.
    const Scene scene = scene_from_text(
        "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='1'/><transform name='to_world'>"
        "<lookat origin='0,0,0.5' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' "
        "value='16'/><integer name='height' value='16'/><rfilter type='box'/></film></sensor><emitter type='constant'/>"
        "<shape type='rectangle'><transform name='to_world'><scale value='1000'/></transform></shape>"
        "<shape type='disk'><transform name='to_world'><scale value='2'/><translate z='1'/></transform></shape>"
        "</scene>");
    const RenderResult r = render_scene(scene, toy_settings(scene), 1024);
    const Estimate image = to_estimate(r.film), truth = exact_estimate({16, 16, std::vector<float>(16 * 16 * 3, 0.2f)});
    const ZTestResult z = z_test(image, truth);
    INFO(z.report());
    CHECK(z.pass);
    CHECK(z.detectable < 0.05);
    CHECK(sees_bias(image, truth, 0.05));
}

TEST_CASE("a plain loop finds what the stages find, under surfaces that let some rays pass too") {
    const Scene scene = scene_from_text(
        std::string(kDown) +
        "<shape type='disk'><transform name='to_world'><scale value='0.15'/><translate z='0.08'/></transform><bsdf "
        "type='mask'><float name='opacity' value='0.4'/><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></bsdf>"
        "</shape><shape type='sphere'><point name='center' x='0.1' y='0' z='0.05'/><float name='radius' value='0.05'/>"
        "</shape></scene>");
    constexpr uint32_t kSamples = 4, kSide = 16;
    RenderSettings settings = toy_settings(scene, "0.18");
    settings.specialise = false;
    const FilmMoments film = render_scene(scene, settings, kSamples).film;
    const SceneView view = scene.view();
    const EmbreeAccel accel(scene);
    const EmbreeTracer tracer = accel.tracer();
    uint32_t different = 0, blocked = 0, seen = 0;
    for (uint32_t pixel = 0; pixel < kSide * kSide; ++pixel) {
        uint32_t sum = 0;
        for (uint32_t s = 0; s < kSamples; ++s) {
            const RandomNumbers numbers = {{settings.seed, pixel, s, Stream::eye}};
            float tmax;
            const auto path =
                start_eye_subpath<kAllFeatures>(view, UnidirectionalMis{}, pixel % kSide, pixel / kSide, numbers, tmax);
            const Hit hit = end_of_ray<kAllFeatures>(view, tracer, path, tmax, numbers);
            if (hit.prim == kNone) continue;
            const SurfacePoint p = surface_at<kAllFeatures>(view, hit.prim, hit.u, hit.v);
            const Vec3f n = dot(p.ng, path.direction) > 0.0f ? -p.ng : p.ng;
            const Vec4f u = numbers.scatter(Side::eye, 1);
            const Vec3f d = frame_from_normal(n).to_world(square_to_cosine_hemisphere({u.x, u.y}));
            const Vec3f o = offset_ray_origin(p.p, ray_offset(p.p, p.p_error, p.ng), p.ng, d);
            const bool open = !tracer.occluded<kAllFeatures>(view, Ray{o, 0.18f, d, numbers.shadow_seed(1)});
            sum += open;
            ++(open ? seen : blocked);
        }
        for (uint32_t c = 0; c < 3; ++c) different += film.sum[3 * pixel + c] != sum;
    }
    CHECK(seen > 100);
    CHECK(blocked > 100);
    CHECK(different <= 6);  // copies of a function are rounded differently
}

TEST_CASE("every tile of a wave is seen, and stages count at their depths, wave after wave") {
    const Scene scene = project_scene("cornell", 512, 512);  // waves of several tiles also on many threads
    RenderSettings s = toy_settings(scene);
    s.fuse = Fuse::none;
    const RenderStats stats = render_scene(scene, s, 1).stats;
    CHECK(stats.wave_paths > 64);
    for (const StageStats& stage : stats.stages) {
        INFO(stage.name);
        const uint64_t depth = stage.name == "generate" || stage.name == "update_film" ? 0 : 1;
        CHECK(stage.items_by_depth.at(depth) == stage.items);
        if (stage.name == "generate" || stage.name == "extend") CHECK(stage.items == 512 * 512);
    }
}

TEST_CASE("toy refuses what it has not") {
    const Scene scene = project_scene("cornell", 16, 16);
    for (const auto& [key, value] :
         {std::pair{"estimator", "nee"}, {"heuristic", "power"}, {"connections", "2"}, {"candidates", "4"}}) {
        RenderSettings s = toy_settings(scene);
        apply_setting(s, key, value);
        CHECK_THROWS_WITH(make_renderer(scene, s), StartsWith(key) && ContainsSubstring("integrator toy"));
    }
}
