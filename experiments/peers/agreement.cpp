#include "experiments/peers/agreement.h"

#include <algorithm>
#include <cmath>

namespace ambilux {
namespace {

/// A part as one sample: its mean counts, its own scatter is not known.
FilmMoments as_one_sample(const FilmMoments& part) {
    FilmMoments one = part;
    one.samples = 1;
    for (size_t i = 0; i < one.sum.size(); ++i) {
        one.sum[i] = part.mean(i);
        one.sum_squares[i] = one.sum[i] * one.sum[i];
    }
    return one;
}

/// kAgreementParts parts of together `samples` per pixel, in whole iterations; empty if interrupted.
std::vector<FilmMoments> render_parts(Renderer& renderer, uint64_t samples, const volatile bool* interrupt,
                                      RenderPosition& position) {
    const uint64_t k = renderer.iteration_samples(), each = std::max(k, samples / kAgreementParts / k * k);
    std::vector<FilmMoments> parts;
    for (int i = 1; i <= kAgreementParts; ++i) {
        position = drive(renderer, position, {each * uint64_t(i), 0}, interrupt);
        if (position.interrupted) return {};
        parts.push_back(as_one_sample(renderer.film()));
        renderer.clear_film();
    }
    return parts;
}

FilmMoments sum_of(const std::vector<FilmMoments>& parts) {
    FilmMoments all = parts[0];
    for (size_t i = 1; i < parts.size(); ++i) all.add(parts[i]);
    return all;
}

nlohmann::json finite(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr); }

}  // namespace

Agreement measure_agreement(PeerRenderer& peer, uint64_t samples, const Reference& reference,
                            const volatile bool* interrupt) {
    Agreement a;
    RenderPosition position;
    const std::vector<FilmMoments> parts = render_parts(peer, samples, interrupt, position);
    a.interrupted = parts.empty();
    if (a.interrupted) return a;
    a.samples = position.samples;
    a.seconds = position.seconds;
    a.parts = sum_of(parts);
    const Estimate own = to_estimate(parts), known = to_estimate(reference);
    a.test = z_test(own, known);
    a.near = equivalence(own, known);
    return a;
}

void compare_with_own(Agreement& a, Renderer& own, const volatile bool* interrupt) {
    RenderPosition position;
    const std::vector<FilmMoments> parts = render_parts(own, a.samples, interrupt, position);
    a.interrupted = parts.empty();
    if (a.interrupted) return;
    ZTestOptions options;
    options.same_estimator = true;
    const ZTestResult test = z_test(to_estimate(a.parts), to_estimate(sum_of(parts)), options);
    if (!test.pass) return;
    a.test = test;
    a.with_own_path = true;
}

nlohmann::json to_json(const Agreement& a) {
    const ZTestResult& t = a.test;
    return {{"pass", t.pass},
            {"undecided", t.undecided},
            {"equivalent", a.near.shown},
            {"level", a.near.level},
            {"mean_bound", finite(a.near.mean_bound)},
            {"block_bound", finite(a.near.block_bound)},
            {"samples", a.samples},
            {"seconds", a.seconds},
            {"with_own_path", a.with_own_path},
            {"tests", t.tests},
            {"relative_difference", finite(t.relative_difference)},
            {"detectable", finite(t.detectable)},
            {"p", finite(std::min(t.p_worst, t.p_chi_square))},
            {"worst",
             {{"z", finite(t.worst_z)},
              {"x", t.worst_x},
              {"y", t.worst_y},
              {"width", t.worst_width},
              {"height", t.worst_height},
              {"channel", t.worst_channel},
              {"peer", finite(t.worst_a)},
              {"reference", finite(t.worst_b)}}}};
}

}  // namespace ambilux
