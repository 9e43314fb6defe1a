// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// long: tagged
// seconds: 45
// bdpt.auto=true is unbiased whatever it chooses: over emitters of every type and bodies of glass and metal, each
// candidate that the selection may take has the image of all strategies.
#include "render/selection.h"
#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

struct Lamp {
    const char* name;
    std::string xml;
};

/// Over a floor at z = 0, and a ball of radius 0.4 at (0,0,0.6) between.
std::vector<Lamp> lamps() {
    const std::string color = rgb("intensity", {3, 4, 2});
    const std::string sphere =
        "<shape type='sphere'><point name='center' x='0' y='0' z='2'/><float name='radius' "
        "value='0.3'/>" +
        diffuse({0.3f, 0.3f, 0.3f}) + area_light({8, 6, 9}) + "</shape>";
    return {
        {"area", sphere},
        {"point", "<emitter type='point'><point name='position' x='0.1' y='0' z='2'/>" + color + "</emitter>"},
        {"spot", "<emitter type='spot'><float name='cutoff_angle' value='30'/>" + color +
                     lookat("origin='0,0,2.2' target='0.1,0,0' up='0,1,0'") + "</emitter>"},
        {"directional", "<emitter type='directional'><vector name='direction' x='0.2' y='0.1' z='-1'/>" +
                            rgb("irradiance", {1, 2, 1}) + "</emitter>"},
        {"constant", "<emitter type='constant'>" + rgb("radiance", {0.5f, 0.4f, 0.6f}) + "</emitter>"},
        {"envmap", "<emitter type='envmap'><string name='filename' value='" AMBILUX_SOURCE_DIR
                   "/scenes/assets/sky.exr'/></emitter>"},
    };
}

Scene scene_of(const Lamp& lamp, const std::string& bsdf) {
    return scene_from_text(scene_xml(
        6, "<sensor type='perspective'><float name='fov' value='45'/>" +
               lookat("origin='0,-3,2' target='0,0,0.3' up='0,0,1'") + film(8) + "</sensor>" + kPlane +
               "<shape type='sphere'><point name='center' x='0' y='0' z='0.6'/><float name='radius' value='0.4'/>" +
               bsdf + "</shape>" + lamp.xml));
}

/// `types_of(k)`: types of BSDFs beside emitter k.
template <class TypesOf>
void check_candidates(TypesOf types_of, int lost_at_least) {
    constexpr uint32_t kSamples = 1u << 11;
    ZTestOptions options;
    options.block = 8;  // caustics are too rare in a pixel
    uint64_t seed = 1;
    int excluded = 0, lost = 0;
    const std::vector<Lamp> all_lamps = lamps();
    for (size_t k = 0; k < all_lamps.size(); ++k)
        for (const char* type : types_of(k)) {
            const Lamp& lamp = all_lamps[k];
            const Scene scene = scene_of(lamp, std::string("<bsdf type='") + type + "'/>");
            RenderSettings automatic = cpu_settings(scene, Estimator::mis, seed++);
            automatic.integrator = "bdpt";
            RenderSettings all = automatic;
            automatic.automatic = automatic.deterministic = true;
            const Estimate truth = render_batches(scene, all, 4 * kSamples);
            const SelectionStats selection = make_renderer(scene, automatic)->stats().selection;
            const std::vector<SelectionCandidate> candidates = selection_candidates(automatic, false);
            REQUIRE(candidates.size() == selection.candidates.size());
            for (size_t c = 0; c < candidates.size(); ++c) {
                INFO(lamp.name << ", " << type << ": " << candidates[c].name);
                RenderSettings s = automatic;
                s.automatic = false;
                s.seed = 100 + seed++;
                for (const auto& [key, value] : candidates[c].settings) apply_setting(s, key, value);
                if (selection.candidates[c].excluded.empty()) {
                    check_agreement(scene, s, kSamples, truth, 0.15, options);
                } else {
                    ++excluded;
                    lost += !z_test(render_batches(scene, s, kSamples / 2), truth, options).pass;
                }
            }
        }
    // Point, spot and directional light through glass or off metal: an eye subpath alone finds none of it.
    INFO(excluded << " excluded, of which " << lost << " visibly lose light");
    CHECK(lost >= lost_at_least);
}

}  // namespace

TEST_CASE("each candidate that bdpt.auto may choose finds all light, for every emitter with glass or with metal",
          "[bidirectional]") {
    check_candidates([](size_t k) { return std::vector{k % 2 ? "conductor" : "dielectric"}; }, 3);
}

TEST_CASE("each candidate that bdpt.auto may choose finds all light, for every emitter with glass and with metal",
          "[bidirectional][long]") {
    check_candidates([](size_t) { return std::vector{"dielectric", "conductor"}; }, 6);
}
