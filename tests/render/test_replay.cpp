// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// A replay brings the sample that a render made, by every integrator and variant that has one: bit by bit where the
// render's kernels hold all features as those of replays do, within rounding where they are specialised.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "render/replay/by_length.h"
#include "render/replay/outliers.h"
#include "render/replay/print.h"
#include "tests/support/replay_settings.h"
#include "tests/support/spherical_scene.h"

namespace ambilux {
namespace {

/// The image of one sample, or of the iteration that begins with it.
FilmMoments one_sample(const Scene& scene, const RenderSettings& settings, uint32_t sample) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    const uint32_t together = renderer->iteration_samples();
    // What a method has learned is part of a sample.
    const bool learns = renderer->state_kind() == StateKind::per_device;
    if (learns && sample > 0) REQUIRE(renderer->render(0, sample) == sample);
    renderer->clear_film();
    REQUIRE(renderer->render(sample, together) == together);
    CHECK(renderer->stats().invalid.total() == 0);
    return renderer->film();
}

size_t brightest(const FilmMoments& film) {
    size_t at = 0;
    for (size_t i = 0; i < film.sum.size(); ++i)
        if (film.sum[i] > film.sum[at]) at = i;
    return at / 3;
}

/// Pixels of a film, `step` apart, and the brightest.
std::vector<uint32_t> pixels_of(const FilmMoments& film, uint32_t step) {
    std::vector<uint32_t> pixels = {uint32_t(brightest(film))};
    for (uint32_t p = 0; p < film.width * film.height; p += step) pixels.push_back(p);
    return pixels;
}

/// A float more or less in each of some dozens of sums and products, and a unit of splats.
bool close(double a, double b) { return std::abs(a - b) <= 1e-5 * std::abs(b) + 1e-10; }

/// Every sample of a replay is the render's. Returns how many of them were not black.
uint32_t check_samples(const Scene& scene, const RenderSettings& settings, uint32_t sample, uint32_t step) {
    const FilmMoments film = one_sample(scene, settings, sample);
    SharedAccels accels(scene);
    const std::unique_ptr<Replay> replay = make_replay(scene, settings, accels);
    uint32_t lit = 0;
    for (const uint32_t pixel : pixels_of(film, step)) {
        ReplayRequest request = {pixel % film.width, pixel / film.width, sample, {}, true, true};
        ReplaySample r = replay->sample(request);
        while (++request.sample < sample + replay->iteration_samples()) {
            const ReplaySample other = replay->sample(request);
            for (uint32_t c = 0; c < 3; ++c) r.total[c] += other.total[c];
        }
        CAPTURE(pixel, r.total[0], r.total[1], r.total[2], film.sum[pixel * 3], r.eye_sum.x, r.splat_sum[0]);
        CHECK(r.complete);
        bool equal = true;
        for (uint32_t c = 0; c < 3; ++c) {
            const double rendered = film.sum[pixel * 3 + c];
            equal = equal && (settings.specialise ? close(r.total[c], rendered) : r.total[c] == rendered);
        }
        CHECK(equal);
        lit += r.total[0] + r.total[1] + r.total[2] > 0;
    }
    return lit;
}

/// Segments of the longest path that a replay finds.
uint32_t longest_of(const ReplaySample& r) {
    size_t longest = r.eye.vertices.size();
    for (const auto* all : {&r.candidates, &r.splats})
        for (const ReplayCandidate& c : *all) longest = std::max<size_t>(longest, c.strategy.segments());
    return uint32_t(longest);
}

const ReplayConfig kPaths[] = {
    {"path", "wavefront", {}},
    {"path", "wavefront", {{"estimator", "nee"}}},
    {"path", "wavefront", {{"estimator", "naive"}}},
    {"path", "wavefront", {{"heuristic", "power"}, {"rr_depth", "1"}, {"rr_cap", "0.6"}}},
    {"path", "wavefront", {{"cull", "0.3"}}},
    {"path", "wavefront", {{"accel", "cwbvh"}}},
    {"path", "ris", {}},
    {"path", "ris", {{"heuristic", "power"}, {"rr_depth", "1"}}},
};
const ReplayConfig kBidirectional[] = {
    {"light", "wavefront", {}},
    {"light", "wavefront", {{"light_paths", "1.5"}, {"rr_depth", "1"}}},
    {"bdpt", "wavefront", {}},
    {"bdpt", "wavefront", {{"heuristic", "power"}, {"rr_depth", "1"}, {"rr_cap", "0.6"}, {"cull", "0.3"}}},
    {"bdpt", "wavefront", {{"strategies", "next_event+connections"}}},
    {"bdpt", "wavefront", {{"fuse", "none"}}},
    {"bdpt", "lvc", {}},
    {"bdpt", "lvc", {{"heuristic", "power"}, {"rr_depth", "1"}}},
    {"bdpt", "lvc", {{"connections", "1"}, {"light_paths", "2.25"}}},
    {"bdpt", "lvc", {{"wave_size", "128"}}},
    {"bdpt", "streaming", {}},
    {"bdpt", "streaming", {{"heuristic", "power"}, {"rr_depth", "1"}, {"cull", "0.3"}}},
    {"bdpt", "megakernel", {}},
    {"bdpt", "megakernel", {{"heuristic", "power"}, {"rr_depth", "1"}}},
};
const ReplayConfig kMerging[] = {
    {"vcm", "wavefront", {}},
    {"vcm", "wavefront", {{"merge_samples", "4"}, {"light_paths", "1.5"}}},
    {"vcm", "wavefront", {{"heuristic", "power"}, {"rr_depth", "1"}, {"cull", "0.3"}, {"merge_first", "false"}}},
    {"bpm", "wavefront", {}},
    {"ppm", "wavefront", {}},
    {"sppm", "wavefront", {{"merge_radius", "0.05"}}},
    {"pm", "wavefront", {{"merge_samples", "4"}}},
};

const ReplayConfig kGuided[] = {
    {"path", "guided", {{"guide_samples", "2"}, {"guide_split", "16"}, {"guide_leaves", "64"}}},
    {"path", "guided", {{"guide_samples", "1"}, {"guide_target", "moment"}, {"estimator", "nee"}}},
    {"bdpt",
     "guided",
     {{"guide_samples", "2"}, {"guide_split", "16"}, {"guide_leaves", "64"}, {"guide_sides", "both"}}},
    {"bdpt", "guided", {{"guide_samples", "2"}, {"guide_sides", "light"}, {"rr_depth", "1"}}},
    {"bdpt", "guided", {{"guide_samples", "1"}, {"heuristic", "power"}, {"rr_depth", "1"}, {"connections", "1"}}},
};

}  // namespace

