// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 30
// Integrator vpl: closed forms, the mean of others on what it finds, the sign of its bias, and that no thread, wave or
// budget decides a bit.
#include <cmath>

#include "integrators/reachability.h"
#include "integrators/registry.h"
#include "tests/support/injected_bias.h"
#include "tests/support/long_run.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

using Texts = std::vector<std::pair<const char*, const char*>>;

/// Unclamped and with few light subpaths unless `own` says otherwise.
RenderSettings vpl_settings(const Scene& scene, const Texts& own = {}) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "vpl";
    apply_setting(s, "vpl_clamp", "0");
    apply_setting(s, "vpl_subpaths", "32");
    for (const auto& [key, value] : own) apply_setting(s, key, value);
    return s;
}

/// Pixels of an iteration depend on each other: variances come from parts of whole iterations.
Estimate in_parts(const Scene& scene, const RenderSettings& s, uint32_t samples, uint32_t parts = 32) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    std::vector<FilmMoments> films;
    for (uint32_t p = 0; p < parts; ++p) {
        renderer->clear_film();
        REQUIRE(renderer->render(p * samples, samples) == samples);
        films.push_back(renderer->film());
    }
    CHECK(renderer->stats().invalid.total() == 0);
    for (const QueueStats& q : renderer->stats().queues) CHECK(q.overflow == 0);
    return to_estimate(films);
}

/// Block by block, and so that an image a hundredth brighter or darker would fail.
void check_same_mean(const Estimate& image, const Estimate& truth, double sees = 0.01) {
    const ZTestOptions options;
    const ZTestResult z = z_test(image, truth, options);
    INFO(z.report());
    CHECK(z.pass);
    CHECK(sees_bias(image, truth, sees, options));
}

std::string scene_text(const std::string& sensor, const std::string& rest, int depth = -1) {
    return "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='" + std::to_string(depth) +
           "'/></integrator>" + sensor + rest + "</scene>";
}
std::string camera(const char* type, const char* lookat, const char* more, int size = 16) {
    const std::string pixels = "' value='" + std::to_string(size) + "'/>";
    return std::string("<sensor type='") + type + "'>" + more + "<transform name='to_world'><lookat " + lookat +
           "/></transform><film type='hdrfilm'><integer name='width" + pixels + "<integer name='height" + pixels +
           "<rfilter type='box'/></film></sensor>";
}
std::string diffuse(const char* reflectance) {
    return std::string("<bsdf type='diffuse'><rgb name='reflectance' value='") + reflectance + "'/></bsdf>";
}
/// Inside a sphere of radius 1 the geometry term of any two points is 1/4.
Scene inside_sphere(const std::string& glow, const std::string& rest = "") {
    return scene_from_text(scene_text(
        camera("perspective", "origin='0.2,0.1,0' target='1,0,0' up='0,1,0'", "<float name='fov' value='60'/>"),
        "<shape type='sphere'><boolean name='flip_normals' value='true'/>" + diffuse("0.5") + glow + "</shape>" +
            rest));
}
const char* const kGlow = "<emitter type='area'><rgb name='radiance' value='1'/></emitter>";
/// Half of the geometry term inside that sphere.
std::string half_of_term(const Scene& scene) {
    return std::to_string(0.125 * double(scene.bounds_radius) * double(scene.bounds_radius));
}

struct Mean {
    double value, error;
};
Mean mean_of_parts(const Scene& scene, const RenderSettings& s, uint32_t samples) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    constexpr uint32_t kParts = 16;
    double sum = 0, squares = 0;
    for (uint32_t p = 0; p < kParts; ++p) {
        renderer->clear_film();
        REQUIRE(renderer->render(p * samples, samples) == samples);
        const double m = mean_of(renderer->film());
        sum += m, squares += m * m;
    }
    const double mean = sum / kParts;
    return {mean, std::sqrt(std::max(squares / kParts - mean * mean, 0.0) / (kParts - 1))};
}
void check_mean(const Mean& m, double expected) {
    CHECK(std::fabs(m.value - expected) < 4.0 * m.error + 1e-4 * expected);
    CHECK(m.error < 0.005 * expected);
}

