// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Replays as a person and a program read them: every line and every field of records made by hand, whose numbers are
// dyadic, so that their text is known.
#include "core/error.h"
#include "render/replay/by_length.h"
#include "render/replay/print.h"
#include "tests/support/catch.h"

namespace ambilux {
namespace {

using json = nlohmann::json;

/// The first two differ from sixteen times a coordinate of the vertices below by little and by nothing.
constexpr std::array<double, 3> kOrigin = {32.5, 16.25, 0};

ReplayVertex diffuse_vertex() {
    ReplayVertex v;
    v.depth = 1;
    v.origin = {2.015625f, 1.015625f, -3};
    v.direction = {0, 0.5f, -1};
    v.throughput = {1, 0.25f, 0.125f};
    v.sums = {{"dvcm", 2}, {"dvc", 0.5}};
    v.miss = false;
    v.distance = 4;
    v.p = {0.5f, 0.25f, -1};
    v.ng = {0, 1, 0};
    v.ns = {0, 0.75f, 0.5f};
    v.prim = 21;
    v.shape = 22;
    v.material = 23;
    v.bsdf = "diffuse";
    v.smooth = true;
    v.scatter = {true, {0.5f, 0, 1}, 0.25f, 0.125f, false, {0.5f, 1, 2}, 1, {true, 0.75f, 0.5f, true}};
    return v;
}

ReplayVertex glass_vertex() {
    ReplayVertex v;
    v.depth = 2;
    v.origin = {0.5f, 0.25f, -1};
    v.direction = {1, 0, 0};
    v.throughput = {2, 2, 2};
    v.sums = {{"dvcm", 8}};
    v.miss = false;
    v.distance = 1.5f;
    v.p = {2, 0.25f, -1};
    v.ng = {-1, 0, 0};
    v.ns = {-1, 0, 0};
    v.prim = 31;
    v.shape = 32;
    v.material = 33;
    v.emitter = 5;
    v.bsdf = "dielectric";
    v.scatter = {true, {0, 0, 1}, 0.0625f, 7, true, {1, 1, 0.5f}, 1.5f, {true, 0.25f, 0.5f, false}};
    v.end = "Russian roulette";
    return v;
}

ReplayVertex miss() {
    ReplayVertex v;
    v.depth = 3;
    v.origin = {2, 0.25f, -1};
    v.direction = {0, 0, 1};
    v.throughput = {4, 4, 4};
    v.sums = {{"pdf_sa", 16}};
    v.end = "the ray leaves the scene";
    return v;
}

ReplayCandidate candidate(const char* kind, Strategy strategy, uint32_t eye_depth, ReplayFate fate) {
    ReplayCandidate c;
    c.kind = kind;
    c.strategy = strategy;
    c.eye_depth = eye_depth;
    c.value = {2, 4, 8};
    c.ratio = 3;
    c.weight = 0.25f;
    c.fate = fate;
    return c;
}

/// With a shadow ray.
ReplayCandidate candidate(const char* kind, Strategy strategy, uint32_t eye_depth, ReplayFate fate, float tmax) {
    ReplayCandidate c = candidate(kind, strategy, eye_depth, fate);
    c.origin = {0.5f, 0.25f, -1};
    c.direction = {0, 1, 0};
    c.tmax = tmax;
    return c;
}

std::vector<ReplayCandidate> found() {
    std::vector<ReplayCandidate> all = {
        candidate("hit", Strategy::make(0, 2), 1, ReplayFate::arrived),
        candidate("next event", Strategy::make(1, 2), 1, ReplayFate::blocked, 3),
        candidate("connection", Strategy::make(2, 3), 2, ReplayFate::culled, 0.5f),
        candidate("next event", Strategy::make(1, 2), 2, ReplayFate::zero),
        candidate("environment", Strategy::make(0, 3), 2, ReplayFate::invalid),
        candidate("connection", Strategy::make(3, 2), 1, ReplayFate::invalid),
        candidate("hit", Strategy::make(0, 2), 1, ReplayFate::arrived),
    };
    all[0].densities = {{"opacity", 1}, {"pdf_emission_area", 0.5}};
    all[0].contribution = {0.5f, 1, 2};
    all[1].contribution = {64, 64, 64};  // of what did not arrive
    all[2].light_subpath = 12;
    all[2].light_depth = 1;
    all[3].value = {};
    all[4].value = {kInfinity, 0, 0};
    all[4].drop = {"mis_weight", "Inf"};
    all[5].value = {};
    all[5].light_subpath = 0;
    all[5].light_depth = 2;
    all[5].drop = {"connect_vertices", "NaN"};
    all[6].contribution = {16, 32, 0.25f};
    return all;
}

ReplayCandidate splat() {
    ReplayCandidate c = candidate("camera", Strategy::make(3, 1), 0, ReplayFate::arrived, 2);
    c.light_subpath = 40;
    c.light_depth = 2;
    c.film = {1.5f, 2.25f};
    c.filter = 0.5f;
    c.contribution = {0.25f, 0.5f, 1};
    return c;
}

ReplaySubpath light_subpath() {
    ReplaySubpath s;
    s.side = Side::light;
    s.number = 40;
    s.part = 2;
    s.start = {17, 12.5f, 7.5f};
    s.emitter = "area";
    s.start_densities = {{"emitter", 0}, {"cos_theta", 0.5}};
    s.vertices = {miss()};
    s.drop = {"light_shade", "negative"};
    return s;
}

ReplaySample sample() {
    ReplaySample s;
    s.x = 3;
    s.y = 5;
    s.sample = 7;
    s.seed = 11;
    s.eye.number = 83;
    s.eye.vertices = {diffuse_vertex(), glass_vertex()};
    s.lights = {light_subpath(), {}};
    s.lights[1].side = Side::light;
    s.lights[1].number = 41;
    s.lights[1].end = "max_depth";
    s.candidates = found();
    s.splats = {splat()};
    s.eye_sum = {0.5f, 1, 2};
    s.splat_sum[0] = 0.25, s.splat_sum[1] = 0.5, s.splat_sum[2] = 1;
    s.total[0] = 0.75, s.total[1] = 1.5, s.total[2] = 3;
    s.drop = {"update_film", "Inf"};
    s.complete = false;
    s.notes = {"first", "second"};
    return s;
}

const char* const kSubpaths =
    R"(eye subpath
    1  ray from (34.515625, 17.2656, -3) along (0, 0.5, -1), throughput (1, 0.25, 0.125)
       meets shape 22 (primitive 21, material 23, diffuse) after 4 at (33, 16.5, -1)
       ng (0, 1, 0), ns (0, 0.75, 0.5); dvcm 2, dvc 0.5
       scattered to (0.5, 0, 1), pdf_sa 0.25, pdf_reverse_sa 0.125, weight (0.5, 1, 2)
       roulette: survival 0.75, u 0.5: survives
    2  ray from (33, 16.5, -1) along (1, 0, 0), throughput (2, 2, 2)
       meets shape 32 (primitive 31, material 33, dielectric, emitter 5) after 1.5 at (34.5, 16.5, -1)
       ng (-1, 0, 0), ns (-1, 0, 0); dvcm 8
       scattered by a delta lobe of probability 0.0625 to (0, 0, 1), weight (1, 1, 0.5), eta 1.5
       roulette: survival 0.25, u 0.5: ends
       ends: Russian roulette
light subpath 40, part 2
    0  starts on emitter of type area, radiance (17, 12.5, 7.5); emitter 0, cos_theta 0.5
    3  ray from (34.5, 16.5, -1) along (0, 0, 1), throughput (4, 4, 4)
       meets nothing; pdf_sa 16
       ends: the ray leaves the scene
       invalid: stage light_shade dropped a throughput or a ray (negative)
light subpath 41
       no ray: max_depth
)";

const char* const kMoved =
    "positions are those of the file; rounding is that of a scene with its origin at (32.5, 16.25, 0)\n";

const char* const kHits[] = {
    R"(  s0t2     hit, eye vertex 1: value (2, 4, 8), ratio 3, weight 0.25
           opacity 1, pdf_emission_area 0.5
           contribution (0.5, 1, 2)
)",
    R"(  s0t2     hit, eye vertex 1: value (2, 4, 8), ratio 3, weight 0.25
           contribution (16, 32, 0.25)
)"};

