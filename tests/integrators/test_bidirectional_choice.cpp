// libs: ambilux_session ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// long: tagged
// timeout: 900
// seconds: 71
// bdpt.auto=true: what the pilot predicts is what renders show, and what follows from it.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/error.h"
#include "integrators/reachability.h"
#include "integrators/registry.h"
#include "render/selection.h"
#include "session/stats_sum.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

RenderSettings automatic_settings(const Scene& scene, uint64_t seed = 1) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.integrator = "bdpt";
    s.automatic = true;
    return s;
}

RenderSettings fixed(RenderSettings s, const std::vector<std::pair<std::string, std::string>>& settings) {
    s.automatic = false;
    for (const auto& [key, value] : settings) apply_setting(s, key, value);
    return s;
}

std::vector<PilotCandidate> pilots(const std::vector<SelectionCandidate>& candidates) {
    std::vector<PilotCandidate> p;
    for (const SelectionCandidate& c : candidates) p.push_back(c.pilot);
    return p;
}

struct Mean {
    double mean, error;  ///< standard error
};
Mean mean_of(const std::vector<double>& values) {
    double sum = 0, squares = 0;
    for (const double v : values) sum += v;
    const double n = double(values.size()), mean = sum / n;
    for (const double v : values) squares += (v - mean) * (v - mean);
    return {mean, std::sqrt(squares / (n - 1) / n)};
}

/// Variance of one sample of a pixel, relative to the squared mean of its block and the neighbours, as the pilot scales
/// it; mean over the film.
double relative_variance(const FilmMoments& film, const FilmMoments& truth, uint32_t blocks_x, uint32_t blocks_y) {
    const uint32_t w = film.width / blocks_x, h = film.height / blocks_y;
    double sum = 0;
    for (uint32_t y = 0; y < film.height; ++y)
        for (uint32_t x = 0; x < film.width; ++x)
            for (uint32_t c = 0; c < 3; ++c) {
                const uint32_t x0 = (x / w ? x / w - 1 : 0) * w, x1 = std::min(film.width, (x / w + 2) * w),
                               y0 = (y / h ? y / h - 1 : 0) * h, y1 = std::min(film.height, (y / h + 2) * h);
                double mean = 0;
                for (uint32_t j = y0; j < y1; ++j)
                    for (uint32_t i = x0; i < x1; ++i)
                        mean += truth.mean((size_t(j) * film.width + i) * 3 + c) / ((x1 - x0) * (y1 - y0));
                sum += film.variance((size_t(y) * film.width + x) * 3 + c) / (mean * mean + 0.01);
            }
    return sum / double(film.sum.size());
}

const std::string kGround = "<shape type='rectangle'><transform name='to_world'><scale value='4'/></transform>" +
                            diffuse({0.5f, 0.5f, 0.5f}) + "</shape>";
const std::string kGlassBall =
    "<shape type='sphere'><point name='center' x='0' y='0' z='0.7'/><float name='radius' value='0.5'/><bsdf "
    "type='dielectric'/></shape>";
const std::string kView = "<sensor type='perspective'><float name='fov' value='45'/>" +
                          lookat("origin='0,-3,2.5' target='0,0,0.3' up='0,0,1'") + film(32) + "</sensor>";

}  // namespace

