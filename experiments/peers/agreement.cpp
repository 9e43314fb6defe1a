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

nlohmann::json finite(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr); }

}  // namespace

Agreement measure_agreement(PeerRenderer& peer, uint64_t samples, const Reference& reference,
                            const volatile bool* interrupt) {
    Agreement a;
    const uint64_t each = std::max<uint64_t>(1, samples / kAgreementParts);
    std::vector<FilmMoments> parts;
    FilmMoments all;
    RenderPosition position;
    for (int i = 1; i <= kAgreementParts; ++i) {
        position = drive(peer, position, {each * uint64_t(i), 0}, interrupt);
        if (position.interrupted) {
            a.interrupted = true;
            return a;
        }
        parts.push_back(as_one_sample(peer.film()));
        peer.clear_film();
        if (i == 1)
            all = parts.back();
        else
            all.add(parts.back());
    }
    a.samples = position.samples;
    a.seconds = position.seconds;
    a.image = mean_image(all);
    a.test = z_test(to_estimate(parts), to_estimate(reference));
    return a;
}

nlohmann::json to_json(const Agreement& a) {
    const ZTestResult& t = a.test;
    return {{"pass", t.pass},
            {"undecided", t.undecided},
            {"samples", a.samples},
            {"seconds", a.seconds},
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