const char* const kOthers =
    R"(  s1t2     next event, eye vertex 1: value (2, 4, 8), ratio 3, weight 0.25
           shadow ray from (33, 16.5, -1) along (0, 1, 0), 3 long: blocked
           blocked
  s2t3     connection, eye vertex 2, light subpath 12 vertex 1: value (2, 4, 8), ratio 3, weight 0.25
           shadow ray from (33, 16.5, -1) along (0, 1, 0), 0.5 long: not traced
           culled before its shadow ray
  s1t2     next event, eye vertex 2: value (0, 0, 0), ratio 3, weight 0.25
           nothing: value times weight rounds to 0
  s0t3     environment, eye vertex 2: value (inf, 0, 0), ratio 3, weight 0.25
           invalid (Inf): dropped by stage mis_weight
  s3t2     connection, eye vertex 1, light subpath 0 vertex 2
           invalid (NaN): dropped by stage connect_vertices
)";

const char* const kSplat =
    R"(  s3t1     camera, light subpath 40 vertex 2: value (2, 4, 8), ratio 3, weight 0.25
           shadow ray from (33, 16.5, -1) along (0, 1, 0), 2 long: free
           on the film at (1.5, 2.25), filter 0.5
           contribution (0.25, 0.5, 1)
)";

const std::string kHead = "pixel 3,5, sample 7, seed 11\n";
const std::string kSums = R"(by the eye subpath    (0.5, 1, 2)
by splats             (0.25, 0.5, 1)
sample                (0.75, 1.5, 3) without what the notes say is missing
invalid (Inf): dropped by stage update_film
)";

