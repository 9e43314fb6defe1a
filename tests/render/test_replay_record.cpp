// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// What a replay says of a sample: vertices follow from the ones before, and the numbers of diffuse surfaces and of the
// lamp of "cornell" are those that geometry gives.
#include <set>

#include "render/replay/describe.h"
#include "tests/support/replayed.h"

namespace ambilux {
namespace {

/// What Russian roulette did in some subpaths.
struct Played {
    uint32_t survived = 0, ended = 0, capped = 0;
};

/// `left`: of the throughput, as roulette sees it; within `allowed`.
void check_roulette(const RenderSettings& settings, const ReplayVertex& v, double left, double allowed,
                    Played& played) {
    const ReplayRoulette& r = v.scatter.roulette;
    const bool capped = left > double(settings.rr_cap);
    CHECK(close(double(r.survival), capped ? double(settings.rr_cap) : left, capped ? 2e-5 : allowed));
    CHECK(r.survived == (r.u < r.survival));
    CHECK(r.survived == (v.end != "Russian roulette"));
    ++(r.survived ? played.survived : played.ended);
    played.capped += capped;
}

void check_hit(const SceneView& view, const ReplayVertex& v) {
    CHECK(close(double(v.distance), double(length(v.p - v.origin))));
    CHECK(near(v.p, v.origin + v.direction * v.distance));
    CHECK(close(double(length(v.ng)), 1));
    REQUIRE(v.shape < view.shape_count);
    CHECK(v.material == view.shapes[v.shape].material);
    CHECK(v.emitter == view.shapes[v.shape].emitter);
    CHECK(v.bsdf == (v.smooth ? "diffuse" : "dielectric"));
    if (v.scatter.sampled) CHECK(v.scatter.delta == !v.smooth);
}

void check_steps(const Replayed& r, const ReplaySubpath& s, Played& played) {
    double eta = 1;
    for (size_t k = 0; k < s.vertices.size(); ++k) {
        const ReplayVertex& v = s.vertices[k];
        const bool last = k + 1 == s.vertices.size();
        CHECK(v.depth == k + 1);
        CHECK(v.end.empty() == !last);
        if (v.miss) {
            CHECK(last);
            CHECK(v.end == "the ray leaves the scene");
            CHECK(v.shape == kNone);
            continue;
        }
        check_hit(r.scene.view(), v);
        if (!v.scatter.sampled) continue;
        const Rgb whole = v.throughput * v.scatter.weight;
        if (s.side == Side::eye) eta *= double(v.scatter.eta);
        const double start = s.side == Side::eye ? 1 : double(max_component(s.vertices[0].throughput));
        if (v.scatter.roulette.played)
            check_roulette(r.settings, v, double(max_component(whole)) * eta * eta / start,
                           eta == 1 && start == 1 ? 2e-5 : 0.05, played);
        CHECK(v.scatter.roulette.played == (v.depth >= uint32_t(r.settings.rr_depth) && !is_zero(whole)));
        if (last) continue;
        const ReplayVertex& next = s.vertices[k + 1];
        CHECK(next.direction.x == v.scatter.direction.x);
        CHECK(near(next.origin, v.p));
        CHECK(close(next.throughput, v.scatter.roulette.played ? whole / v.scatter.roulette.survival : whole));
    }
}

}  // namespace

TEST_CASE("Vertices of a replay follow one from the other, and roulette pays back what it takes") {
    for (const char* name : {"cornell", "glass"})
        for (const ReplayConfig& c : {ReplayConfig{"path", "wavefront", {{"rr_depth", "1"}, {"rr_cap", "0.4"}}},
                                      ReplayConfig{"bdpt", "wavefront", {{"rr_depth", "2"}, {"rr_cap", "0.7"}}}}) {
            CAPTURE(name, text_of(c));
            const Replayed r(project_scene(name, 24, 16), c);
            Played played;
            r.each_sample(3, 11, [&](const ReplaySample& s) {
                CHECK(s.eye.number == s.y * 24 + s.x);
                check_steps(r, s.eye, played);
                for (const ReplaySubpath& light : s.lights) check_steps(r, light, played);
            });
            CHECK(played.survived > 0);
            CHECK(played.ended > 0);
            CHECK(played.capped > 0);
        }
}

TEST_CASE("Every end of a subpath is told by its reason") {
    const auto ends = [](Scene scene, const ReplayConfig& c) {
        const Replayed r(std::move(scene), c);
        std::set<std::string> found;
        const auto see = [&](const ReplaySubpath& s) {
            for (const ReplayVertex& v : s.vertices)
                if (!v.end.empty()) found.insert(std::to_string(v.depth) + ": " + v.end);
        };
        r.each_sample(1, 1, [&](const ReplaySample& s) {
            see(s.eye);
            for (const ReplaySubpath& light : s.lights) see(light);
        });
        return found;
    };
    const auto cornell = [] { return project_scene("cornell", 24, 16); };
    const std::string leaves = "the ray leaves the scene", absorbed = "absorbed: the throughput is 0";
    const std::set<std::string> outside = {"1: " + leaves};
    const auto with = [&](std::set<std::string> more) {
        more.insert(outside.begin(), outside.end());
        return more;
    };
    CHECK(ends(cornell(), {"path", "wavefront", {{"max_depth", "1"}}}) == with({"1: max_depth"}));
    CHECK(ends(cornell(), {"path", "wavefront", {{"max_depth", "1"}, {"estimator", "nee"}}}) == with({"1: max_depth"}));
    const std::string left = "max_depth: what the last segment could find is left to next event estimation";
    CHECK(ends(cornell(), {"path", "wavefront", {{"max_depth", "2"}, {"estimator", "nee"}}}) == with({"1: " + left}));
    CHECK(ends(cornell(), {"light", "wavefront", {{"max_depth", "2"}}}) ==
          with({"1: eye subpaths of a light tracer serve the background only"}));
    const std::string needless = "no strategy needs a longer subpath";
    CHECK(ends(cornell(), {"bdpt", "wavefront", {{"max_depth", "2"}, {"strategies", "next_event+connections"}}}) ==
          with({"1: " + needless}));
    // The lamp is black.
    const std::set<std::string> naive = ends(cornell(), {"path", "wavefront", {{"max_depth", "-1"}}});
    CHECK(naive.count("2: " + absorbed) == 1);
    CHECK(naive.count("2: " + leaves) == 1);
    CHECK(naive.count("1: max_depth") == 0);
    const Scene behind = scene_from_text(
        "<scene version='3.0.0'><sensor type='perspective'><transform name='to_world'><lookat origin='0,0,-4' "
        "target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='4'/><integer "
        "name='height' value='4'/></film></sensor><emitter type='constant'/><shape type='rectangle'><transform "
        "name='to_world'><scale value='50'/></transform></shape></scene>");
    CHECK(ends(behind, {"path", "wavefront", {}}) == std::set<std::string>{"1: the BSDF scatters nothing"});
}

TEST_CASE("Of several reasons why a subpath ends after its BSDF let it go on the first one is told") {
    ReplayContext<UnidirectionalMis> ctx{};
    ctx.rules.max_depth = 4;
    ctx.rules.mis.estimator = Estimator::nee;
    Subpath<UnidirectionalMis> path{};
    path.depth = 3;
    path.throughput = {1, 1, 1};
    ReplayScatter s;
    s.sampled = true;
    const auto why = [&] { return why_scattering_ends(ctx, path, s); };
    CHECK(why() == "max_depth: what the last segment could find is left to next event estimation");
    s.delta = true;
    CHECK(why() == "absorbed: the throughput is 0");
    s.weight = {0, 1, 0};
    CHECK(why() == "the throughput is invalid");
    s.roulette = {true, 0.5f, 0.75f, false};
    CHECK(why() == "Russian roulette");
    s.roulette.survived = true;
    CHECK(why() == "the throughput is invalid");
    s.roulette = {};
    s.delta = false;
    path.depth = 2;
    CHECK(why() == "the throughput is invalid");
}

namespace {

void check_scattering(const ReplayVertex& v) {
    const ReplayScatter& s = v.scatter;
    CHECK(close(double(s.pdf_sa), cosine(v, s.direction) / kPiDouble, 1e-4));
    CHECK(close(double(s.pdf_reverse_sa), cosine(v, v.direction) / kPiDouble, 1e-4));
    CHECK(s.eta == 1);
    CHECK(close(s.weight, cornell_reflectance(v), 1e-4));
}

/// Density per solid angle of the lamp's points, which are sampled by area.
double lamp_pdf(double distance, Vec3f direction) {
    return distance * distance / std::abs(double(direction.y)) / kLampArea;
}

void check_hit_candidate(const ReplayCandidate& c, const ReplayVertex& v) {
    REQUIRE(v.emitter == 0);
    CHECK(c.strategy.code == Strategy::make(0, v.depth + 1).code);
    CHECK(names(c.densities) == "opacity pdf_next_event_sa pdf_emission_area pdf_emission_sa");
    CHECK(number(c.densities, "opacity") == 1);
    CHECK(close(number(c.densities, "pdf_next_event_sa"), lamp_pdf(double(v.distance), v.direction), 1e-4));
    CHECK(close(number(c.densities, "pdf_emission_area"), 1 / kLampArea));
    CHECK(close(number(c.densities, "pdf_emission_sa"), cosine(v, v.direction) / kPiDouble, 1e-4));
    CHECK(close(c.value, v.throughput * kLamp));
    CHECK(c.tmax == 0);
}

void check_shadow_ray(const ReplayCandidate& c, const ReplayVertex& v) {
    CHECK(near(c.origin, v.p));
    CHECK(close(double(length(c.direction)), 1));
    CHECK(std::abs(number(c.densities, "distance") - double(c.tmax)) < 2e-4);
}

void check_next_event(const ReplayCandidate& c, const ReplayVertex& v) {
    CHECK(c.strategy.code == Strategy::make(1, v.depth + 1).code);
    CHECK(names(c.densities) == "emitter pdf_next_event_sa distance pdf_bsdf_sa pdf_bsdf_reverse_sa");
    CHECK(number(c.densities, "emitter") == 0);
    check_shadow_ray(c, v);
    const double distance = number(c.densities, "distance"), pdf = lamp_pdf(distance, c.direction);
    CHECK(close(number(c.densities, "pdf_next_event_sa"), pdf, 2e-3));
    CHECK(close(number(c.densities, "pdf_bsdf_sa"), cosine(v, c.direction) / kPiDouble, 2e-3));
    CHECK(close(number(c.densities, "pdf_bsdf_reverse_sa"), cosine(v, v.direction) / kPiDouble, 1e-4));
    CHECK(close(c.value, thrown(v, c.direction) * kLamp / float(pdf), 4e-3));
}

void check_connection(const ReplayCandidate& c, const ReplayVertex& z, const ReplaySubpath& light) {
    REQUIRE(c.light_depth >= 1);
    REQUIRE(c.light_depth <= light.vertices.size());
    const ReplayVertex& y = light.vertices[c.light_depth - 1];
    CHECK(c.light_subpath == light.number);
    CHECK(c.strategy.code == Strategy::make(y.depth + 1, z.depth + 1).code);
    CHECK(names(c.densities) == "distance pdf_eye_sa pdf_eye_reverse_sa pdf_light_sa pdf_light_reverse_sa");
    check_shadow_ray(c, z);
    const double distance = double(length(y.p - z.p));
    const Vec3f w = (y.p - z.p) / float(distance);
    // Vertices are rounded for queues.
    CHECK(close(number(c.densities, "distance"), distance, 1e-3));
    CHECK(std::abs(number(c.densities, "pdf_eye_sa") - cosine(z, w) / kPiDouble) < 1e-3);
    CHECK(std::abs(number(c.densities, "pdf_eye_reverse_sa") - cosine(z, z.direction) / kPiDouble) < 1e-3);
    CHECK(std::abs(number(c.densities, "pdf_light_sa") - cosine(y, w) / kPiDouble) < 1e-3);
    CHECK(std::abs(number(c.densities, "pdf_light_reverse_sa") - cosine(y, y.direction) / kPiDouble) < 1e-3);
    if (distance > 0.1 && cosine(z, w) > 0.1 && cosine(y, w) > 0.1)
        CHECK(close(c.value, thrown(z, w) * thrown(y, w) / float(distance * distance), 2e-2));
}

}  // namespace

TEST_CASE("Densities and values of what an eye subpath finds in a diffuse room are those that geometry gives") {
    for (const char* integrator : {"path", "bdpt"}) {
        CAPTURE(integrator);
        const Replayed r(project_scene("cornell", 24, 16), {integrator, "wavefront", {}});
        std::map<std::string, uint32_t> kinds;
        std::map<ReplayFate, uint32_t> fates;
        r.each_sample(4, 11, [&](const ReplaySample& s) {
            Rgb sum = {0, 0, 0};
            for (const ReplayCandidate& c : s.candidates) {
                REQUIRE(c.eye_depth >= 1);
                REQUIRE(c.eye_depth <= s.eye.vertices.size());
                const ReplayVertex& v = s.eye.vertices[c.eye_depth - 1];
                const std::string kind = c.kind;
                CAPTURE(kind, c.eye_depth, c.light_depth);
                if (kind == "hit")
                    check_hit_candidate(c, v);
                else if (kind == "next event")
                    check_next_event(c, v);
                else
                    check_connection(c, v, s.lights.at(0));
                if (kind != "connection") CHECK(c.light_subpath == kNone);
                check_arrival(c);
                sum += c.contribution;
                ++kinds[kind];
                ++fates[c.fate];
            }
            for (const ReplayVertex& v : s.eye.vertices)
                if (v.scatter.sampled) check_scattering(v);
            CHECK(close(s.eye_sum, sum));
            for (int k = 0; k < 3; ++k) CHECK(s.total[k] == double(s.eye_sum[k]));
        });
        CHECK(kinds.size() == (integrator == std::string("path") ? 2 : 3));
        CHECK(fates.size() == 2);
        CHECK(fates[ReplayFate::blocked] > 0);
    }
}

TEST_CASE("Of the environment the density of next event estimation is told") {
    const Replayed r(scene_from_text("<scene version='3.0.0'><sensor type='perspective'><film type='hdrfilm'><integer "
                                     "name='width' value='4'/><integer name='height' value='4'/></film></sensor>"
                                     "<emitter type='constant'/></scene>"),
                     {"path", "wavefront", {}});
    r.each_sample(1, 1, [&](const ReplaySample& s) {
        REQUIRE(s.candidates.size() == 1);
        CHECK(s.candidates[0].kind == std::string("environment"));
        CHECK(names(s.candidates[0].densities) == "pdf_next_event_sa");
        CHECK(close(number(s.candidates[0].densities, "pdf_next_event_sa"), 1 / (4 * kPiDouble)));
    });
}

}  // namespace ambilux