TEST_CASE("A replayed sample of the path tracer is the render's, bit by bit with full kernels") {
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured", "furnace"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const ReplayConfig& c : kPaths)
            for (const bool specialise : {false, true}) {
                CAPTURE(name, text_of(c), specialise);
                RenderSettings settings = settings_of(scene, c);
                settings.specialise = specialise;
                CHECK(check_samples(scene, settings, 5, 1) > 0);
            }
    }
}

TEST_CASE("A replayed guided path follows what the render had learned, after training and after iterations") {
    for (const char* name : {"cornell", "glass", "materials"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const ReplayConfig& c : kGuided)
            for (const uint32_t sample : {0u, 6u}) {
                CAPTURE(name, text_of(c), sample);
                RenderSettings settings = settings_of(scene, c);
                settings.specialise = false;
                CHECK(check_samples(scene, settings, sample, 97) > 0);
            }
    }
}

TEST_CASE("A replayed sample of light tracing and of bdpt is the render's, bit by bit with full kernels") {
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const ReplayConfig& c : kBidirectional)
            for (const bool specialise : {false, true}) {
                CAPTURE(name, text_of(c), specialise);
                RenderSettings settings = settings_of(scene, c);
                settings.specialise = specialise;
                CHECK(check_samples(scene, settings, 3, 97) > 0);
            }
    }
}

