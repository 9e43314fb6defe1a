// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Values that stages drop are found again by replays: which sample, which subpath and which strategy they were of.
#include "render/replay/outliers.h"
#include "tests/support/replay_settings.h"

namespace ambilux {
namespace {

std::string area(const std::string& radiance) {
    return radiance == "0" ? "" : "<emitter type='area'><rgb name='radiance' value='" + radiance + "'/></emitter>";
}

/// A camera at (x,0,z) that looks at a point of the plane z = 0, with a film of 8 x 8 pixels.
std::string camera(const std::string& fov, const std::string& x, const std::string& z, const std::string& target) {
    return "<sensor type='perspective'><float name='fov' value='" + fov +
           "'/><float name='near_clip' value='0.001'/><transform name='to_world'><lookat origin='" + x + ",0," + z +
           "' target='" + target +
           ",0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='8'/><integer name='height' "
           "value='8'/></film></sensor>";
}

Scene scene_of(int max_depth, const std::string& inside) {
    return scene_from_text("<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='" +
                           std::to_string(max_depth) + "'/></integrator>" + inside + "</scene>");
}

/// A wall and a lamp behind the camera, both of the given radiance.
Scene two_lamps(const std::string& wall, const std::string& lamp) {
    return scene_of(2, camera("40", "0", "4", "0") + "<shape type='rectangle'><bsdf type='diffuse'/>" + area(wall) +
                           "</shape><shape type='rectangle'><transform name='to_world'><scale value='50'/>"
                           "<rotate y='1' angle='180'/><translate z='5'/></transform>" +
                           area(lamp) + "</shape>");
}

std::string point_light(const std::string& z, const std::string& intensity) {
    return "<emitter type='point'><point name='position' x='0' y='0' z='" + z + "'/><rgb name='intensity' value='" +
           intensity + "'/></emitter>";
}

struct InvalidFindings {
    InvalidWatch watch;
    SharedAccels accels;
    std::unique_ptr<Replay> replay;
    std::map<std::string, InvalidCounts> all;  ///< before samples were rendered again
    std::vector<InvalidRecord> found;
    std::vector<uint32_t> samples;

    /// Renders a batch of three samples.
    InvalidFindings(const Scene& scene, const RenderSettings& settings, uint32_t per_stage)
        : watch(make_renderer(scene, settings)), accels(scene), replay(make_replay(scene, settings, accels)) {
        REQUIRE(watch.render(0, 3) == 3);
        REQUIRE(watch.batches().size() == 1);
        CHECK(watch.batches()[0].count == 3);
        all = watch.by_stage();
        FoundInvalid f = find_invalid(watch, *replay, scene, per_stage);
        found = std::move(f.found);
        samples = std::move(f.samples);
    }