const char* const kVertices = R"([
    {"depth": 1, "origin": [34.515625, 17.265625, -3], "direction": [0, 0.5, -1], "throughput": [1, 0.25, 0.125],
     "sums": {"dvcm": 2, "dvc": 0.5}, "miss": false, "end": null, "distance": 4, "p": [33, 16.5, -1],
     "ng": [0, 1, 0], "ns": [0, 0.75, 0.5], "primitive": 21, "shape": 22, "material": 23, "emitter": null,
     "bsdf": "diffuse", "connectible": true,
     "scatter": {"direction": [0.5, 0, 1], "delta": false, "weight": [0.5, 1, 2], "eta": 1, "pdf_sa": 0.25,
                 "pdf_reverse_sa": 0.125, "roulette": {"survival": 0.75, "u": 0.5, "survived": true}}},
    {"depth": 2, "origin": [33, 16.5, -1], "direction": [1, 0, 0], "throughput": [2, 2, 2], "sums": {"dvcm": 8},
     "miss": false, "end": "Russian roulette", "distance": 1.5, "p": [34.5, 16.5, -1], "ng": [-1, 0, 0],
     "ns": [-1, 0, 0], "primitive": 31, "shape": 32, "material": 33, "emitter": 5, "bsdf": "dielectric",
     "connectible": false,
     "scatter": {"direction": [0, 0, 1], "delta": true, "weight": [1, 1, 0.5], "eta": 1.5, "probability": 0.0625,
                 "roulette": {"survival": 0.25, "u": 0.5, "survived": false}}}])";

const char* const kLights = R"([
    {"number": 40, "part": 2, "emitter": "area", "radiance": [17, 12.5, 7.5],
     "densities": {"emitter": 0, "cos_theta": 0.5},
     "vertices": [{"depth": 3, "origin": [34.5, 16.5, -1], "direction": [0, 0, 1], "throughput": [4, 4, 4],
                   "sums": {"pdf_sa": 16}, "miss": true, "end": "the ray leaves the scene"}],
     "dropped": {"stage": "light_shade", "what": "negative"}, "end": null},
    {"number": 41, "part": 0, "emitter": null, "radiance": [0, 0, 0], "densities": {}, "vertices": [], "dropped": null,
     "end": "max_depth"}])";

const char* const kSplats = R"([
    {"kind": "camera", "s": 3, "t": 1, "eye_depth": 0, "light_depth": 2, "light_subpath": 40, "value": [2, 4, 8],
     "ratio": 3, "weight": 0.25, "densities": {}, "fate": "arrived", "dropped": null, "contribution": [0.25, 0.5, 1],
     "shadow_ray": {"origin": [33, 16.5, -1], "direction": [0, 1, 0], "length": 2}, "film": [1.5, 2.25],
     "filter": 0.5}])";

}  // namespace

TEST_CASE("The text of a sample tells all of its record") {
    ReplaySample s = sample();
    CHECK(replay_text(s, {{}, kOrigin}) == kHead + kMoved + kSubpaths + "found by the eye subpath: 7\n" + kHits[0] +
                                               kOthers + kHits[1] + "splats of light subpaths: 1\n" + kSplat +
                                               "note: first\nnote: second\n" + kSums);
    // Of what there is none nothing is said.
    s = {};
    s.complete = true;
    CHECK(replay_text(s, {}) ==
          "pixel 0,0, sample 0, seed 0\neye subpath\nfound by the eye subpath: 0\n"
          "by the eye subpath    (0, 0, 0)\nsample                (0, 0, 0)\n");
}

