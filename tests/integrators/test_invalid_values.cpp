// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 120
// G9: what is no light is counted where it is met, by its cause, and stays out of the film, in every variant.
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

struct Variant {
    const char *integrator, *name;
};

constexpr Variant kVariants[] = {{"path", "wavefront"}, {"path", "ris"}, {"light", "wavefront"},
                                 {"bdpt", "wavefront"}, {"bdpt", "lvc"}, {"bdpt", "streaming"},
                                 {"bdpt", "megakernel"}};

RenderResult render_variant(const Scene& scene, const Variant& v) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = v.integrator;
    s.variant = v.name;
    s.max_depth = 4;
    return render_scene(scene, s, 4);
}

using Stages = std::set<std::string>;

/// What is put in, and the stages of path, light and bdpt that meet it.
struct Injection {
    const char* name;
    void (*put)(Scene& scene, float value);
    Stages path, light, bdpt;

    const Stages& expected(const Variant& v) const {
        const std::string integrator = v.integrator;
        return integrator == "path" ? path : integrator == "light" ? light : bdpt;
    }
};

void put_into_emission(Scene& scene, float value) { scene.emitters[0].radiance.value.y = value; }
void put_into_reflectance(Scene& scene, float value) {
    Textured<Diffuse> p = scene.bsdfs[0].as<Diffuse>();
    p.reflectance.value.y = value;
    scene.bsdfs[0].parameters.set(p);
}
void put_into_camera(Scene& scene, float value) { scene.sensor.to_world.m[0][3] = value; }

const Injection kInjections[] = {
    {"emission", put_into_emission, {"connect", "shade"}, {"light_generate"}, {"connect", "light_generate", "shade"}},
    {"reflectance",
     put_into_reflectance,
     {"connect", "shade"},
     {"connect_camera", "light_shade"},
     {"connect", "connect_camera", "connect_vertices", "light_shade", "shade"}},
    {"camera", put_into_camera, {"extend"}, {"extend"}, {"extend"}}};

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

}  // namespace

TEST_CASE(
    "G9: one bad number in emission, reflectance or camera is counted by each stage that meets it, in every variant") {
    for (const Variant& v : kVariants)
        for (const Injection& injection : kInjections)
            for (const float value : {kNan, kInf, -1.0f}) {
                const bool camera = std::string(injection.name) == "camera";
                if (camera && value == -1.0f) continue;  // a place like any other
                INFO(v.integrator << " " << v.name << ", " << injection.name << " " << value);
                Scene scene = project_scene("cornell", 16, 16);
                injection.put(scene, value);
                const RenderResult r = render_variant(scene, v);
                Stages counted;
                InvalidCounts sum;
                for (const auto& [stage, c] : r.stats.invalid_by_stage) {
                    if (c.total() > 0) counted.insert(stage);
                    sum.nan += c.nan, sum.inf += c.inf, sum.negative += c.negative;
                }
                CHECK(counted == injection.expected(v));
                const bool nan = std::isnan(value) || camera;  // rays are finite or not
                CHECK((sum.nan > 0) == nan);
                CHECK((sum.inf > 0) == (!nan && std::isinf(value)));
                CHECK((sum.negative > 0) == (value == -1.0f));
                for (const double x : r.film.sum) REQUIRE((std::isfinite(x) && x >= 0));
            }
}

TEST_CASE("G9: without one nothing is counted") {
    for (const Variant& v : kVariants) {
        INFO(v.integrator << " " << v.name);
        CHECK(render_variant(project_scene("cornell", 16, 16), v).stats.invalid.total() == 0);
    }
}