    /// The first record of a stage.
    const InvalidRecord& first(const std::string& stage) const {
        for (const InvalidRecord& r : found)
            if (r.drop.stage == stage) return r;
        FAIL(stage << " is not found");
        return found[0];
    }
};

}  // namespace

TEST_CASE("Invalid values of a stage inside of another are counted, and found again with pixel, sample and strategy") {
    // A lamp so bright that its light, divided by the density of sampling it, is infinite.
    const Scene scene = two_lamps("0", "1e38");
    InvalidFindings f(scene, settings_of(scene, {"path", "wavefront", {{"estimator", "nee"}}}), 3);
    REQUIRE(f.all.at("connect").inf > 0);
    REQUIRE(f.found.size() == 3);
    CHECK(f.samples == std::vector<uint32_t>{0});
    // The first ones, row by row.
    size_t k = 0;
    for (uint32_t pixel = 0; pixel < 64 && k < 3; ++pixel) {
        const ReplaySample s = f.replay->sample({pixel % 8, pixel / 8, 0, {}, true, true});
        for (const ReplayCandidate& c : s.candidates) {
            if (c.fate != ReplayFate::invalid) continue;
            CHECK(c.drop.stage == "connect");
            CHECK(c.drop.what == "Inf");
            CHECK(c.strategy.code == Strategy::make(1, 2).code);
            CHECK(c.eye_depth == 1);
            const InvalidRecord& r = f.found[k++];
            CHECK(r.x == pixel % 8);
            CHECK(r.y == pixel / 8);
            CHECK(r.sample == 0);
            CHECK(r.light_subpath == kNone);
            CHECK(r.drop.stage == "connect");
            CHECK(r.drop.what == "Inf");
            CHECK(r.candidate.kind == std::string("next event"));
            CHECK(r.candidate.strategy.code == c.strategy.code);
        }
    }
    CHECK(k == 3);
}

TEST_CASE("An infinite flux is found by the number of its light subpath") {
    const Scene scene = two_lamps("0", "1e38");
    InvalidFindings f(scene, settings_of(scene, {"light", "wavefront", {}}), 2);
    REQUIRE(f.all.at("light_generate").inf == 3 * 64);
    REQUIRE(f.found.size() == 2);
    for (size_t k = 0; k < 2; ++k) {
        const InvalidRecord& r = f.found[k];
        CHECK(r.drop.stage == "light_generate");
        REQUIRE(r.light_subpath == k);
        CHECK(r.x == 0);
        CHECK(r.y == 0);
        CHECK(r.sample == 0);
        CHECK(r.candidate.kind == std::string());
        std::vector<ReplayCandidate> splats;
        const ReplaySubpath again = f.replay->light_subpath(r.light_subpath, r.sample, true, splats);
        CHECK(again.drop.what == "Inf");
        CHECK(again.end == "the flux of the emitter sample is invalid");
        CHECK(again.vertices.empty());
        CHECK(splats.empty());
    }
}

TEST_CASE("All invalid values are found if all are asked for, in as many samples as have them; none once interrupted") {
    const Scene scene = two_lamps("0", "1e38");
    const RenderSettings settings = settings_of(scene, {"light", "wavefront", {}});
    InvalidFindings f(scene, settings, 1000);
    CHECK(f.found.size() == 3 * 64);
    CHECK(f.samples == std::vector<uint32_t>{0, 1, 2});
    CHECK(f.found[64].sample == 1);
    CHECK(f.found[64].light_subpath == 0);

    InvalidWatch watch(make_renderer(scene, settings));
    REQUIRE(watch.render(0, 3) == 3);
    const volatile bool interrupt = true;
    const FoundInvalid none = find_invalid(watch, *f.replay, scene, 1000, &interrupt);
    CHECK(none.found.empty());
    CHECK(none.samples.empty());
}

TEST_CASE("A sample whose sum is infinite in one channel, though its parts are not, is found as that of update_film") {
    for (const char* radiance : {"3e38,0,0", "0,3e38,0", "0,0,3e38"}) {
        CAPTURE(radiance);
        const Scene scene = two_lamps(radiance, radiance);
        InvalidFindings f(scene, settings_of(scene, {"path", "wavefront", {{"estimator", "naive"}}}), 1);
        CHECK(f.all.size() == 1);
        REQUIRE(f.all.at("update_film").inf > 0);
        REQUIRE(f.found.size() == 1);
        const InvalidRecord& r = f.found[0];
        CHECK(r.candidate.kind == std::string());
        const ReplaySample again = f.replay->sample({r.x, r.y, r.sample, {}, true, true});
        CHECK(again.drop.stage == "update_film");
        CHECK(again.drop.what == "Inf");
    }
}

TEST_CASE("A light vertex so bright that its splat is infinite is found with its depth") {
    // Pixels are small: much of what lands there counts for each.
    const Scene scene =
        scene_of(2, camera("5", "0", "4", "0") + point_light("0.3", "2.5e37") +
                        "<shape type='rectangle'><transform name='to_world'><scale value='9'/></transform></shape>");
    InvalidFindings f(scene, settings_of(scene, {"light", "wavefront", {}}), 1);
    CHECK(f.all.size() == 1);
    REQUIRE(f.all.at("connect_camera").inf > 0);
    const InvalidRecord& r = f.first("connect_camera");
    CHECK(r.candidate.kind == std::string("camera"));
    CHECK(r.candidate.strategy.code == Strategy::make(2, 1).code);
    CHECK(r.candidate.light_depth == 1);
    CHECK(r.candidate.eye_depth == 0);
    CHECK(r.candidate.light_subpath == r.light_subpath);
    CHECK(r.candidate.densities.empty());
    CHECK(r.x == 0);
    CHECK(r.y == 0);
    CHECK(r.drop.what == "Inf");
    std::vector<ReplayCandidate> splats;
    const ReplaySubpath again = f.replay->light_subpath(r.light_subpath, r.sample, true, splats);
    CHECK_FALSE(again.drop.happened());
    REQUIRE(splats.size() == 1);
    CHECK(splats[0].fate == ReplayFate::invalid);
    REQUIRE(splats[0].densities.size() == 2);
    CHECK(splats[0].densities[0].name == "distance");
    CHECK(splats[0].densities[1].name == "pdf_camera_sa");
}

TEST_CASE("A pair of vertices so close that its light is infinite is found with both of its depths") {
    // A corner of a few centimetres.
    const Scene scene = scene_of(
        3, camera("30", "0.05", "0.12", "-0.015") + point_light("0.03", "2e37") +
               "<shape type='rectangle'><transform name='to_world'><scale value='0.03'/></transform></shape>"
               "<shape type='rectangle'><transform name='to_world'><scale value='0.03'/><rotate y='1' angle='90'/>"
               "<translate x='-0.03' z='0.03'/></transform></shape>");
    for (const char* variant : {"wavefront", "megakernel", "streaming"}) {
        CAPTURE(variant);
        InvalidFindings f(scene, settings_of(scene, {"bdpt", variant, {}}), 1);
        const InvalidRecord& r = f.first("connect_vertices");
        CHECK(r.candidate.kind == std::string("connection"));
        CHECK(r.candidate.strategy.code == Strategy::make(2, 2).code);
        CHECK(r.candidate.light_depth == 1);
        CHECK(r.candidate.eye_depth == 1);
        CHECK(r.candidate.light_subpath == r.y * 8 + r.x);
        CHECK(r.drop.what == "Inf");
        const InvalidRecord& next = f.first("connect");
        CHECK(next.candidate.strategy.code == Strategy::make(1, next.candidate.eye_depth + 1).code);
    }
}

}  // namespace ambilux
