// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Light subpaths of replays: where they start, what they splat, which of them belong to a sample, and what eye vertices
// are connected with.
#include <set>

#include "core/error.h"
#include "integrators/bdpt/shared/pilot.h"
#include "integrators/bdpt/shared/policy.h"
#include "render/replay/by_length.h"
#include "tests/support/replayed.h"

namespace ambilux {
namespace {

Scene cornell(uint32_t height = 16) { return project_scene("cornell", 24, height); }

/// Pixels per unit of slope, of "cornell" with 24 pixels in a row.
const double kFocal = 12 / std::tan(39 * kPiDouble / 360);
constexpr Vec3f kCamera = {0, 0, 3.9f};

void check_start(const ReplaySubpath& s) {
    CHECK(s.side == Side::light);
    CHECK(s.emitter == "area");
    CHECK(close(s.start, kLamp));
    CHECK(s.end.empty());
    REQUIRE_FALSE(s.vertices.empty());
    const ReplayVertex& v = s.vertices[0];
    CHECK(names(s.start_densities) == "emitter pick_probability pdf_position_area pdf_direction_sa cos_theta");
    CHECK(number(s.start_densities, "emitter") == 0);
    CHECK(number(s.start_densities, "pick_probability") == 1);
    CHECK(close(number(s.start_densities, "pdf_position_area"), 1 / kLampArea));
    CHECK(close(number(s.start_densities, "cos_theta"), -double(v.direction.y)));
    CHECK(close(number(s.start_densities, "pdf_direction_sa"), -double(v.direction.y) / kPiDouble));
    CHECK(close(v.throughput, kLamp * float(kPiDouble * kLampArea)));
    CHECK(std::abs(double(v.origin.y) - 0.995) < 1e-4);
}

/// On a film of 24 x 24 pixels; `pixels`: as many light subpaths a sample has.
void check_splat(const ReplayCandidate& c, const ReplaySubpath& s, uint32_t pixels) {
    CHECK(c.kind == std::string("camera"));
    CHECK(c.light_subpath == s.number);
    CHECK(c.eye_depth == 0);
    CHECK(c.strategy.code == Strategy::make(c.light_depth + 1, 1).code);
    REQUIRE(c.light_depth <= s.vertices.size());
    const bool lamp = c.light_depth == 0;
    const ReplayVertex& v = s.vertices[lamp ? 0 : c.light_depth - 1];
    const Vec3f p = lamp ? v.origin : v.p, to = kCamera - p;
    const double distance = double(length(to)), cos_camera = double(to.z) / distance,
                 pdf = kFocal * kFocal / (cos_camera * cos_camera * cos_camera);
    CHECK(near(c.origin, p));
    CHECK(near(c.direction, to / float(distance)));
    CHECK(std::abs(double(c.film.x) - (12 + kFocal * double(p.x / to.z))) < 2e-2);
    CHECK(std::abs(double(c.film.y) - (12 - kFocal * double(p.y / to.z))) < 2e-2);
    if (lamp) {
        CHECK(c.densities.empty());
    } else {
        CHECK(names(c.densities) == "distance pdf_camera_sa");
        CHECK(close(number(c.densities, "distance"), distance));
        CHECK(close(number(c.densities, "pdf_camera_sa"), pdf, 1e-4));
        // Near the camera's own clipping plane the ray ends.
        CHECK(double(c.tmax) < distance);
        CHECK(double(c.tmax) > distance - 0.05);
        CHECK(close(c.value, thrown(v, c.direction) * float(pdf / (distance * distance * pixels)), 1e-3));
    }
    check_arrival(c);
}

/// Sums of multiple importance sampling between diffuse vertices, by the recursion of docs/theory.md.
void check_sums(const ReplaySubpath& s, bool bidirectional) {
    for (size_t k = 0; k < s.vertices.size(); ++k) {
        const ReplayVertex& v = s.vertices[k];
        CHECK(names(v.sums) == (bidirectional ? "dvcm dvc" : "pdf_sa"));
        if (k == 0) {
            if (!bidirectional) CHECK(number(v.sums, "pdf_sa") == 0);
            continue;
        }
        const ReplayVertex& before = s.vertices[k - 1];
        const double pdf = double(before.scatter.pdf_sa);
        if (!bidirectional) {
            CHECK(number(v.sums, "pdf_sa") == pdf);
            continue;
        }
        const double cos_out = cosine(before, v.direction), d = double(v.distance),
                     to_area = v.miss ? 1 : d * d / cosine(v, v.direction);
        const double dvc =
            cos_out / pdf *
            (number(before.sums, "dvc") * double(before.scatter.pdf_reverse_sa) + number(before.sums, "dvcm"));
        CHECK(close(number(v.sums, "dvcm"), to_area / pdf, 1e-3));
        CHECK(close(number(v.sums, "dvc"), v.miss ? dvc : dvc / cosine(v, v.direction), 1e-3));
    }
}

/// The message of a usage error.
template <class Call>
std::string refusal(Call call) {
    try {
        call();
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::usage);
        return e.what();
    }
    FAIL("no error");
    return {};
}

}  // namespace