TEST_CASE("second moments that the pilot predicts are those of renders, for every candidate") {
    // Splats of light tracing are spread by the filter, eye subpaths are not.
    for (const char* filter : first_or_all<const char*>(1, {"gaussian", "box"})) {
        const std::string text = "<sensor type='perspective'><float name='fov' value='45'/>" +
                                 lookat("origin='0,-3,2.5' target='0,0,0.3' up='0,0,1'") + film(32, filter) +
                                 "</sensor>" + kGround +
                                 "<shape type='cube'><transform name='to_world'><scale value='0.3'/><translate "
                                 "x='-0.4' z='0.5'/></transform>" +
                                 diffuse({0.8f, 0.5f, 0.3f}) + "</shape>" +
                                 "<shape type='rectangle'><transform name='to_world'><scale value='0.5'/><rotate x='1' "
                                 "angle='180'/><translate z='2.4'/></transform>" +
                                 diffuse({0, 0, 0}) + area_light({4, 5, 3}) + "</shape>";
        const Scene scene = scene_from_text(scene_xml(5, text));
        RenderSettings s = automatic_settings(scene);
        const auto candidates = selection_candidates(s, false);
        SharedAccels accels(scene);
        std::vector<std::vector<double>> predicted(candidates.size());
        uint32_t bx = 0, by = 0;
        for (uint64_t seed = 1; seed <= 12; ++seed) {
            s.seed = seed;
            const Pilot pilot = run_pilot(scene, s, false, false, accels, pilots(candidates), 16384);
            bx = pilot.blocks_x;
            by = pilot.blocks_y;
            for (size_t c = 0; c < candidates.size(); ++c) {
                double sum = 0;
                for (const double v : pilot.variance[c]) sum += v;
                predicted[c].push_back(sum / double(pilot.variance[c].size()));
            }
        }
        s.seed = 77;
        const FilmMoments truth = render_scene(scene, fixed(s, {{"variant", "lvc"}}), 1024).film;
        for (size_t c = 0; c < candidates.size(); ++c) {
            if (candidates[c].offer.worth != candidates[c].offer.draws)
                continue;  // predicted by what other draws are worth
            std::vector<double> measured;
            const auto renderer = make_renderer(scene, fixed(s, candidates[c].settings));
            const uint32_t samples = candidates[c].name.starts_with("path") ? 64 : 16;  // its noise has long tails
            for (uint32_t k = 0; k < 12; ++k) {
                renderer->clear_film();
                renderer->render(k * samples, samples);
                measured.push_back(relative_variance(renderer->film(), truth, bx, by));
            }
            const Mean p = mean_of(predicted[c]), m = mean_of(measured);
            INFO(filter << " " << candidates[c].name << ": predicted " << p.mean << " +- " << p.error << ", measured "
                        << m.mean << " +- " << m.error);
            // One in 100 beside the errors: block means of a pilot are noisy, and light subpaths of a wave are shared.
            CHECK(std::abs(p.mean - m.mean) < 4.5 * std::hypot(p.error, m.error) + 0.015 * m.mean);
            CHECK(std::hypot(p.error, m.error) < 0.04 * m.mean);
        }
    }
}

TEST_CASE("what is chosen renders as if its settings had been given: the pilot leaves nothing in the image") {
    for (const char* name : {"cornell", "glass", "lights", "materials"}) {
        const Scene scene = project_scene(name, 40, 30);
        const RenderSettings s = automatic_settings(scene, 5);
        const RenderResult chosen = render_scene(scene, s, 4);
        const SelectionStats& selection = chosen.stats.selection;
        INFO(name << ": " << selection.name);
        REQUIRE_FALSE(selection.name.empty());
        CHECK(selection.seconds > 0);
        CHECK(selection.candidates.size() == 23);
        const RenderResult again = render_scene(scene, fixed(s, selection.settings), 4);
        CHECK(again.stats.selection.name.empty());
        CHECK(worst_difference(again.film, mean_image(chosen.film)) < 1e-5);
        CHECK(again.stats.rays_extend == chosen.stats.rays_extend);
        CHECK(again.stats.samples == chosen.stats.samples);
        // Every candidate has the same expectation (other tests); these once more, but for glass, whose rare hits of
        // the lamp would need too many samples.
        if (name == std::string("glass")) continue;
        RenderSettings reference = cpu_settings(scene, Estimator::mis, 99);
        reference.integrator = "bdpt";
        const ZTestResult z = z_test(render_batches(scene, s, 256), render_batches(scene, reference, 256));
        INFO(z.report());
        CHECK(z.pass);
    }
}

