// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 120
// Merges in replays: both vertices, whose light subpath it is, and what is asked of samples that share light vertices.
#include <map>

#include "render/replay/by_length.h"
#include "render/replay/outliers.h"
#include "render/replay/print.h"
#include "tests/support/replayed.h"

namespace ambilux {
namespace {

Scene room() { return project_scene("cornell", 24, 16); }

/// The radius that a note tells.
double radius_of(const ReplaySample& s) {
    const std::string& note = s.notes.at(0);
    return std::stod(note.substr(note.find("radius ") + 7));
}

}  // namespace

TEST_CASE("A merge shows its two vertices, at most a radius apart, and the light subpath that left one of them") {
    for (const char* samples : {"1", "2"}) {
        CAPTURE(samples);
        const Replayed r(room(), {"vcm", "wavefront", {{"merge_radius", "0.05"}, {"merge_samples", samples}}});
        const bool several = samples == std::string("2");
        std::map<std::string, uint32_t> kinds;
        std::map<uint32_t, uint32_t> of_sample;
        r.each_sample(2, 37, [&](const ReplaySample& s) {
            const double radius = radius_of(s);
            Rgb sum{};
            for (const ReplayCandidate& c : s.candidates) {
                ++kinds[c.kind];
                sum += c.contribution;
                CHECK(c.merged == (c.kind == std::string("merge")));
                CHECK((c.light_sample == kNone) == (!several || c.light_subpath == kNone));
                if (!c.merged) continue;
                CHECK(c.strategy.code == Strategy::make(c.light_depth + 1, c.eye_depth + 1).code);
                CHECK(c.segments() == c.light_depth + c.eye_depth);
                CHECK(c.tmax == 0);
                CHECK(close(c.contribution, c.value * c.weight));
                CHECK(near(c.eye_p, s.eye.vertices.at(c.eye_depth - 1).p));
                const double distance = double(length(c.eye_p - c.light_p));
                CHECK(distance <= radius);
                CHECK(names(c.densities) == "distance_over_radius pdf_eye_sa pdf_eye_reverse_sa");
                CHECK(close(number(c.densities, "distance_over_radius"), distance / radius, 1e-4));
                const uint32_t sample = several ? c.light_sample : s.sample;
                ++of_sample[sample];
                std::vector<ReplayCandidate> splats;
                const ReplaySubpath light = r.replay->light_subpath(c.light_subpath, sample, true, splats);
                CHECK(near(c.light_p, light.vertices.at(c.light_depth - 1).p));
            }
            CHECK(close(s.eye_sum, sum, 1e-4));
            REQUIRE(s.lights.size() <= 3);
            for (const ReplaySubpath& light : s.lights) {
                CHECK((light.sample == kNone) == !several);
                CHECK(light.vertices.size() > 0);
            }
        });
        for (const char* kind : {"merge", "connection", "next event"}) CHECK(kinds[kind] > 0);
        CHECK(of_sample[0] > 0);
        CHECK(of_sample[1] > 0);
    }
}

TEST_CASE("Merges of one strategy are shown without connections of the same number of vertices") {
    const Replayed r(room(), {"vcm", "wavefront", {{"merge_radius", "0.05"}, {"merge_samples", "2"}}});
    ReplaySample s;
    const auto has = [&](bool merged) {
        return std::any_of(s.candidates.begin(), s.candidates.end(), [&](const ReplayCandidate& c) {
            return c.merged == merged && c.strategy.code == Strategy::make(2, 2).code;
        });
    };
    for (uint32_t pixel = 0; pixel < r.pixels() && !(has(true) && has(false)); ++pixel)
        s = r.replay->sample(r.request(pixel, 1));
    REQUIRE((has(true) && has(false)));
    const ReplayFormat format = {parse_strategy("s2+t2"), {}};
    const std::string text = replay_text(s, format);
    CHECK(text.find("  s2+t2    merge, eye vertex 1, light subpath ") != std::string::npos);
    CHECK(text.find("           eye vertex at (") != std::string::npos);
    CHECK(text.find(" of sample ") != std::string::npos);
    CHECK(text.find("  s2t2") == std::string::npos);
    CHECK(text.find("by strategy s2+t2") != std::string::npos);
    for (const nlohmann::json& c : replay_json(s, format)["candidates"]) {
        CHECK(c["kind"] == "merge");
        CHECK(c["merge"]["eye_vertex"].size() == 3);
        CHECK(c["merge"]["light_vertex"].size() == 3);
        CHECK(c["light_sample"] <= 1);
    }
}

TEST_CASE("A light subpath that was asked for is shown beside those that bring most, and once") {
    const Replayed r(room(), {"vcm", "wavefront", {{"merge_radius", "0.05"}}});
    const ReplaySample plain = r.replay->sample(r.request(200, 0));
    REQUIRE(plain.lights.size() == 3);
    for (const uint32_t number : {plain.lights[0].number, plain.lights[0].number + 1}) {
        ReplayRequest request = r.request(200, 0);
        request.light_subpath = number;
        const ReplaySample s = r.replay->sample(request);
        CHECK(s.lights.at(0).number == number);
        CHECK(std::count_if(s.lights.begin(), s.lights.end(),
                            [&](const ReplaySubpath& l) { return l.number == number; }) == 1);
        CHECK(s.total[0] == plain.total[0]);
    }
    ReplayRequest request = r.request(200, 0);
    request.details = false;
    CHECK(r.replay->sample(request).lights.empty());
    CHECK(r.replay->sample(request).total[0] == plain.total[0]);
}

TEST_CASE("Of methods that go on through deltas alone an eye subpath says so where it ends") {
    const Replayed r(project_scene("glass", 24, 16), {"ppm", "wavefront", {}});
    uint32_t ended = 0;
    r.each_sample(1, 1, [&](const ReplaySample& s) {
        for (const ReplayVertex& v : s.eye.vertices) ended += v.end == "the method goes on through delta lobes only";
    });
    CHECK(ended > 100);
}

TEST_CASE("Without paths of two segments nothing is merged, and the replay is the render's") {
    const Replayed r(room(), {"vcm", "wavefront", {{"max_depth", "1"}, {"specialise", "false"}}});
    const FilmMoments film = rendered_film(r.scene, r.settings, 0);
    for (uint32_t p = 0; p < r.pixels(); p += 7) {
        ReplayRequest request = r.request(p, 0);
        request.splats = true;
        const ReplaySample s = r.replay->sample(request);
        CHECK(s.notes.empty());
        for (size_t c = 0; c < 3; ++c) CHECK(s.total[c] == film.sum[p * 3 + c]);
    }
}

TEST_CASE("A comparison by segments is of all samples that share light vertices") {
    for (const char* samples : {"1", "2"}) {
        const Scene scene = room();
        const RenderSettings settings =
            settings_of(scene, {"vcm", "wavefront", {{"max_depth", "4"}, {"merge_samples", samples}}});
        SharedAccels accels(scene);
        const std::vector<LengthComparison> all = compare_by_length(
            scene, settings, {12, 8, 3, {}, true, true}, accels,
            [&](const RenderSettings& s, uint32_t sample) { return rendered_film(scene, s, sample); });
        REQUIRE(all.size() == 4);
        double sum = 0;
        for (const LengthComparison& l : all) {
            CHECK_FALSE(l.differs);
            sum += l.rendered[0];
        }
        CHECK(sum > 0);
    }
}

TEST_CASE("Merges whose sum is infinite are found with both of their depths, in every sample of an iteration") {
    // A point light over a floor, so bright that what many of its light vertices bring together is infinite.
    const Scene scene = scene_from_text(
        "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>"
        "<sensor type='perspective'><float name='fov' value='5'/><transform name='to_world'><lookat origin='0,0,4' "
        "target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='8'/>"
        "<integer name='height' value='8'/></film></sensor><emitter type='point'><point name='position' x='0' y='0' "
        "z='0.05'/><rgb name='intensity' value='2.4e37'/></emitter><shape type='rectangle'><bsdf type='diffuse'/>"
        "</shape></scene>");
    const RenderSettings settings =
        settings_of(scene, {"ppm", "wavefront", {{"merge_samples", "2"}, {"merge_radius", "0.05"}}});
    InvalidWatch watch(make_renderer(scene, settings));
    REQUIRE(watch.render(0, 4) == 4);
    REQUIRE(watch.by_stage().at("accumulate").inf > 0);
    SharedAccels accels(scene);
    const std::unique_ptr<Replay> replay = make_replay(scene, settings, accels);
    const FoundInvalid all = find_invalid(watch, *replay, scene, 100000);
    REQUIRE(all.found.size() >= watch.by_stage().at("accumulate").inf);
    bool odd = false;
    for (const InvalidRecord& r : all.found) {
        CHECK(r.drop.stage == "accumulate");
        CHECK(r.drop.what == "Inf");
        CHECK(r.candidate.kind == std::string("merge"));
        CHECK(r.candidate.light_depth == 1);
        CHECK(r.candidate.eye_depth == 1);
        odd = odd || r.sample % 2 == 1;
    }
    CHECK(odd);
}

}  // namespace ambilux