TEST_CASE("Light subpaths of a diffuse room start on its lamp and splat what geometry gives") {
    // So high that the camera sees the lamp.
    const Replayed r(cornell(24), {"bdpt", "wavefront", {}});
    REQUIRE(r.replay->light_subpaths() == r.pixels());
    uint32_t lamp = 0, walls = 0, blocked = 0;
    r.each_light_subpath([&](const ReplaySubpath& s, const std::vector<ReplayCandidate>& splats) {
        check_start(s);
        check_sums(s, true);
        for (const ReplayCandidate& c : splats) {
            check_splat(c, s, r.pixels());
            ++(c.light_depth == 0 ? lamp : walls);
            blocked += c.fate == ReplayFate::blocked;
        }
    });
    CHECK(lamp > 0);
    CHECK(walls > 0);
    CHECK(blocked > 0);
    r.each_sample(1, 11, [&](const ReplaySample& s) { check_sums(s.eye, true); });
    const Replayed path(cornell(), {"path", "wavefront", {}});
    path.each_sample(1, 11, [&](const ReplaySample& s) { check_sums(s.eye, false); });
}

TEST_CASE("A pixel has the splats of all light subpaths that its filter reaches, each by the filter's value there") {
    Scene scene = cornell();
    scene.sensor.filter = FilterType::tent;
    scene.sensor.filter_radius = 1;
    const Replayed r(std::move(scene), {"bdpt", "wavefront", {}});
    std::map<std::pair<uint32_t, uint32_t>, ReplayCandidate> all;
    r.each_light_subpath([&](const ReplaySubpath& s, const std::vector<ReplayCandidate>& splats) {
        for (const ReplayCandidate& c : splats) all[{s.number, c.light_depth}] = c;
    });
    uint32_t arrived = 0;
    for (uint32_t pixel = 0; pixel < r.pixels(); pixel += 29) {
        ReplayRequest request = r.request(pixel, 0);
        CHECK(r.replay->sample(request).splats.empty());
        request.splats = true;
        const ReplaySample s = r.replay->sample(request);
        const auto filter = [&](const ReplayCandidate& c) {
            const double x = std::abs(double(c.film.x) - s.x - 0.5), y = std::abs(double(c.film.y) - s.y - 0.5);
            return std::max(1 - x, 0.0) * std::max(1 - y, 0.0);
        };
        size_t expected = 0;
        for (const auto& [key, c] : all) {
            if (filter(c) <= 0) continue;
            REQUIRE(expected < s.splats.size());
            const ReplayCandidate& found = s.splats[expected++];
            CHECK(found.light_subpath == key.first);
            CHECK(found.light_depth == key.second);
            CHECK(std::abs(double(found.filter) - filter(c)) < 1e-5);
            CHECK(found.fate == c.fate);
            CHECK(names(found.densities) == names(c.densities));
            check_arrival(found);
        }
        CHECK(expected == s.splats.size());
        Rgb sum = {0, 0, 0};
        for (const ReplayCandidate& c : s.splats) {
            sum += c.contribution;
            arrived += c.fate == ReplayFate::arrived;
        }
        for (int k = 0; k < 3; ++k) {
            CHECK(close(s.splat_sum[k], double(sum[k]), 1e-4));
            CHECK(s.total[k] == s.splat_sum[k] + double(s.eye_sum[k]));
        }
    }
    CHECK(arrived > 0);
}