TEST_CASE("light subpaths run where they find what eye subpaths do not, and only there") {
    const auto name_of = [](const Scene& scene, uint64_t seed) {
        RenderSettings s = automatic_settings(scene, seed);
        s.deterministic = true;
        return make_renderer(scene, s)->stats().selection.name;
    };
    for (uint64_t seed = 1; seed <= 4; ++seed) {
        INFO("seed " << seed);
        CHECK(name_of(project_scene("glass", 64, 48), seed) != "path");
        // A sky over diffuse ground: most light subpaths miss what the camera sees, and next event estimation is all
        // that is needed.
        const Scene sky = scene_from_text(
            scene_xml(4, kView + kGround + "<emitter type='constant'><rgb name='radiance' value='1,1,1'/></emitter>"));
        CHECK(name_of(sky, seed) == "path");
    }
}

TEST_CASE("the error is predicted for the samples that the render will take") {
    PilotWork work;
    work.eye_rays = 3;
    work.next_events = 2.5;  // 5 rays of subpaths together
    RenderSettings s;
    CHECK(expected_samples(s, work, 10000, false) == 1000);
    s.expected_seconds = 2;
    CHECK(expected_samples(s, work, 10000, false) == Approx(400));    // 1e7 rays a second
    CHECK(expected_samples(s, work, 10000, true) == Approx(200000));  // 5e9
    CHECK(expected_samples(s, work, 1000000000, false) == 64);
    s.expected_samples = 333;  // and the time besides: it ends when it has both
    CHECK(expected_samples(s, work, 10000, false) == Approx(400));
    s.expected_samples = 4000;
    CHECK(expected_samples(s, work, 10000, false) == 4000);
    s.expected_seconds = 0;
    s.expected_samples = 1;
    CHECK(expected_samples(s, work, 10000, true) == 64);
    s.expected_samples = ~uint64_t(0);
    CHECK(expected_samples(s, work, 10000, true) == 1e6);
    CHECK(expected_samples({}, PilotWork{}, 0, true) == 1000);

    // Below a glass ball a path tracer meets the small lamp once in many samples. As long as that makes single bright
    // pixels, they are left out; later they are its noise.
    const Scene scene = project_scene("glass", 64, 48);
    double before = 0;
    for (const uint64_t samples : {64u, 2000u}) {
        s = automatic_settings(scene);
        s.expected_samples = samples;
        const SelectionStats selection = make_renderer(scene, s)->stats().selection;
        INFO(samples << " samples: " << selection.name);
        REQUIRE(selection.candidates[0].name == "path");
        CHECK(selection.expected_samples == double(samples));
        CHECK(selection.candidates[0].variance > before);
        before = selection.candidates[0].variance;
    }
}

TEST_CASE(
    "speckles that light tracing finds: with few samples the path tracer leaves them out, with many it pays for them",
    "[data][long]") {
    const std::optional<Scene> scene = published_scene("veach-mis", 160, 90);
    if (!scene) return;
    for (uint64_t seed = 1; seed <= 4; ++seed) {
        RenderSettings s = automatic_settings(*scene, seed);
        s.deterministic = true;
        s.expected_samples = 100;
        const SelectionStats few = make_renderer(*scene, s)->stats().selection;
        s.expected_samples = 20000;
        const SelectionStats many = make_renderer(*scene, s)->stats().selection;
        INFO("seed " << seed << ": " << few.name << ", " << many.name);
        CHECK(few.candidates[0].efficiency > 0.6);
        // Equal time: 0.19 on an H200 at 640x360 (docs/performance.md).
        CHECK(many.name != "path");
        CHECK(many.candidates[0].efficiency < 0.5);
    }
}