TEST_CASE("A replayed sample of what merges is the render's by any number of threads, bit by bit with full kernels") {
    for (const char* name : {"cornell", "glass", "lights", "textured"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const ReplayConfig& c : kMerging)
            for (const int threads : {1, 2, 7}) {
                CAPTURE(name, text_of(c), threads);
                RenderSettings settings = settings_of(scene, c);
                settings.specialise = threads == 2;
                tbb::task_arena(threads).execute([&] { CHECK(check_samples(scene, settings, 4, 97) > 0); });
            }
    }
}

TEST_CASE("Replayed samples of a spherical sensor are the render's, at the edges of the film too") {
    // Tails of a gaussian are so small that sums of doubles would depend on the order of splats.
    const char* const crop =
        "<integer name='crop_offset_x' value='5'/><integer name='crop_offset_y' value='2'/>"
        "<integer name='crop_width' value='6'/><integer name='crop_height' value='3'/>";
    for (const char* part : {"", crop}) {
        const Scene scene = scene_from_text(room_around(spherical_camera(12, 6, "tent", part), 4));
        for (const ReplayConfig& c : {kPaths[0], kBidirectional[0], kBidirectional[2], kBidirectional[6]}) {
            CAPTURE(text_of(c), part);
            RenderSettings settings = settings_of(scene, c);
            settings.specialise = false;
            CHECK(check_samples(scene, settings, 5, 1) > 0);
        }
    }
}

TEST_CASE("A watched render has the image of one that is not, and names its largest samples") {
    const Scene scene = project_scene("glass", 24, 16);
    for (const char* integrator : {"path", "bdpt"}) {
        CAPTURE(integrator);
        RenderSettings settings = settings_of(scene, {integrator, "wavefront", {{"specialise", "false"}}});
        constexpr uint32_t kSamples = 16;
        SampleWatch watch(make_renderer(scene, settings));
        REQUIRE(watch.render(0, kSamples) == kSamples);
        const FilmMoments film = watch.film(), plain = render_scene(scene, settings, kSamples).film;
        CHECK(film.sum == plain.sum);
        CHECK(film.sum_squares == plain.sum_squares);
        CHECK(film.samples == plain.samples);

        // Against all samples of all pixels.
        double most = 0;
        for (uint32_t s = 0; s < kSamples; ++s) {
            const FilmMoments one = one_sample(scene, settings, s);
            for (size_t i = 0; i < one.sum.size(); ++i)
                most = std::max(most, one.sum[i] - (film.sum[i] - one.sum[i]) / (kSamples - 1));
        }
        SharedAccels accels(scene);
        const std::unique_ptr<Replay> replay = make_replay(scene, settings, accels);
        const std::vector<Outlier> worst = find_outliers(watch, *replay, 3);
        REQUIRE(worst.size() == 3);
        CHECK(std::abs(worst[0].pixel.excess - most) <= 1e-12 * most);
        for (size_t k = 0; k < worst.size(); ++k) {
            const Outlier& o = worst[k];
            CAPTURE(k, o.pixel.x, o.pixel.y, o.pixel.sample);
            if (k > 0) CHECK(o.pixel.excess <= worst[k - 1].pixel.excess);
            for (int c = 0; c < 3; ++c) CHECK(o.replayed[c] == o.pixel.value[c]);
            CHECK(o.largest.fate == ReplayFate::arrived);
            CHECK(double(max_component(o.largest.contribution)) > 0.5 * o.pixel.excess / 16);
        }
    }
}

namespace {

/// Renders given samples, one a call, of a film one pixel high.
struct GivenSamples : Renderer {
    std::vector<std::vector<double>> samples;
    FilmMoments of;

    explicit GivenSamples(std::vector<std::vector<double>> all) : samples(std::move(all)) {}
    uint32_t render(uint32_t first, uint32_t count, const volatile bool*) override {
        CHECK(count == 1);
        of = {uint32_t(samples[0].size() / 3), 1, 1, samples.at(first), samples.at(first)};
        return 1;
    }
    FilmMoments film() override { return of; }
    void clear_film() override { of = {}; }
    RenderStats stats() override { return {}; }
    uint32_t preferred_batch() const override { return 1; }
};

/// Of all pixels, the worst first.
std::vector<WatchedPixel> watched(SampleWatch& watch, uint32_t count) {
    watch.clear_film();
    CHECK(watch.render(0, count) == count);
    return watch.worst(10);
}

}  // namespace