TEST_CASE("Where there is no first ray of a light subpath the reason is told") {
    const auto end = [](Scene scene, const std::string& max_depth) {
        const Replayed r(std::move(scene), {"light", "wavefront", {{"max_depth", max_depth}}});
        std::vector<ReplayCandidate> splats;
        const ReplaySubpath s = r.replay->light_subpath(0, 0, true, splats);
        CHECK(s.vertices.empty());
        return s.emitter + ": " + s.end;
    };
    CHECK(end(cornell(), "1") == "area: max_depth");
    Scene dark = cornell();
    for (Emitter& e : dark.emitters) e.radiance.value = {0, 0, 0};
    CHECK(end(std::move(dark), "2") == ": the emitter sample carries no light");
}

TEST_CASE(
    "Densities of where a light subpath starts are probabilities where the emitter has but one place or direction") {
    const auto densities = [](const std::string& emitter) {
        const Replayed r(
            scene_from_text("<scene version='3.0.0'><sensor type='orthographic'><transform name='to_world'><lookat "
                            "origin='0,0,4' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer "
                            "name='width' value='4'/><integer name='height' value='4'/></film></sensor>" +
                            emitter + "<shape type='rectangle'/></scene>"),
            {"light", "wavefront", {}});
        std::string text;
        r.each_light_subpath([&](const ReplaySubpath& s, const std::vector<ReplayCandidate>& splats) {
            text = names(s.start_densities);
            for (const ReplayCandidate& c : splats) CHECK(names(c.densities) == "distance pdf_camera_area");
        });
        return text;
    };
    CHECK(densities("<emitter type='point'><point name='position' x='0' y='0' z='1'/></emitter>") ==
          "emitter pick_probability probability_position pdf_direction_sa cos_theta");
    CHECK(densities("<emitter type='directional'><vector name='direction' x='0' y='0' z='-1'/></emitter>") ==
          "emitter pick_probability pdf_position_area probability_direction cos_theta");
}

TEST_CASE("A replay connects as many segments as its render, by every variant") {
    for (const char* variant : {"wavefront", "lvc", "streaming", "megakernel"}) {
        CAPTURE(variant);
        const Replayed r(cornell(), {"bdpt", variant, {{"max_depth", "4"}, {"specialise", "false"}}});
        const FilmMoments film = rendered_film(r.scene, r.settings, 0);
        std::set<std::pair<uint32_t, uint32_t>> depths;
        for (uint32_t pixel = 0; pixel < r.pixels(); pixel += 7) {
            CAPTURE(pixel);
            ReplayRequest request = r.request(pixel, 0);
            request.splats = true;
            const ReplaySample s = r.replay->sample(request);
            for (uint32_t c = 0; c < 3; ++c) CHECK(s.total[c] == film.sum[pixel * 3 + c]);
            for (const ReplayCandidate& c : s.candidates)
                if (c.kind == std::string("connection")) depths.insert({c.eye_depth, c.light_depth});
        }
        CHECK(depths == std::set<std::pair<uint32_t, uint32_t>>{{1, 1}, {1, 2}, {2, 1}});
    }
}

TEST_CASE("Of variant streaming every eye vertex has a light subpath as long as a path has segments left") {
    for (const char* strategies : {"all", "next_event+connections"}) {
        CAPTURE(strategies);
        const Replayed r(cornell(), {"bdpt", "streaming", {{"max_depth", "5"}, {"strategies", strategies}}});
        const bool splats = strategies == std::string("all");
        std::map<uint32_t, size_t> longest;
        r.each_sample(2, 5, [&](const ReplaySample& s) {
            for (size_t k = 0; k < s.lights.size(); ++k) {
                CHECK(s.lights[k].number == s.eye.number);
                CHECK(s.lights[k].part == k);
                longest[s.lights[k].part] = std::max(longest[s.lights[k].part], s.lights[k].vertices.size());
            }
            CHECK(s.lights.size() <= s.eye.vertices.size());
        });
        // The first one splats too.
        CHECK(longest == std::map<uint32_t, size_t>{{0, splats ? 4 : 3}, {1, 2}, {2, 1}});
    }
}

