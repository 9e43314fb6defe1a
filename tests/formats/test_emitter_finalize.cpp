// libs: ambilux_formats ambilux_accel
// timeout: 120
// B10 with the tables that scene loading makes: lights of all kinds together give the sum of each alone, for uniform
// and power picking.
#include "formats/finalize.h"
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

Statistics irradiance(const SceneView& view, Vec3f p, Vec3f n, uint32_t samples, uint32_t seed) {
    Statistics stats;
    for (uint32_t i = 0; i < samples; ++i) {
        EmitterSample s;
        const bool lit = sample_emitter_direct<kAllFeatures>(view, p, random(seed, i), s);
        stats.add(lit ? double(s.radiance.x) * std::max(0.0f, dot(n, s.wi)) / s.pdf_sa : 0.0);
    }
    return stats;
}

using AddLight = std::function<void(Scene&)>;

/// One light per kind; meshes come first, since primitive ids of quadrics follow those of triangles.
std::vector<AddLight> lights() {
    return {
        [](Scene& s) { add_area(s, add_rectangle(s, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 5), splat(3)); },
        [](Scene& s) { add_area(s, add_sphere(s, {0, 4, 3}, 1), splat(4)); },
        [](Scene& s) {
            add_area(s, add_quadric(s, PrimitiveType::disk, 0.8f, 0.8f, {-1, 0, -1}, {3, 0, 3}), splat(6));
        },
        [](Scene& s) { add_emitter(s, EmitterType::point, splat(30)).position = {0, 3, 4}; },
        [](Scene& s) { add_spot(s, {3, 0, 4}, {-3, 0, -4}, 30, 10, splat(40)); },
        [](Scene& s) { add_emitter(s, EmitterType::directional, splat(0.5f)).direction = {0, 0, -1}; },
    };
}

void add_sky(Scene& s, bool image) {
    if (!image) {
        add_emitter(s, EmitterType::constant, splat(0.25f));
        return;
    }
    // Black, but for a spot at the border of the image and one at a pole.
    const int w = 12, h = 7;
    std::vector<Rgb> texels(size_t(w * h), Rgb{0, 0, 0});
    texels[size_t(3 * w)] = splat(5);
    texels[4] = splat(8);
    add_envmap(s, w, h, texels, splat(0.5f), rotation_to({0.2f, 1, 0.3f}));
}

Scene finalized(const std::vector<AddLight>& add, LightPicking picking) {
    Scene s;
    for (const AddLight& f : add) f(s);
    s.bsdfs.resize(1);
    s.materials.push_back({0, 0, 0, {1, -1}});
    s.sensor.film_width = s.sensor.film_height = s.sensor.crop_width = s.sensor.crop_height = 1;
    s.sensor.to_world = affine_from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0});
    s.sensor.filter_radius = 0.5f;
    finalize_scene(s, picking);
    return s;
}

}  // namespace

TEST_CASE("B10: superposition with the loader's tables", "[emitter]") {
    const Vec3f p = {0, 0, 0}, n = {0, 0, 1};
    for (bool image : {false, true}) {
        std::vector<AddLight> all = lights();
        all.push_back([image](Scene& s) { add_sky(s, image); });
        double sum = 0, variance = 0;
        for (const AddLight& one : all) {
            const Scene alone = finalized({one}, LightPicking::power);
            CHECK(alone.emitters[0].pick_probability == 1.0f);
            const Statistics stats = irradiance(view_of(alone), p, n, 1000000, 5);
            REQUIRE(stats.mean() > 0);
            sum += stats.mean();
            variance += stats.standard_error() * stats.standard_error();
        }
        for (LightPicking picking : {LightPicking::uniform, LightPicking::power}) {
            const Scene together = finalized(all, picking);
            const Statistics stats = irradiance(view_of(together), p, n, 4000000, 6);
            const double error = std::sqrt(variance + stats.standard_error() * stats.standard_error());
            INFO("environment " << (image ? "map" : "constant") << ", picking " << uint32_t(picking) << ": "
                                << stats.mean() << " against " << sum << " +- " << error);
            CHECK(std::fabs(stats.mean() - sum) < 4.5 * error);
            CHECK(4.5 * error < 0.02 * sum);
            double total = 0;
            for (const Emitter& e : together.emitters) total += e.pick_probability;
            CHECK(total == Approx(1));
            if (picking == LightPicking::uniform)
                for (const Emitter& e : together.emitters) CHECK(e.pick_probability == Approx(1.0 / 7).epsilon(1e-5));
        }
    }
}
