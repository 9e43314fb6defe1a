// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Kernels are compiled for sets of features; which of them runs does not show in the image.
#include "integrators/feature_levels.h"

#include <cmath>

#include "accel/cwbvh.h"
#include "integrators/bdpt/wavefront/integrator.h"
#include "integrators/path/integrator.h"
#include "tests/support/render_scene.h"
#include "tests/support/wave_film.h"

using namespace ambilux;

TEST_CASE("a scene runs on the least level that covers it, and on the last one if none is wanted") {
    const auto level = [](const Features& needed, bool specialise = true) {
        return with_feature_level(needed, specialise, []<Features F>() { return F; });
    };
    const Features levels[] = {kDiffuseFeatures, kUntexturedFeatures, kTriangleFeatures, kMaskedFeatures,
                               kCommonFeatures,  kFlatFeatures,       kAllFeatures};
    for (const Features& own : levels) {
        INFO(&own - levels);
        CHECK(level(own) == own);
        CHECK(level(own, false) == kAllFeatures);
    }
    Features f = kDiffuseFeatures;
    f.bsdfs |= bit(BsdfType::dielectric);
    CHECK(level(f) == kUntexturedFeatures);
    f.textures = true;
    CHECK(level(f) == kTriangleFeatures);
    f.opacity = true;
    CHECK(level(f) == kMaskedFeatures);
    f.primitives |= bit(PrimitiveType::sphere);
    CHECK(level(f) == kCommonFeatures);
    f.instances = true;
    CHECK(level(f) == kAllFeatures);
    CHECK(level(Features{}) == kDiffuseFeatures);
}

namespace {

template <template <Features, class, Fusion> class Of>
void check_culled(const char* integrator) {
    INFO(integrator);
    const Scene scene = project_scene("cornell", 16, 16);
    REQUIRE(kDiffuseFeatures.covers(scene.features));
    const CwbvhAccel accel(scene);
    RenderSettings s;
    s.integrator = integrator;
    s.max_depth = 4;
    const auto film = [&]<Features F>() {
        using Integrator = Of<F, CwbvhTracer, Fusion{.weigh = true, .connect = true}>;
        return wave_film<Integrator>(scene, accel.tracer(), Integrator::plan(scene, s), 5, 0);
    };
    const std::vector<double> whole = film.template operator()<kAllFeatures>();
    s.cull = 0.5f;
    const std::vector<double> few = film.template operator()<kDiffuseFeatures>(),
                              all = film.template operator()<kAllFeatures>();
    size_t other = 0, culled = 0;
    for (size_t i = 0; i < all.size(); ++i) {
        other += std::fabs(few[i] - all[i]) > 1e-3 * std::fabs(all[i]);
        culled += std::fabs(whole[i] - all[i]) > 1e-3 * std::fabs(all[i]);
    }
    CHECK(culled > all.size() / 10);
    CHECK(other < all.size() / 50);  // copies of a function are rounded differently
}

template <Features F, class Tracer, Fusion K>
using Path = PathIntegrator<F, Tracer, K>;

}  // namespace

TEST_CASE("light is culled by the same random numbers at every level") {
    check_culled<Path>("path");
    check_culled<WavefrontIntegrator>("bdpt");
}