/// Two floors that face each other, so that no geometry term is large: `light` lies between them, where it is not seen.
Scene two_floors(const std::string& light, int depth = -1) {
    return scene_from_text(scene_text(
        camera("perspective", "origin='0,-3,0.3' target='0,0,0.4' up='0,0,1'", "<float name='fov' value='50'/>", 32),
        "<shape type='rectangle'>" + diffuse("0.7,0.6,0.4") +
            "</shape><shape type='rectangle'><transform name='to_world'><rotate x='1' angle='180'/><translate "
            "z='1'/></transform>" +
            diffuse("0.3,0.6,0.8") + "</shape>" + light,
        depth));
}
const char* const kLamp =
    "<shape type='rectangle'><transform name='to_world'><scale value='0.3'/><translate x='0.2' "
    "z='0.5'/></transform><emitter type='area'><rgb name='radiance' value='6,5,4'/></emitter></shape>";
const char* const kPoint =
    "<emitter type='point'><point name='position' x='0.3' y='0.2' z='0.5'/><rgb name='intensity' "
    "value='1,2,3'/></emitter>";
const char* const kSky = "<emitter type='constant'><rgb name='radiance' value='0.5,0.7,1'/></emitter>";

}  // namespace

TEST_CASE("vpl: inside a glowing sphere the radiance is that of all orders, and what a bound takes is what it says") {
    const Scene scene = inside_sphere(kGlow);
    const std::vector<Texts> settings = {
        {}, {{"vpl_samples", "4"}, {"vpl_subpaths", "3000"}, {"vpl_draws", "8"}}, {{"vpl_draws", "8"}}};
    for (const Texts& own : first_or_all(2, settings)) {
        INFO((own.empty() ? "as it is" : own[0].first));
        RenderSettings s = vpl_settings(scene, own);
        check_mean(mean_of_parts(scene, s, 16), 2.0);
        apply_setting(s, "vpl_clamp", half_of_term(scene));
        check_mean(mean_of_parts(scene, s, 16), 1.75);  // half of what comes by connections
    }
}

TEST_CASE("vpl: a point light in the middle of a diffuse sphere") {
    const Scene scene =
        inside_sphere("", "<emitter type='point'><rgb name='intensity' value='3.14159265358979'/></emitter>");
    check_mean(mean_of_parts(scene, vpl_settings(scene), 16), 1.0);
    check_mean(mean_of_parts(scene, vpl_settings(scene, {{"vpl_clamp", half_of_term(scene).c_str()}}), 16), 0.75);
}

TEST_CASE("vpl has the mean of the path tracer between diffuse surfaces, for all kinds of light and lengths of paths") {
    for (const auto& [light, depth] :
         {std::pair(kLamp, -1), {kPoint, -1}, {kSky, -1}, {kLamp, 2}, {kLamp, 3}, {kPoint, 4}}) {
        const Scene scene = two_floors(light, depth);
        INFO(light << ", depth " << depth);
        const Estimate path = to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis), 1024).film);
        check_same_mean(in_parts(scene, vpl_settings(scene), 8), path, 0.03);
    }
}

TEST_CASE("vpl: draws from the set have the mean of the whole set, and are all of it where they are as many") {
    const Scene scene = two_floors(kLamp);
    constexpr uint32_t kSamples = 128;
    const FilmMoments all = render_scene(scene, vpl_settings(scene), kSamples).film;
    CHECK(render_scene(scene, vpl_settings(scene, {{"vpl_draws", "60000"}}), kSamples).film.sum == all.sum);
    for (const char* draws : {"1", "5"}) {
        INFO(draws);
        const FilmMoments some = render_scene(scene, vpl_settings(scene, {{"vpl_draws", draws}}), kSamples).film;
        double sum = 0, squares = 0, light = 0;  // of the same sets: only the draws differ, pixel by pixel
        const double values = double(all.sum.size());
        for (size_t i = 0; i < all.sum.size(); ++i) {
            const double difference = some.sum[i] - all.sum[i];
            sum += difference, squares += difference * difference, light += all.sum[i];
        }
        const double error = std::sqrt(3.0 * squares);  // channels share their draws
        CHECK(std::fabs(sum) < 4.0 * error);
        CHECK(error < 0.01 * light);
        CHECK(squares > 1e-9 * light * light / values);
    }
}

TEST_CASE(
    "vpl: clamped, no pixel is brighter than without, and the image as a whole is darker than the path tracer's") {
    const Scene scene = project_scene("cornell", 32, 24);
    const double path = mean_of(render_scene(scene, cpu_settings(scene, Estimator::mis), 1024).film);
    FilmMoments above = render_scene(scene, vpl_settings(scene), 16).film;
    double mean = mean_of(above);
    for (const char* clamp : {"1000", "100", "10", "1"}) {
        INFO("vpl_clamp " << clamp);
        const FilmMoments below = render_scene(scene, vpl_settings(scene, {{"vpl_clamp", clamp}}), 16).film;
        for (size_t i = 0; i < below.sum.size(); ++i) CHECK(below.sum[i] <= above.sum[i]);
        CHECK(mean_of(below) < mean);
        mean = mean_of(above = below);
    }
    CHECK(mean < 0.97 * path);
    CHECK(mean > 0.3 * path);
}