TEST_CASE("behind a door ajar draws learn, if the render is long enough for it", "[data][long]") {
    const std::optional<Scene> scene = published_scene("veach-ajar", 160, 90);
    if (!scene) return;
    for (uint64_t seed = 1; seed <= 4; ++seed) {
        RenderSettings s = automatic_settings(*scene, seed);
        s.expected_samples = 64;
        const SelectionStats selection = make_renderer(*scene, s)->stats().selection;
        INFO("seed " << seed << ": " << selection.name);
        CHECK(selection.name.find("learned") != std::string::npos);
    }
    RenderSettings s = automatic_settings(*scene);
    const auto learning = [&](bool cuda) {
        const auto all = selection_candidates(s, cuda);
        return std::count_if(all.begin(), all.end(),
                             [](const SelectionCandidate& c) { return c.offer.least_subpaths > 0; });
    };
    CHECK(learning(false) == 3);
    CHECK(learning(true) == 3);
    s.technique_depth = 4;
    CHECK(learning(false) == 0);
    const Scene small = *published_scene("veach-ajar", 32, 18);
    s = automatic_settings(small);
    s.expected_samples = 64;
    for (const auto& c : make_renderer(small, s)->stats().selection.candidates)
        CHECK((c.excluded == "has too few samples to learn from") == (c.name.find("learned") != std::string::npos));
}

TEST_CASE("draws learn in renders of a quarter of a million eye subpaths or more") {
    for (const uint32_t height : {64u, 63u}) {
        const Scene scene = project_scene("cornell", 64, height);
        RenderSettings s = automatic_settings(scene);
        s.expected_samples = 64;
        int learning = 0;
        for (const auto& c : make_renderer(scene, s)->stats().selection.candidates) {
            INFO(height << " " << c.name);
            const bool learns = c.name.find("learned") != std::string::npos;
            learning += learns;
            CHECK(c.excluded == (learns && height < 64 ? "has too few samples to learn from" : ""));
        }
        CHECK(learning == 3);
    }
}

TEST_CASE("a candidate that cannot find some of the light is never chosen") {
    const Scene scene = scene_from_text(scene_xml(6, kView + kGround + kGlassBall +
                                                         "<emitter type='point'><point name='position' x='0.5' y='0.2' "
                                                         "z='3'/><rgb name='intensity' value='5,5,5'/></emitter>"));
    RenderSettings s = automatic_settings(scene);
    const SelectionStats selection = make_renderer(scene, s)->stats().selection;
    REQUIRE(selection.candidates[0].name == "path");
    CHECK(std::isinf(selection.candidates[0].variance));
    CHECK(selection.candidates[0].efficiency == 0);
    CHECK(selection.candidates[0].excluded == "cannot find paths such as Ld S D E");
    REQUIRE(selection.candidates[1].name.find("bdpt without connections") == 0);
    CHECK(selection.candidates[1].excluded == "cannot find paths such as Ld S D D S E");
    CHECK(selection.name != "path");
}

namespace {

/// A narrow spot lamp shines through a small glass bead onto ground under a bright sky. Light subpaths pick the lamp
/// about once in 1e4 times, so that a pilot may not meet it at all.
Scene bead_scene() {
    return scene_from_text(scene_xml(
        6,
        "<sensor type='perspective'><float name='fov' value='8'/>" +
            lookat("origin='0,-2,1.5' target='0,0,0' up='0,0,1'") + film(16) + "</sensor>" +
            "<shape type='rectangle'>" + diffuse({0.5f, 0.5f, 0.5f}) + "</shape>" +
            "<shape type='sphere'><point name='center' x='0' y='0' z='0.5'/><float name='radius' value='0.05'/><bsdf "
            "type='dielectric'/></shape>"
            "<emitter type='spot'><transform name='to_world'><lookat origin='0,0,1' target='0,0,0' "
            "up='0,1,0'/></transform><rgb name='intensity' value='0.4,0.4,0.4'/><float name='cutoff_angle' "
            "value='3'/></emitter>"
            "<emitter type='constant'><rgb name='radiance' value='0.25,0.25,0.25'/></emitter>"));
}

}  // namespace