TEST_CASE("Of a vertex without scattering nothing more is said than where it lies") {
    ReplaySample s;
    s.eye.vertices = {diffuse_vertex()};
    s.eye.vertices[0].scatter = {};
    const std::string text = replay_text(s, {{}, kOrigin});
    CHECK(text.find("dvc 0.5\nfound by the eye subpath: 0\n") != std::string::npos);
    CHECK(replay_json(s, {})["eye_subpath"]["vertices"][0]["scatter"].is_null());
    s.eye.vertices[0].scatter.sampled = true;
    CHECK(replay_text(s, {}).find("roulette") == std::string::npos);
    CHECK(replay_json(s, {})["eye_subpath"]["vertices"][0]["scatter"]["roulette"].is_null());
}

TEST_CASE("With a strategy the text has its contributions alone, and their sum over what arrived") {
    const auto shown = [](Strategy strategy) { return replay_text(sample(), {strategy, kOrigin}); };
    const std::string notes = "note: first\nnote: second\n";
    CHECK(shown(Strategy::make(0, 2)) == kHead + kMoved + kSubpaths + "found by the eye subpath: 2 of 7\n" + kHits[0] +
                                             kHits[1] + "splats of light subpaths: 0 of 1\n" + notes +
                                             "by strategy s0t2      (16.5, 33, 2.25)\n" + kSums);
    CHECK(shown(Strategy::make(3, 1)) == kHead + kMoved + kSubpaths + "found by the eye subpath: 0 of 7\n" +
                                             "splats of light subpaths: 1 of 1\n" + kSplat + notes +
                                             "by strategy s3t1      (0.25, 0.5, 1)\n" + kSums);
    CHECK(shown(Strategy::make(1, 2)).find("by strategy s1t2      (0, 0, 0)\n") != std::string::npos);
}

TEST_CASE("The JSON of a sample has every field of its record, and null for what is no number") {
    const json j = replay_json(sample(), {{}, kOrigin});
    const json eye = {{"number", 83}, {"vertices", json::parse(kVertices)}, {"dropped", nullptr}};
    CHECK(j["eye_subpath"] == eye);
    CHECK(j["light_subpaths"] == json::parse(kLights));
    CHECK(j["splats"] == json::parse(kSplats));
    json rest = j;
    for (const char* name : {"eye_subpath", "light_subpaths", "candidates", "splats"}) rest.erase(name);
    CHECK(rest == json::parse(R"({"pixel": [3, 5], "sample": 7, "seed": 11, "eye": [0.5, 1, 2],
        "splat_sum": [0.25, 0.5, 1], "total": [0.75, 1.5, 3], "dropped": {"stage": "update_film", "what": "Inf"},
        "scene_origin": [32.5, 16.25, 0], "complete": false, "notes": ["first", "second"]})"));

    const json& c = j["candidates"];
    REQUIRE(c.size() == 7);
    CHECK(c[0] == json::parse(R"({"kind": "hit", "s": 0, "t": 2, "eye_depth": 1, "light_depth": 0,
        "light_subpath": null, "value": [2, 4, 8], "ratio": 3, "weight": 0.25,
        "densities": {"opacity": 1, "pdf_emission_area": 0.5}, "fate": "arrived", "dropped": null,
        "contribution": [0.5, 1, 2]})"));
    CHECK(c[2]["light_subpath"] == 12);
    CHECK(c[2]["shadow_ray"]["length"] == 0.5);
    CHECK(c[4]["value"] == json::parse("[null, 0, 0]"));
    CHECK(c[4]["dropped"] == json::parse(R"({"stage": "mis_weight", "what": "Inf"})"));
    const char* const fates[] = {"arrived", "blocked", "culled", "zero", "invalid", "invalid", "arrived"};
    for (size_t k = 0; k < 7; ++k) CHECK(c[k]["fate"] == fates[k]);

    const json only = replay_json(sample(), {Strategy::make(1, 2), kOrigin});
    CHECK(only["candidates"] == json::array({c[1], c[3]}));
    CHECK(only["splats"].empty());
    CHECK(only["total"] == j["total"]);
}

