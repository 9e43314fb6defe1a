// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// bdpt.auto=true in long renders: what is near the best is tried out, and what a pilot did not know decides.
#include <chrono>
#include <map>
#include <sstream>
#include <thread>

#include "accel/shared_accels.h"
#include "integrators/registry.h"
#include "render/selection.h"
#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

/// Takes as long again and again as one batch took.
struct Slow : Renderer {
    Slow(std::unique_ptr<Renderer> r, int t) : renderer(std::move(r)), times(t) {}
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = std::chrono::steady_clock::now();
        const uint32_t done = renderer->render(first, count, interrupt);
        std::this_thread::sleep_for((times - 1) * (std::chrono::steady_clock::now() - start));
        return done;
    }
    FilmMoments film() override { return renderer->film(); }
    void clear_film() override { renderer->clear_film(); }
    RenderStats stats() override { return renderer->stats(); }
    uint32_t preferred_batch() const override { return renderer->preferred_batch(); }
    std::unique_ptr<Renderer> renderer;
    const int times;
};

RenderSettings long_render(const Scene& scene) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "bdpt";
    s.automatic = true;
    s.expected_seconds = 10;
    return s;
}

/// `slow`: the method whose samples take 20 times as long as its rays say.
SelectionStats selected(const Scene& scene, const RenderSettings& s, const std::string& slow = "") {
    SharedAccels accels(scene);
    const auto make = [&](const RenderSettings& chosen) -> std::unique_ptr<Renderer> {
        std::unique_ptr<Renderer> r = make_renderer(scene, chosen);
        if (chosen.integrator + " " + chosen.variant == slow) return std::make_unique<Slow>(std::move(r), 20);
        return r;
    };
    return make_automatic(scene, s, false, accels, make)->stats().selection;
}

std::vector<SelectionStats::Candidate> tried(const SelectionStats& selection) {
    std::vector<SelectionStats::Candidate> found;
    for (const SelectionStats::Candidate& c : selection.candidates)
        if (c.seconds > 0) found.push_back(c);
    return found;
}

std::string method_of(const SelectionStats& selection) {
    std::map<std::string, std::string> settings(selection.settings.begin(), selection.settings.end());
    return settings["integrator"] + " " + settings["variant"];
}

}  // namespace

TEST_CASE("a long render tries out the best of up to three families") {
    const Scene scene = project_scene("cornell", 16, 12);
    RenderSettings s = long_render(scene);
    const SelectionStats all = selected(scene, s);
    const std::vector<SelectionStats::Candidate> of = tried(all);
    INFO(all.name);
    CHECK(of.size() >= 2);
    CHECK(of.size() <= 3);
    for (const SelectionStats::Candidate& c : of) CHECK(c.efficiency > 1 / 20.0);
    // Three trials of a 200th of the time, and a pilot.
    CHECK(all.seconds < 0.2 * s.expected_seconds);

    s.expected_seconds = 9;
    CHECK(tried(selected(scene, s)).empty());
    s = long_render(scene);
    s.deterministic = true;
    CHECK(tried(selected(scene, s)).empty());
    s = long_render(scene);
    s.expected_samples = 100;
    CHECK(tried(selected(scene, s)).empty());
}

TEST_CASE("a method that takes longer than its rays say loses its trial") {
    const Scene scene = project_scene("cornell", 16, 12);
    const RenderSettings s = long_render(scene);
    const std::string best = method_of(selected(scene, s));
    const SelectionStats other = selected(scene, s, best);
    INFO(best << ", then " << other.name);
    CHECK(method_of(other) != best);
}

TEST_CASE("a trial of many paths has the variance of a render") {
    const Scene scene = project_scene("boxes/sky", 16, 12);
    RenderSettings s = long_render(scene);
    s.expected_seconds = 600;  // trials of 3 s: enough paths on a busy machine too
    const std::vector<SelectionStats::Candidate> of = tried(selected(scene, s));
    REQUIRE(of.size() >= 2);
    for (const SelectionStats::Candidate& c : of) {
        RenderSettings fixed = s;
        fixed.automatic = false;
        std::istringstream words(c.settings);
        for (std::string word; words >> word;)
            apply_setting(fixed, word.substr(0, word.find('=')), word.substr(word.find('=') + 1));
        const FilmMoments film = render_scene(scene, fixed, 1024).film;
        const double n = double(film.samples), values = double(film.sum.size());
        double variance = 0;
        for (size_t i = 0; i < film.sum.size(); ++i) {
            const double mean = film.sum[i] / n;
            variance += (film.sum_squares[i] / n - mean * mean) / (mean * mean + 0.01) / values;
        }
        INFO(c.name);
        CHECK(c.variance == Approx(variance).epsilon(0.15));
    }
}