TEST_CASE("a spot lamp behind a glass bead: no seed chooses a path tracer, and the selection finds all light") {
    const Scene scene = bead_scene();
    for (uint64_t seed = 1; seed <= 8; ++seed) {
        RenderSettings s = automatic_settings(scene, seed);
        s.deterministic = true;
        const SelectionStats selection = make_renderer(scene, s)->stats().selection;
        INFO("seed " << seed);
        CHECK(selection.name != "path");
    }
    RenderSettings s = automatic_settings(scene, 1), all = cpu_settings(scene, Estimator::mis, 99);
    all.integrator = "bdpt";
    constexpr uint32_t kSamples = 1u << 14;
    const Estimate truth = render_batches(scene, all, kSamples);
    ZTestOptions options;
    options.block = 16;
    check_agreement(scene, s, kSamples, truth, 0.05, options);
    // What a path tracer leaves out would be seen.
    const ZTestResult z =
        z_test(render_batches(scene, cpu_settings(scene, Estimator::mis, 5), kSamples / 4), truth, options);
    INFO(z.report());
    CHECK_FALSE(z.pass);
}

TEST_CASE("the selection repeats: it depends on the seed, and on clocks only where it says so") {
    const Scene scene = project_scene("materials", 40, 30);
    RenderSettings s = automatic_settings(scene, 3);
    s.deterministic = true;
    const SelectionStats a = make_renderer(scene, s)->stats().selection, b = make_renderer(scene, s)->stats().selection;
    s.accel = "cwbvh";
    const SelectionStats other_rays = make_renderer(scene, s)->stats().selection;
    s.seed = 4;
    const SelectionStats other_seed = make_renderer(scene, s)->stats().selection;
    CHECK(a.name == b.name);
    for (size_t c = 0; c < a.candidates.size(); ++c) {
        CHECK(a.candidates[c].variance == b.candidates[c].variance);
        CHECK(a.candidates[c].work == b.candidates[c].work);
        CHECK(a.candidates[c].seconds == 0);
        CHECK(other_rays.candidates[c].variance == Approx(a.candidates[c].variance).epsilon(0.05));
        CHECK(other_seed.candidates[c].variance != a.candidates[c].variance);
    }
}

namespace {

/// What a device does, by renderers of the host.
struct Counted : Renderer {
    Counted(std::unique_ptr<Renderer> r, int& l) : renderer(std::move(r)), living(l) { ++living; }
    ~Counted() override { --living; }
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        return renderer->render(first, count, interrupt);
    }
    FilmMoments film() override { return renderer->film(); }
    void clear_film() override { renderer->clear_film(); }
    RenderStats stats() override { return renderer->stats(); }
    uint32_t preferred_batch() const override { return 4; }
    std::unique_ptr<Renderer> renderer;
    int& living;
};

/// Efficiencies are those of the times of two candidates, which their families share by the work of each. Others have
/// the time of what is best by its work, and are behind.
void check_efficiencies(const std::vector<SelectionCandidate>& all, const SelectionStats& selection) {
    const std::vector<SelectionStats::Candidate>& of = selection.candidates;
    REQUIRE(of.size() == all.size());
    std::vector<size_t> timed;
    size_t chosen = 0;
    for (size_t c = 0; c < of.size(); ++c) {
        CHECK(of[c].name == all[c].name);
        if (of[c].seconds > 0) timed.push_back(c);
        if (of[c].name == selection.name) chosen = c;
    }
    REQUIRE(timed.size() == 2);
    if (of[timed[1]].variance * of[timed[1]].work < of[timed[0]].variance * of[timed[0]].work)
        std::swap(timed[0], timed[1]);
    const auto family = [&](size_t c) {
        const PilotCandidate& p = all[c].pilot;
        return std::tuple(p.light_subpaths > 0, p.connect, p.draws > 0);
    };
    const auto score = [&](size_t c) {
        const size_t like = timed[family(c) == family(timed[1]) ? 1 : 0];
        const double behind = family(c) == family(like) ? 1 : 1.3;
        return of[c].variance * of[like].seconds * of[c].work / of[like].work * behind;
    };
    for (size_t c = 0; c < of.size(); ++c) {
        INFO(of[c].name);
        CHECK(of[c].efficiency == (std::isfinite(of[c].variance) ? Approx(score(chosen) / score(c)) : Approx(0)));
        CHECK(of[c].efficiency <= 1);
    }
    std::string settings;
    for (const auto& [key, value] : selection.settings) settings += (settings.empty() ? "" : " ") + key + "=" + value;
    CHECK(of[chosen].settings == settings);
}

}  // namespace