TEST_CASE("With a light subpath a cache is replaced by its vertices, each worth what one draw of it is on average") {
    const Replayed pairs(cornell(), {"bdpt", "wavefront", {}});
    for (const char* draws : {"1", "4"}) {
        const Replayed r(cornell(), {"bdpt", "lvc", {{"connections", draws}}});
        const double mean =
            mean_light_vertices<kAllFeatures>(r.scene.view(), HostTracer(r.accels.get<EmbreeAccel>()->tracer()),
                                              plan_bdpt(r.scene, r.settings).rules, r.settings.seed);
        REQUIRE(mean > 1);
        uint32_t compared = 0;
        for (uint32_t pixel = 0; pixel < r.pixels(); pixel += 29) {
            ReplayRequest request = r.request(pixel, 1);
            request.light_subpath = pixel;
            const ReplaySample s = r.replay->sample(request), p = pairs.replay->sample(request);
            CHECK_FALSE(s.complete);
            REQUIRE(s.notes.size() == 1);
            CHECK(
                s.notes[0] ==
                "connections: every eye vertex with every vertex of the light subpath that was given, each worth what "
                "one draw of it is on average; the render drew from a cache");
            REQUIRE(s.lights.size() == 1);
            CHECK(s.lights[0].number == pixel);
            REQUIRE(s.candidates.size() == p.candidates.size());
            for (size_t k = 0; k < s.candidates.size(); ++k) {
                const ReplayCandidate &drawn = s.candidates[k], &pair = p.candidates[k];
                CHECK(drawn.strategy.code == pair.strategy.code);
                const bool connection = drawn.kind == std::string("connection");
                CHECK(close(drawn.value, pair.value * float(connection ? mean / std::atof(draws) : 1)));
                compared += connection;
            }
        }
        CHECK(compared > 0);
    }
}

TEST_CASE("What a replay of a cache does not know is left out, and said") {
    const auto replayed = [](const ReplayConfig& config) {
        const Replayed r(cornell(), config);
        uint32_t connections = 0;
        ReplaySample last;
        r.each_sample(1, 29, [&](const ReplaySample& s) {
            for (const ReplayCandidate& c : s.candidates) connections += c.kind == std::string("connection");
            last = s;
        });
        CHECK(last.complete == (connections > 0));
        REQUIRE(last.notes.size() == 1);
        return last.notes[0];
    };
    const std::string drawn = "connections: with draws from the cache of a render on the CPU with ",
                      missing = "connections are missing: ";
    CHECK(replayed({"bdpt", "lvc", {}}).find(drawn) == 0);
    CHECK(replayed({"bdpt", "lvc", {{"ordering", "none"}}}).find(drawn) == 0);
    CHECK(replayed({"bdpt", "lvc", {{"ordering", "morton"}}}).find(missing) == 0);
    CHECK(replayed({"bdpt", "lvc", {{"memory", "64M"}}}).find(missing) == 0);
    const Replayed r(cornell(), {"bdpt", "lvc", {{"ordering", "material"}}});
    CHECK(refusal([&] {
              compare_by_length(r.scene, r.settings, r.request(0, 0), r.accels, {});
          }).find("--compare: " + missing) == 0);
}

TEST_CASE("A light subpath that was asked for is shown once") {
    for (const char* variant : {"wavefront", "megakernel"}) {
        const Replayed r(cornell(), {"bdpt", variant, {}});
        const auto numbers = [&](uint32_t asked) {
            ReplayRequest request = r.request(40, 0);
            request.light_subpath = asked;
            std::vector<uint32_t> all;
            for (const ReplaySubpath& s : r.replay->sample(request).lights) all.push_back(s.number);
            return all;
        };
        CHECK(numbers(40) == std::vector<uint32_t>{40});
        CHECK(numbers(41) == std::vector<uint32_t>{40, 41});
        // It is that of the sample.
        for (const uint32_t sample : {0u, 2u}) {
            ReplayRequest request = r.request(40, sample);
            request.light_subpath = 41;
            std::vector<ReplayCandidate> splats;
            const ReplaySubpath alone = r.replay->light_subpath(41, sample, true, splats),
                                shown = r.replay->sample(request).lights.at(1);
            REQUIRE_FALSE(alone.vertices.empty());
            REQUIRE(shown.vertices.size() == alone.vertices.size());
            CHECK(names(shown.start_densities) == names(alone.start_densities));
            for (size_t k = 0; k < alone.vertices.size(); ++k)
                for (int c = 0; c < 3; ++c) CHECK(shown.vertices[k].direction[c] == alone.vertices[k].direction[c]);
        }
    }
}