TEST_CASE("A sample is as large as its largest channel, and exceeds the mean of the pixel's others") {
    SampleWatch watch(std::make_unique<GivenSamples>(std::vector<std::vector<double>>{
        {1, 2, 3, 9, 0, 0, 2, 8, 4}, {0, 0, 5, 0, 1, 0, 2, 6, 4}, {4, 4, 4, 0, 0, 7, 2, 4, 5}}));
    const auto check = [](const WatchedPixel& w, uint32_t x, uint32_t sample, std::array<double, 3> value,
                          double excess) {
        CAPTURE(x);
        CHECK(w.x == x);
        CHECK(w.y == 0);
        CHECK(w.sample == sample);
        for (size_t c = 0; c < 3; ++c) CHECK(w.value[c] == value[c]);
        CHECK(w.excess == excess);
    };
    std::vector<WatchedPixel> w = watched(watch, 3);
    REQUIRE(w.size() == 3);
    check(w[0], 1, 0, {9, 0, 0}, 9);
    check(w[1], 2, 0, {2, 8, 4}, 8 - (6 + 4) / 2.0);
    check(w[2], 0, 1, {0, 0, 5}, 5 - (3 + 4) / 2.0);
    w = watched(watch, 2);
    check(w[0], 1, 0, {9, 0, 0}, 9);
    check(w[1], 0, 1, {0, 0, 5}, 5 - 3);
    check(w[2], 2, 0, {2, 8, 4}, 8 - 6);
    w = watched(watch, 1);  // there are no others
    check(w[0], 1, 0, {9, 0, 0}, 9);
    check(w[1], 2, 0, {2, 8, 4}, 8);
    check(w[2], 0, 0, {1, 2, 3}, 3);
    CHECK(watch.worst(2).size() == 2);
    const volatile bool stop = true;
    CHECK(watch.render(1, 2, &stop) == 0);
}

TEST_CASE("A comparison by segments agrees with a render, and names the number from which on another one differs") {
    const Scene scene = project_scene("cornell", 24, 16);
    for (const ReplayConfig& c :
         {ReplayConfig{"path", "wavefront", {}}, ReplayConfig{"bdpt", "wavefront", {{"max_depth", "5"}}}}) {
        CAPTURE(text_of(c));
        const RenderSettings settings = settings_of(scene, c);
        SharedAccels accels(scene);
        const ReplayRequest request = {12, 8, 2, {}, true, true};
        const auto rendered = [&](const RenderSettings& s, uint32_t sample) { return rendered_film(scene, s, sample); };
        const std::vector<LengthComparison> same = compare_by_length(scene, settings, request, accels, rendered);
        REQUIRE(same.size() >= 4);
        const uint32_t longest = longest_of(make_replay(scene, settings, accels)->sample(request));
        const bool limited = settings.max_depth >= 0 && uint32_t(settings.max_depth) <= longest + 1;
        CHECK(same.size() == (limited ? uint32_t(settings.max_depth) : longest + 2));
        double sum = 0;
        for (size_t k = 0; k < same.size(); ++k) {
            const LengthComparison& l = same[k];
            CHECK(l.segments == k + 1);
            CHECK(l.or_more == (!limited && k + 1 == same.size()));
            CHECK_FALSE(l.differs);
            for (int i = 0; i < 3; ++i) CHECK(std::abs(l.rendered[i] - l.replayed[i]) <= 1e-5 * l.rendered[i] + 1e-6);
            sum += l.rendered[0];
        }
        const double all = rendered(settings, request.sample).sum[(8 * 24 + 12) * 3];
        REQUIRE(all > 0);
        CHECK(std::abs(sum - all) <= 1e-12 * all);
        // From three segments on another sample.
        const auto parted = [&](const RenderSettings& s, uint32_t sample) {
            return rendered_film(scene, s, s.max_depth >= 3 || s.max_depth < 0 ? sample + 1 : sample);
        };
        const std::vector<LengthComparison> other = compare_by_length(scene, settings, request, accels, parted);
        for (const LengthComparison& l : other)
            if (l.segments <= 3) CHECK(l.differs == (l.segments == 3));
        CHECK(by_length_text(other).find("first differ in paths of 3 segments") != std::string::npos);
        CHECK(by_length_text(same).find("agree") != std::string::npos);
    }
}