TEST_CASE("a path tracer that renders while the pilot runs makes room for a candidate that has none beside it") {
    bool some_timed = false;
    for (const char* name : {"cornell", "glass", "lights", "materials"}) {
        const Scene scene = project_scene(name, 48, 32);
        RenderSettings s = automatic_settings(scene, 5);
        s.variant = "megakernel";  // whose time does not follow from its work
        s.expected_seconds = 1;
        for (const bool small : {false, true}) {
            int living = 0, refused = 0;
            SharedAccels accels(scene);
            const auto make = [&](const RenderSettings& chosen) -> std::unique_ptr<Renderer> {
                if (small && living > 0) {
                    ++refused;
                    throw Error(ExitCode::device, "no room");
                }
                return std::make_unique<Counted>(make_renderer(scene, chosen), living);
            };
            const auto renderer = make_automatic(scene, s, true, accels, make);
            const SelectionStats selection = renderer->stats().selection;
            INFO(name << (small ? ", small: " : ", large: ") << selection.name << ", ready " << renderer->ready());
            const bool timed = std::any_of(selection.candidates.begin(), selection.candidates.end(),
                                           [](const SelectionStats::Candidate& c) { return c.seconds > 0; });
            some_timed |= timed;
            CHECK(living == 1);
            CHECK(refused == (small && timed ? 1 : 0));
            CHECK((renderer->ready() > 0) == (selection.name == "path" && !(small && timed)));
            CHECK(selection.seconds >= 0);
            const uint32_t samples = renderer->ready() + 2;
            REQUIRE(renderer->render(0, samples) == samples);
            const FilmMoments film = renderer->film();
            CHECK(film.samples == samples);
            CHECK(worst_difference(render_scene(scene, fixed(s, selection.settings), samples).film, mean_image(film)) <
                  1e-5);
        }
    }
    CHECK(some_timed);
}

TEST_CASE("candidates of a device are timed by a full wave, or by the samples of one where memory is limited") {
    constexpr uint32_t kPixels = 48 * 32;
    const Scene scene = project_scene("lights", 48, 32);
    SharedAccels accels(scene);
    for (const uint64_t memory : {uint64_t(0), uint64_t(1) << 30}) {
        CAPTURE(memory);
        RenderSettings s = automatic_settings(scene, 5);
        s.variant = "megakernel";
        s.memory = memory;
        int living = 0;
        std::vector<RenderSettings> made;
        const auto make = [&](const RenderSettings& chosen) -> std::unique_ptr<Renderer> {
            made.push_back(chosen);
            return std::make_unique<Counted>(make_renderer(scene, chosen), living);
        };
        const SelectionStats selection = make_automatic(scene, s, true, accels, make)->stats().selection;
        INFO(selection.name);
        check_efficiencies(selection_candidates(s, true), selection);
        REQUIRE(made.size() == 3);
        for (size_t i = 0; i < 2; ++i) {
            const uint32_t paths = variant_of(made[i]).traits.light_subpaths ? 1u << 21 : 1u << 22;
            CHECK(made[i].expected_samples == (memory ? paths / kPixels : 0));
            CHECK(made[i].wave_size == (memory ? 0 : paths));
        }
        CHECK(made[2].expected_samples == 0);
        CHECK(made[2].wave_size == 0);
    }
}