TEST_CASE("vpl: statistics count connections whose geometry term was clamped") {
    const Scene scene = project_scene("cornell", 16, 12);
    const auto items_of = [&](const char* clamp, const std::string& stage) {
        uint64_t items = 0;
        for (const StageStats& s : render_scene(scene, vpl_settings(scene, {{"vpl_clamp", clamp}}), 4).stats.stages)
            if (s.name == stage) items += s.items;
        return items;
    };
    const char* const kClamped = "clamped_connections";
    const uint64_t connections = items_of("0", "connect_vertices");
    CHECK(items_of("0", kClamped) == 0);
    const uint64_t few = items_of("1000", kClamped), more = items_of("1", kClamped), all = items_of("1e-30", kClamped);
    CHECK(few > 0);
    CHECK(few < more);
    CHECK(more < all);
    CHECK(all < connections);
    CHECK(all > connections / 4);  // the others: ends that see each other's back
}

TEST_CASE("vpl: what it says of its bias follows from its settings") {
    const Scene scene = project_scene("cornell", 8, 8);
    CHECK(bias_text(vpl_settings(scene)).empty());
    CHECK(bias_text(vpl_settings(scene, {{"vpl_clamp", "50"}})) ==
          "biased: geometry term of connections clamped at 50 over the squared radius of the scene");
}

TEST_CASE("vpl finds light that left glass before its last two vertices") {
    // A lamp above a pane; the camera looks up at a tile, which light reaches from the floor alone.
    const std::string sensor =
        camera("orthographic", "origin='0,0,0.2' target='0,0,1' up='0,1,0'", "<float name='near_clip' value='0.01'/>");
    const std::string rest =
        "<shape type='rectangle'><transform name='to_world'><scale value='4'/></transform>" + diffuse("0.6") +
        "</shape><shape type='rectangle'><transform name='to_world'><scale value='1.5'/><rotate x='1' "
        "angle='180'/><translate z='1'/></transform>" +
        diffuse("0.5") +
        "</shape><shape type='rectangle'><transform name='to_world'><scale value='50'/><translate "
        "z='1.5'/></transform><bsdf type='thindielectric'/></shape><emitter type='point'><point name='position' x='2' "
        "y='0' z='2'/><rgb name='intensity' value='5'/></emitter>";
    const Scene scene = scene_from_text(scene_text(sensor, rest, 4));
    RenderSettings bdpt = cpu_settings(scene, Estimator::mis);
    bdpt.integrator = "bdpt";
    const double expected = mean_of(render_scene(scene, bdpt, 2048).film);
    const Mean m = mean_of_parts(
        scene, vpl_settings(scene, {{"vpl_subpaths", "2048"}, {"vpl_samples", "4"}, {"vpl_draws", "32"}}), 32);
    CHECK(std::fabs(m.value - expected) < 4.0 * m.error + 0.02 * expected);
    CHECK(m.error < 0.02 * expected);
    CHECK(mean_of(render_scene(scene, cpu_settings(scene, Estimator::mis), 4).film) == 0.0);
}

TEST_CASE("vpl: which light an image lacks is said") {
    const auto lacks = [](uint32_t bsdfs, EmitterType emitter, int depth = -1) {
        const Features f = {bsdfs, bit(emitter), 1, false, false, false};
        RenderSettings s;
        s.integrator = "vpl";
        s.max_depth = depth;
        const std::string text = missing_light(f, s);
        const size_t begin = text.find("such as ");
        return begin == text.npos ? text : text.substr(begin + 8, text.find(" (L: ") - begin - 8);
    };
    const uint32_t diffuse = bit(BsdfType::diffuse), glass = bit(BsdfType::dielectric);
    CHECK(lacks(diffuse, EmitterType::area).empty());
    CHECK(lacks(diffuse, EmitterType::point).empty());
    CHECK(lacks(glass, EmitterType::area).empty());
    CHECK(lacks(diffuse | glass, EmitterType::area) == "L S D E");  // a caustic that is seen
    CHECK(lacks(diffuse | glass, EmitterType::area, 2).empty());
    CHECK(lacks(diffuse | glass, EmitterType::point, 3) == "Ld S D E");
    CHECK(lacks(diffuse, EmitterType::directional_area) == "Lb D E");
    const Scene scene = project_scene("glass", 32, 24);
    CHECK(missing_light(scene.features, vpl_settings(scene)).find("such as L S D E") != std::string::npos);
    const double path = mean_of(render_scene(scene, cpu_settings(scene, Estimator::mis), 256).film);
    CHECK(mean_of(render_scene(scene, vpl_settings(scene), 32).film) < 0.99 * path);
}