TEST_CASE("Without details there are the same contributions, and no vertices or densities") {
    const Replayed r(cornell(), {"bdpt", "wavefront", {}});
    for (uint32_t pixel = 0; pixel < r.pixels(); pixel += 53) {
        ReplayRequest request = r.request(pixel, 0);
        request.splats = true;
        const ReplaySample full = r.replay->sample(request);
        request.details = false;
        const ReplaySample s = r.replay->sample(request);
        CHECK(s.eye.vertices.empty());
        for (const ReplaySubpath& light : s.lights) CHECK(light.vertices.empty());
        for (int k = 0; k < 3; ++k) CHECK(s.total[k] == full.total[k]);
        REQUIRE(s.candidates.size() == full.candidates.size());
        for (const auto* all : {&s.candidates, &s.splats})
            for (const ReplayCandidate& c : *all) CHECK(c.densities.empty());
    }
    std::vector<ReplayCandidate> splats;
    CHECK(r.replay->light_subpath(5, 0, false, splats).start_densities.empty());
}

TEST_CASE("Light subpaths have numbers round by round, with gaps where there is no whole number per pixel") {
    const Replayed r(cornell(), {"light", "wavefront", {{"light_paths", "1.25"}}});
    CHECK(r.replay->light_subpaths() == 2 * r.pixels());
    // One of every four pixels has a second one.
    for (uint32_t n = 0; n < r.pixels(); ++n) {
        CHECK(r.replay->has_light_subpath(n));
        CHECK(r.replay->has_light_subpath(r.pixels() + n) == (n % 24 % 2 == 0 && n / 24 % 2 == 0));
    }
    const uint32_t gap = r.pixels() + 1;
    CHECK_FALSE(r.replay->has_light_subpath(2 * r.pixels()));
    std::vector<ReplayCandidate> splats;
    const auto asked = [&](const Replayed& of, uint32_t n) {
        return refusal([&] { (void)of.replay->light_subpath(n, 0, true, splats); });
    };
    CHECK(asked(r, gap) == "--light-subpath " + std::to_string(gap) + ": those of a sample have numbers below 768");
    CHECK(asked(r, 768) == "--light-subpath 768: those of a sample have numbers below 768");
    const Replayed none(cornell(), {"bdpt", "wavefront", {{"strategies", "hits+next_event"}}});
    CHECK(none.replay->light_subpaths() == 0);
    CHECK_FALSE(none.replay->has_light_subpath(0));
    CHECK(asked(none, 3) == "--light-subpath 3: no strategy of this render needs light subpaths");
    const Replayed path(cornell(), {"path", "wavefront", {}});
    CHECK(path.replay->light_subpaths() == 0);
    CHECK_FALSE(path.replay->has_light_subpath(0));
    CHECK(asked(path, 0) ==
          "--light-subpath: integrator path has no light subpaths; light, bdpt, vcm, bpm, ppm, sppm and pm have");
}

TEST_CASE(
    "What has no replay is refused, what has one is named, and its rays go through the structure of its settings") {
    const Scene scene = cornell();
    const auto refused = [&](const ReplayConfig& c) { return refusal([&] { check_replay(settings_of(scene, c)); }); };
    CHECK(refused({"toy", "wavefront", {}}) ==
          "integrator toy: there is no replay of it; path, light, bdpt, vcm, bpm, ppm, sppm and pm have one");
    CHECK(refused({"bdpt", "learned", {}}) ==
          "variant learned: there is no replay of it; wavefront, lvc, guided, streaming and megakernel have one");
    CHECK(refused({"bdpt", "wavefront", {{"bdpt.auto", "true"}}}) ==
          "bdpt.auto=true: which integrator made the sample is up to a pilot; give the settings that `ambilux render` "
          "printed as its selection");
    check_replay(settings_of(scene, {"path", "ris", {}}));
    const Replayed embree(cornell(), {"path", "wavefront", {{"accel", "embree"}}}),
        cwbvh(cornell(), {"path", "wavefront", {{"accel", "cwbvh"}}});
    CHECK(embree.replay->accel == embree.accels.get<EmbreeAccel>());
    CHECK(cwbvh.replay->accel == cwbvh.accels.get<CwbvhAccel>());
}

}  // namespace ambilux
