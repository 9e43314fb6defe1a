// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// A surface that is blended of two materials looks like the weighted sum of both, by the path tracer and by
// bidirectional strategies, which must agree on the material of every point.
#include "tests/support/bidirectional_images.h"
#include "tests/support/closed_forms.h"

using namespace ambilux;

namespace {

constexpr Rgb kFirst = {0.8f, 0.1f, 0.6f}, kSecond = {0.2f, 0.5f, 0.6f};

/// Closed body that radiates 1 inwards, of a blend with this weight of the second material; three segments.
Scene furnace(float weight) {
    std::string body =
        "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>";
    body += square_film(8);
    body += "</sensor><shape type='sphere'><boolean name='flip_normals' value='true'/><bsdf type='blendbsdf'>";
    body += "<float name='weight' value='" + std::to_string(weight) + "'/>";
    body += diffuse(kFirst);
    body += diffuse(kSecond);
    body += "</bsdf>";
    body += area_light({1, 1, 1});
    body += "</shape>";
    return scene_from_text(scene_xml(4, body));
}

Image expected(float weight) {
    Rgb sum;
    for (int c = 0; c < 3; ++c) {
        const float a = kFirst[c] * (1 - weight) + kSecond[c] * weight;
        sum[c] = 1 + a + a * a + a * a * a;
    }
    return constant_image(8, 8, sum);
}

}  // namespace

TEST_CASE("a furnace of a blend has the albedo of the sum, in the path tracer and bidirectionally") {
    const Scene scene = furnace(0.3f);
    CHECK(scene.features.blends);
    check_expectation(scene, cpu_settings(scene, Estimator::mis), expected(0.3f));
    check_expectation(scene, cpu_settings(scene, Estimator::naive), expected(0.3f));
    for (const char* variant : {"wavefront", "lvc"}) {
        INFO(variant);
        RenderSettings s = cpu_settings(scene, Estimator::mis);
        s.integrator = "bdpt";
        s.variant = variant;
        check_image(scene, s, expected(0.3f), 1u << 13);
    }
}