TEST_CASE("what a device has no room for is not chosen: the next best runs") {
    const Scene scene = project_scene("glass", 48, 32);
    const RenderSettings s = automatic_settings(scene, 5);
    SharedAccels accels(scene);
    uint32_t asked = 0;
    const auto make = [&](const RenderSettings& chosen) -> std::unique_ptr<Renderer> {
        if (asked++ == 0) throw Error(ExitCode::device, "no room");
        return make_renderer(scene, chosen);
    };
    const auto renderer = make_automatic(scene, s, true, accels, make);
    const SelectionStats selection = renderer->stats().selection;
    INFO(selection.name);
    CHECK(asked == 2);
    CHECK(std::count_if(selection.candidates.begin(), selection.candidates.end(),
                        [](const SelectionStats::Candidate& c) { return c.efficiency > 1; }) == 1);
    REQUIRE(renderer->render(0, 2) == 2);
    CHECK(worst_difference(render_scene(scene, fixed(s, selection.settings), 2).film, mean_image(renderer->film())) <
          1e-5);
    CHECK_THROWS_WITH(make_automatic(scene, s, true, accels,
                                     [](const RenderSettings&) -> std::unique_ptr<Renderer> {
                                         throw Error(ExitCode::device, "no room at all");
                                     }),
                      ContainsSubstring("no room at all"));
}

TEST_CASE("variants restrict the selection; other settings that it would make are refused by name") {
    const Scene scene = project_scene("cornell", 24, 24);
    RenderSettings s = automatic_settings(scene);
    s.variant = "lvc";
    CHECK(selection_candidates(s, false).size() == 19);
    s.variant = "streaming";
    REQUIRE(selection_candidates(s, false).size() == 3);
    CHECK(make_renderer(scene, s)->stats().selection.candidates[2].name == "bdpt, streaming");
    s.variant = "wavefront";
    s.deterministic = true;
    CHECK(selection_candidates(s, false).size() == 23);
    CHECK(selection_candidates(s, true).size() == 5);  // a cache on a device has another order in every run
    const auto refused = [&](const std::string& key, const std::string& value, const std::string& part) {
        RenderSettings other = automatic_settings(scene);
        apply_setting(other, key, value);
        try {
            make_renderer(scene, other);
            FAIL("not refused: " << key << "=" << value);
        } catch (const Error& error) {
            CHECK(error.code == ExitCode::usage);
            INFO(error.what());
            CHECK(std::string(error.what()).find(part) != std::string::npos);
        }
    };
    refused("integrator", "path", "integrator path");
    refused("integrator", "light", "integrator light");
    refused("strategies", "hits+next_event", "strategies");
    refused("strategies", "s1t2", "strategies");
    refused("connections", "2", "connections=2");
    refused("light_paths", "0.5", "light_paths=0.5");
    refused("technique_depth", "4", "technique_depth=4");
    CHECK_THROWS_AS(apply_setting(s, "bdpt.auto", "yes"), Error);
}

TEST_CASE("how light vertices are drawn can be set beside the selection, whichever candidate that is") {
    const Scene glass = project_scene("glass", 48, 32);
    const Scene sky = scene_from_text(
        scene_xml(4, kView + kGround + "<emitter type='constant'><rgb name='radiance' value='1,1,1'/></emitter>"));
    for (const Scene* scene : {&glass, &sky}) {
        RenderSettings s = automatic_settings(*scene, 2);
        s.deterministic = true;
        const RenderResult chosen = render_scene(*scene, s, 2);
        INFO(chosen.stats.selection.name);
        s.draws = CacheDraws::independent;  // what the CPU does anyway
        const RenderResult set = render_scene(*scene, s, 2);
        CHECK(set.stats.selection.name == chosen.stats.selection.name);
        CHECK(set.film.sum == chosen.film.sum);
    }
}

