#include "render/replay/by_length.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "render/renderer.h"

namespace ambilux {
namespace {

struct Sums {
    double rendered[3] = {}, replayed[3] = {};
};

/// What `now` has that `before` had not. Sums of floats round by 2^-24 of themselves.
LengthComparison difference(uint32_t segments, const Sums& before, const Sums& now) {
    LengthComparison c;
    c.segments = segments;
    for (int k = 0; k < 3; ++k) {
        c.rendered[k] = now.rendered[k] - before.rendered[k];
        c.replayed[k] = now.replayed[k] - before.replayed[k];
        const double allowed = 1e-3 * std::abs(c.replayed[k]) + 1e-6 * std::abs(now.replayed[k]);
        c.differs |= !(std::abs(c.rendered[k] - c.replayed[k]) <= allowed);
    }
    return c;
}

uint32_t longest_path(const ReplaySample& sample) {
    uint32_t longest = uint32_t(sample.eye.vertices.size());
    for (const auto* all : {&sample.candidates, &sample.splats})
        for (const ReplayCandidate& c : *all) longest = std::max(longest, c.segments());
    return longest;
}

}  // namespace

FilmMoments rendered_film(const Scene& scene, const RenderSettings& settings, uint32_t sample) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    const uint32_t together = renderer->iteration_samples(), first = sample / together * together;
    // What a method has learned is part of a sample.
    if (renderer->state_kind() == StateKind::per_device && first > 0) {
        renderer->render(0, first);
        renderer->clear_film();
    }
    renderer->render(first, together);
    return renderer->film();
}

std::vector<LengthComparison> compare_by_length(const Scene& scene, RenderSettings settings,
                                                const ReplayRequest& request, SharedAccels& accels,
                                                const FilmOf& film) {
    const ReplaySample whole = make_replay(scene, settings, accels)->sample(request);
    if (!whole.complete) throw Error(ExitCode::usage, "--compare: " + (whole.notes.empty() ? "" : whole.notes.back()));
    const int all = settings.max_depth;
    const uint32_t most = all < 0 ? longest_path(whole) + 1 : std::min(uint32_t(all), longest_path(whole) + 1);
    const size_t at = (size_t(request.y) * scene.sensor.crop_width + request.x) * 3;
    const auto sums = [&](int max_depth) {
        settings.max_depth = max_depth;
        Sums s;
        const FilmMoments rendered = film(settings, request.sample);
        std::copy_n(rendered.sum.begin() + ptrdiff_t(at), 3, s.rendered);
        const std::unique_ptr<Replay> replay = make_replay(scene, settings, accels);
        const uint32_t together = replay->iteration_samples();
        ReplayRequest one = request;
        for (uint32_t k = 0; k < together; ++k) {
            one.sample = request.sample / together * together + k;
            const ReplaySample replayed = replay->sample(one);
            for (int c = 0; c < 3; ++c) s.replayed[c] += replayed.total[c];
        }
        return s;
    };
    std::vector<LengthComparison> lengths;
    Sums before;
    for (uint32_t k = 1; k <= most; ++k) {
        const Sums now = sums(int(k));
        lengths.push_back(difference(k, before, now));
        before = now;
    }
    if (int(most) != all) {
        lengths.push_back(difference(most + 1, before, sums(all)));
        lengths.back().or_more = true;
    }
    return lengths;
}

std::string by_length_text(const std::vector<LengthComparison>& lengths) {
    std::string text = "by segments: rendered, replayed\n";
    const auto triple = [](const double(&v)[3]) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", v[0], v[1], v[2]); };
    for (const LengthComparison& c : lengths)
        text += fmt::format("  {:>3}{} {}, {}{}\n", c.segments, c.or_more ? '+' : ' ', triple(c.rendered),
                            triple(c.replayed), c.differs ? "  differs" : "");
    const auto first = std::find_if(lengths.begin(), lengths.end(), [](const auto& c) { return c.differs; });
    if (first == lengths.end()) return text + "the render and its replay agree\n";
    return text + fmt::format(
                      "the render and its replay first differ in paths of {} segments{}{}: they part at the last "
                      "vertex of such a path, or at an earlier one that brought nothing to shorter paths\n",
                      first->segments, first->or_more ? " or more" : "",
                      first->segments > 1 ? ", and agree in shorter ones" : "");
}

}  // namespace ambilux