TEST_CASE("A light subpath alone is printed with its splats") {
    const std::string subpath = std::string(kSubpaths).substr(std::string(kSubpaths).find("light subpath 40"));
    const std::string text = subpath.substr(0, subpath.find("light subpath 41"));
    CHECK(replay_text(light_subpath(), {splat()}, {{}, kOrigin}) == kMoved + text + "splats: 1\n" + kSplat);
    const json j = {
        {"scene_origin", kOrigin}, {"light_subpath", json::parse(kLights)[0]}, {"splats", json::parse(kSplats)}};
    CHECK(replay_json(light_subpath(), {splat()}, {{}, kOrigin}) == j);
}

TEST_CASE("Only a scene that was moved is told to be so, in whichever direction") {
    CHECK_FALSE(ReplayFormat{}.moved());
    for (size_t c = 0; c < 3; ++c) {
        ReplayFormat format;
        format.origin[c] = -0.5;
        CHECK(format.moved());
        std::array<double, 3> at = {1, 2, 3};
        at[c] -= 0.5;
        CHECK(format.in_file({1, 2, 3}) == at);
    }
}

TEST_CASE("Strategies are read as they are written, and nothing else is one") {
    for (const auto& [s, t] : {std::pair{0u, 2u}, {1u, 1u}, {1u, 3u}, {12u, 34u}, {0xffffu, 1u}, {0u, 0xffffu}}) {
        const std::string text = "s" + std::to_string(s) + "t" + std::to_string(t);
        CHECK(strategy_text(Strategy::make(s, t)) == text);
        CHECK(parse_strategy(text).strategy.code == Strategy::make(s, t).code);
        CHECK_FALSE(parse_strategy(text).merged);
    }
    for (const auto& [s, t] : {std::pair{2u, 2u}, {12u, 34u}}) {
        const std::string text = "s" + std::to_string(s) + "+t" + std::to_string(t);
        CHECK(strategy_text({Strategy::make(s, t), true}) == text);
        CHECK(parse_strategy(text).strategy.code == Strategy::make(s, t).code);
        CHECK(parse_strategy(text).merged);
    }
    for (const char* text :
         {"",      "s1",    "st",     "s1t",    "st3",   "t1s3", "x1t3", "s1x3",     "s1t3 ",    "s1 t3",
          " s1t3", "s-1t3", "s1t-3",  "s1t3t4", "s1xt3", "s2t0", "s0t1", "s65536t1", "s1t65536", "s4294967297t2",
          "s1+t2", "s2+t1", "s2++t2", "s+t2",   "s2+2"}) {
        CAPTURE(text);
        try {
            (void)parse_strategy(text);
            FAIL("no error");
        } catch (const Error& e) {
            CHECK(e.code == ExitCode::usage);
            CHECK(e.what() == "--strategy " + std::string(text) +
                                  ": write it as s1t3, one vertex from the light and three from the camera, with t at "
                                  "least 1 and s + t at least 2; merges as s2+t3, with both at least 2");
        }
    }
}

TEST_CASE("A comparison by segments is a table and a sentence") {
    std::vector<LengthComparison> lengths = {{1, false, {1, 2, 4}, {0.5, 0.25, 8}, false},
                                             {12, true, {0, 0, 1.5}, {0, 3, 0}, false}};
    const std::string head = "by segments: rendered, replayed\n", first = "    1  (1, 2, 4), (0.5, 0.25, 8)",
                      second = "   12+ (0, 0, 1.5), (0, 3, 0)",
                      end = "the render and its replay first differ in paths of ",
                      why =
                          ": they part at the last vertex of such a path, or at an earlier one that brought nothing "
                          "to shorter paths\n";
    CHECK(by_length_text(lengths) == head + first + "\n" + second + "\nthe render and its replay agree\n");
    lengths[1].differs = true;
    CHECK(by_length_text(lengths) ==
          head + first + "\n" + second + "  differs\n" + end + "12 segments or more, and agree in shorter ones" + why);
    lengths[0].differs = true;
    CHECK(by_length_text(lengths) == head + first + "  differs\n" + second + "  differs\n" + end + "1 segments" + why);
    lengths.erase(lengths.begin());
    lengths[0] = {2, false, {1, 2, 4}, {0.5, 0.25, 8}, true};
    CHECK(by_length_text(lengths) ==
          head + "    2  (1, 2, 4), (0.5, 0.25, 8)  differs\n" + end + "2 segments, and agree in shorter ones" + why);
}

}  // namespace ambilux