TEST_CASE("vpl: scenes of glass alone, without emitters, and of no more than one segment") {
    const std::string front = camera("perspective", "origin='0,0,3' target='0,0,0' up='0,1,0'", "");
    const Scene glass = scene_from_text(
        scene_text(front, std::string("<shape type='sphere'><bsdf type='dielectric'/></shape>") + kSky));
    check_same_mean(in_parts(glass, vpl_settings(glass), 64),
                    to_estimate(render_scene(glass, cpu_settings(glass, Estimator::mis), 1024).film), 0.02);
    const Scene dark = scene_from_text(scene_text(front, "<shape type='sphere'>" + diffuse("0.5") + "</shape>"));
    const RenderResult black = render_scene(dark, vpl_settings(dark), 4);
    CHECK(mean_of(black.film) == 0.0);
    const Scene cornell = project_scene("cornell", 24, 24);
    for (const int depth : {0, 1}) {
        RenderSettings vpl = vpl_settings(cornell), path = cpu_settings(cornell, Estimator::mis, 3);
        vpl.max_depth = path.max_depth = depth;
        CHECK(mean_of(render_scene(cornell, vpl, 4).film) == Approx(mean_of(render_scene(cornell, path, 4).film)));
    }
}

TEST_CASE("vpl: the same bits for any number of threads, size of waves and budget") {
    const Scene scene = project_scene("glass", 56, 40);
    for (const Texts& own : {Texts{{"vpl_subpaths", "32"}},
                             {{"vpl_subpaths", "100"}, {"vpl_samples", "4"}, {"vpl_draws", "7"}, {"vpl_clamp", "100"}},
                             {{"vpl_subpaths", "5000"}, {"vpl_draws", "16"}}}) {
        INFO(own[0].second << " light subpaths");
        check_bits_on_cpu(scene, vpl_settings(scene, own), 4, 64);
    }
}

TEST_CASE("vpl: the same image from queues that are sorted, compacted, or not fused") {
    const Scene scene = project_scene("glass", 32, 24);
    const RenderSettings s = vpl_settings(scene, {{"vpl_subpaths", "16"}});
    const double mean = mean_of(render_scene(scene, s, 4).film);
    for (const auto& [key, value] : Texts{{"ordering", "material"},
                                          {"ordering", "morton"},
                                          {"compaction", "select"},
                                          {"compaction", "none"},
                                          {"fuse", "none"},
                                          {"cull", "0.01"}}) {
        INFO(key << "=" << value);
        RenderSettings other = s;
        apply_setting(other, key, value);
        const RenderResult r = render_scene(scene, other, 4);
        CHECK(mean_of(r.film) == Approx(mean).epsilon(key == std::string("cull") ? 0.05 : 1e-5));
        for (const QueueStats& q : r.stats.queues) CHECK(q.overflow == 0);
    }
}

TEST_CASE("vpl: iterations are whole, a render goes on from its film alone, and impossible settings are refused") {
    const Scene scene = project_scene("cornell", 24, 24);
    check_resumes_from_film(scene, vpl_settings(scene, {{"vpl_subpaths", "16"}, {"vpl_samples", "4"}}));
    CHECK_THROWS_WITH(make_renderer(scene, vpl_settings(scene, {{"vpl_subpaths", "9217"}})),
                      ContainsSubstring("vpl_subpaths=9217") && ContainsSubstring("24x24"));
    CHECK_NOTHROW(make_renderer(scene, vpl_settings(scene, {{"vpl_subpaths", "9216"}})));
    for (const auto& [key, value] : Texts{{"heuristic", "power"}, {"light_paths", "2"}, {"strategies", "hits"}}) {
        INFO(key);
        CHECK_THROWS_WITH(make_renderer(scene, vpl_settings(scene, {{key, value}})), ContainsSubstring(key));
    }
    for (const auto& [key, value] : Texts{{"vpl_subpaths", "0"}, {"vpl_clamp", "-1"}, {"vpl_samples", "0"}})
        CHECK_THROWS_WITH(vpl_settings(scene, {{key, value}}), ContainsSubstring(key));
}
