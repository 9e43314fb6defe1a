// What bdpt.auto=true selects from, and what a pilot's figures say of each.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/registry.h"
#include "render/selection.h"

namespace ambilux {
namespace {

/// Share of the blocks that the comparison leaves out.
constexpr double kTrimmedBlocks = 0.01;
/// What every candidate has beside the variance that a pilot sees, in multiples of the median candidate's: fitted to
/// the project's own scenes (docs/lab/2026-11-28-regret.md).
constexpr double kUnseen = 0.2;
SelectionCandidate candidate_of(const Variant& variant, SelectionOffer offer, float light_paths) {
    SelectionCandidate c;
    c.name = variant.integrator + offer.suffix;
    c.pilot = {light_paths, offer.connect, offer.worth};
    c.settings = {{"integrator", variant.integrator}, {"variant", variant.variant}};
    c.settings.insert(c.settings.end(), offer.settings.begin(), offer.settings.end());
    if (light_paths != 0.0f && light_paths != 1.0f) {
        c.name += fmt::format(", {} light subpaths per pixel", light_paths);
        c.settings.emplace_back("light_paths", fmt::format("{}", light_paths));
    }
    c.offer = std::move(offer);
    return c;
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace

RenderSettings settings_of(const RenderSettings& settings, const SelectionCandidate& candidate) {
    RenderSettings s = settings;
    end_selection(s);
    for (const auto& [key, value] : candidate.settings) apply_setting(s, key, value);
    if (!variant_of(s).traits.draws_together) s.draws = CacheDraws::automatic;  // others have no draws to be set
    return s;
}

std::vector<SelectionCandidate> selection_candidates(const RenderSettings& settings, bool cuda) {
    const Variant& asked = variant_of(settings);
    std::vector<SelectionCandidate> all;
    for (const float light_paths : {0.0f, 0.25f, 1.0f, 4.0f})
        for (const Variant& v : variants()) {
            if (!v.selection) continue;
            for (SelectionOffer& offer : v.selection({settings, asked.traits, &v == &asked, cuda, light_paths}))
                all.push_back(candidate_of(v, std::move(offer), light_paths));
        }
    std::stable_partition(all.begin(), all.end(), [](const SelectionCandidate& c) { return !c.offer.measured; });
    std::stable_partition(all.begin(), all.end(), [](const SelectionCandidate& c) { return c.predicted(); });
    return all;
}

double selection_work(const PilotWork& w, const SelectionCandidate& candidate, bool cuda) {
    // Fitted to renders (docs/performance.md): shadow rays and connections in rays of subpaths; what the longer records
    // and further launches of bidirectional methods cost.
    const double eye = w.eye_rays + kShadowWork * w.next_events,
                 light = double(candidate.pilot.light_subpaths) * (w.light_rays + kShadowWork * w.splats);
    const double pair = cuda ? 0.24 : 0.02, draw = cuda ? 0.12 : 0.07, ray = cuda ? 1.06 : 0.8,
                 bidirectional = cuda ? 1.2 : 1.0;
    const PilotCandidate& c = candidate.pilot;
    if (c.light_subpaths == 0.0f && !c.connect) return eye;
    double work = eye + light;
    if (c.connect && c.draws == 0) work += pair * w.pairs + ray * w.pair_rays;
    if (c.connect) work += candidate.offer.draws * (draw * w.draws + ray * w.draw_rays);
    work *= candidate.offer.work;
    // A light subpath for every vertex of an eye subpath.
    if (c.connect && c.draws == 0 && variant_of(settings_of({}, candidate)).traits.streams)
        work += std::max(0.0, w.vertices - 1.0) * w.light_rays;
    return bidirectional * work;
}

std::vector<size_t> kept_blocks(const std::vector<std::vector<double>>& variance) {
    const size_t blocks = variance[0].size();
    std::vector<std::pair<double, size_t>> worst(blocks);
    for (size_t b = 0; b < blocks; ++b) {
        worst[b] = {kInfinity, b};
        for (const std::vector<double>& of : variance) worst[b].first = std::min(worst[b].first, of[b]);
    }
    std::sort(worst.begin(), worst.end());
    const size_t kept = blocks - size_t(kTrimmedBlocks * double(blocks));
    std::vector<size_t> found;
    for (size_t i = 0; i < kept; ++i) found.push_back(worst[i].second);
    return found;
}

std::vector<double> trimmed_means(const std::vector<std::vector<double>>& variance) {
    const std::vector<size_t> kept = kept_blocks(variance);
    std::vector<double> means;
    for (const std::vector<double>& of : variance) {
        double sum = 0;
        for (const size_t b : kept) sum += of[b];
        means.push_back(std::max(sum / double(kept.size()), 1e-12));
    }
    return means;
}

double unseen_variance(const std::vector<double>& means) { return kUnseen * median(means); }

std::vector<std::vector<double>> possible_variances(const Pilot& pilot, const std::vector<std::string>& excluded) {
    std::vector<std::vector<double>> of;
    for (size_t c = 0; c < pilot.variance.size(); ++c)
        if (excluded[c].empty()) of.push_back(pilot.variance[c]);
    return of;
}

std::vector<double> selection_variances(const Pilot& pilot, const std::vector<std::string>& excluded) {
    std::vector<double> variances(pilot.variance.size(), double(kInfinity));
    const std::vector<std::vector<double>> of = possible_variances(pilot, excluded);
    if (of.empty()) return variances;
    const std::vector<double> means = trimmed_means(of);
    const double unseen = unseen_variance(means);
    for (size_t c = 0, i = 0; c < variances.size(); ++c)
        if (excluded[c].empty()) variances[c] = means[i++] + unseen;
    return variances;
}

}  // namespace ambilux
