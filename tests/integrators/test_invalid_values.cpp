// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 120
// G9: what is no light is counted where it is met, by its cause, and stays out of the film, in every variant.
#include <cmath>
#include <cstdio>
#include <limits>

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

}  // namespace

TEST_CASE("print") {
    const float bad[] = {std::nanf(""), std::numeric_limits<float>::infinity(), -1.0f};
    for (const Variant& v : kVariants)
        for (int what = 0; what < 4; ++what)
            for (const float value : bad) {
                Scene scene = project_scene("cornell", 16, 16);
                if (what == 0) scene.emitters[0].radiance.value.y = value;
                if (what == 1)
                    for (auto& b : scene.bsdfs)
                        if (b.type == BsdfType::diffuse) {
                            auto p = b.as<Diffuse>();
                            p.reflectance.value.y = value;
                            b.parameters.set(p);
                            break;
                        }
                if (what == 2) scene.sensor.to_world.m[0][3] = value;
                if (what == 3) scene.vertices[0].p.x = value;
                std::printf("%s %s what %d value %g:", v.integrator, v.name, what, double(value));
                try {
                    const RenderResult r = render_variant(scene, v);
                    for (const auto& [stage, c] : r.stats.invalid_by_stage)
                        if (c.total())
                            std::printf("  %s nan %d inf %d neg %d;", stage.c_str(), int(c.nan), int(c.inf),
                                        int(c.negative));
                } catch (const std::exception& e) {
                    std::printf(" threw %s", e.what());
                }
                std::printf("\n");
            }
}