TEST_CASE("A comparison by segments allows a thousandth of what they bring, and a millionth of the sum for roundings") {
    const Scene scene = project_scene("cornell", 24, 16);
    const RenderSettings settings =
        settings_of(scene, {"path", "wavefront", {{"max_depth", "3"}, {"specialise", "false"}}});
    SharedAccels accels(scene);
    // A pixel whose paths of two segments bring light, and those of three none.
    ReplayRequest request;
    const auto brings = [&](int max_depth) {
        RenderSettings s = settings;
        s.max_depth = max_depth;
        return largest(make_replay(scene, s, accels)->sample(request).eye_sum);
    };
    const auto fits = [&] { return brings(2) > brings(1) && brings(3) == brings(2); };
    for (request.y = 8; !fits() && request.x < 23;) ++request.x;
    REQUIRE(fits());
    const auto compared = [&](double factor, int from) {
        return compare_by_length(scene, settings, request, accels, [&](const RenderSettings& s, uint32_t sample) {
            FilmMoments film = rendered_film(scene, s, sample);
            for (double& v : film.sum) v *= s.max_depth >= from ? factor : 1.0;
            return film;
        });
    };
    const auto differs = [&](double factor, int from, uint32_t segments) {
        return compared(factor, from).at(segments - 1).differs;
    };
    CHECK_FALSE(differs(1 + 0.999e-3, 2, 2));
    CHECK(differs(1 + 1.005e-3, 2, 2));
    CHECK_FALSE(differs(1 - 0.999e-3, 2, 2));
    CHECK(differs(1 - 1.005e-3, 2, 2));
    CHECK_FALSE(differs(1 + 0.998e-6, 3, 3));
    CHECK(differs(1 + 1.005e-6, 3, 3));
    CHECK(differs(std::nan(""), 3, 3));
}

TEST_CASE("Positions are printed in the coordinates of the file, wherever the loader moved the scene") {
    const auto scene_at = [](const std::string& x) {
        return scene_from_text(
            "<scene version='3.0.0'><sensor type='perspective'><transform name='to_world'>"
            "<lookat origin='" +
            x + ",0,4' target='" + x +
            ",0,0' up='0,1,0'/></transform>"
            "<film type='hdrfilm'><integer name='width' value='8'/>"
            "<integer name='height' value='8'/></film></sensor>"
            "<emitter type='constant'/><shape type='sphere'><point name='center' x='" +
            x + "' y='0' z='0'/></shape></scene>");
    };
    const auto replayed = [](const Scene& scene, std::string& text) {
        SharedAccels accels(scene);
        const RenderSettings settings = settings_of(scene, {"path", "wavefront", {}});
        const ReplaySample s = make_replay(scene, settings, accels)->sample({4, 4, 0, {}, true, true});
        const ReplayFormat format = {{}, scene.origin};
        text = replay_text(s, format);
        return replay_json(s, format);
    };
    std::string text;
    const nlohmann::json near = replayed(scene_at("0"), text);
    CHECK(text.find("origin at") == std::string::npos);
    const nlohmann::json far = replayed(scene_at("1048576"), text);
    CHECK(text.find("origin at (1048576, ") != std::string::npos);
    const nlohmann::json &a = near["eye_subpath"]["vertices"][0], &b = far["eye_subpath"]["vertices"][0];
    REQUIRE(a["miss"] == false);
    CHECK(text.find(fmt::format(" at ({:.13g}, ", b["p"][0].get<double>())) != std::string::npos);
    for (const char* place : {"origin", "p"})
        for (const int c : {0, 1, 2}) {
            const double from = a[place][c], to = b[place][c];
            CHECK(std::abs(to - from - (c == 0 ? 1048576 : 0)) < 1e-6);
        }
}

}  // namespace ambilux