TEST_CASE("allow=consistent: merging is compared with the best of the others, and chosen where it alone finds light") {
    const auto merging = [](const RenderResult& r) {
        const auto& all = r.stats.selection.candidates;
        const auto at = std::find_if(all.begin(), all.end(), [](const auto& c) { return c.name == "vcm"; });
        return at == all.end() ? nullptr : &*at;
    };
    const Scene glass = project_scene("glass", 24, 16);
    RenderSettings s = automatic_settings(glass);
    CHECK(merging(render_scene(glass, s, 2)) == nullptr);
    apply_setting(s, "allow", "consistent");
    const RenderResult r = render_scene(glass, s, 2);
    REQUIRE(merging(r));
    CHECK(merging(r)->seconds > 0);
    CHECK(std::isfinite(merging(r)->variance));
    CHECK((merging(r)->efficiency > 1) == false);  // none is better than the selection
    s.deterministic = true;
    CHECK(merging(render_scene(glass, s, 2))->excluded == "is compared by the clock");
    s.deterministic = s.automatic = false;
    CHECK_THROWS_WITH(make_renderer(glass, s), ContainsSubstring("bdpt.auto=true alone"));

    const Scene pane = scene_from_text(scene_xml(
        4, kView + kGround +
               "<emitter type='point'><point name='position' x='0.5' y='0' z='1.5'/></emitter><shape type='rectangle'>"
               "<transform name='to_world'><scale value='9'/><translate z='0.4'/></transform><bsdf "
               "type='thindielectric'/></shape>"));
    RenderSettings of_pane = automatic_settings(pane);
    apply_setting(of_pane, "allow", "consistent");
    const RenderResult seen = render_scene(pane, of_pane, 2);
    CHECK(seen.stats.selection.name == "vcm");
    CHECK(seen.stats.selection.candidates[0].excluded.find("cannot find paths") == 0);

    // Light that others find by single hits: their few samples show none of it, and the pilot knows of it.
    const Scene caustic = project_scene("mirror_caustic", 32, 32);
    RenderSettings of_caustic = automatic_settings(caustic);
    CHECK(render_scene(caustic, of_caustic, 2).stats.selection.name != "vcm");
    apply_setting(of_caustic, "allow", "consistent");
    CHECK(render_scene(caustic, of_caustic, 2).stats.selection.name == "vcm");
}

TEST_CASE("nothing to see: scenes without emitters and films of one pixel") {
    const Scene dark = scene_from_text(scene_xml(4, kView + kGround));
    CHECK(render_scene(dark, automatic_settings(dark), 2).stats.selection.name == "path");
    const Scene pixel = project_scene("cornell", 1, 1);
    CHECK(render_scene(pixel, automatic_settings(pixel), 2).stats.selection.candidates.size() == 23);
}

TEST_CASE("saved statistics keep the selection, and a later part does not lose it") {
    RenderStats first;
    first.selection = {"bdpt, lvc, 2 connections",
                       {{"integrator", "bdpt"}, {"connections", "2"}},
                       0.25,
                       8192,
                       640,
                       {{"path", "integrator=path", std::numeric_limits<double>::infinity(), 3, 0, 0, "Ld S D E"}}};
    RenderStats total;
    add_part(total, {}, first);
    total = restore_stats(nlohmann::json::parse(save_stats(total).dump()));
    add_part(total, {}, {});
    CHECK(total.selection.name == first.selection.name);
    CHECK(total.selection.settings == first.selection.settings);
    CHECK(total.selection.seconds == 0.25);
    CHECK(total.selection.expected_samples == 640);
    REQUIRE(total.selection.candidates.size() == 1);
    CHECK(std::isinf(total.selection.candidates[0].variance));
    CHECK(total.selection.candidates[0].excluded == "Ld S D E");
}
