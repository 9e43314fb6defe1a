// bdpt.auto=true: a pilot decides which strategies run and in which variant (docs/theory.md, section 11).
#pragma once

#include <functional>

#include "integrators/auto/pilot.h"
#include "integrators/offers.h"
#include "render/renderer.h"

namespace ambilux {

/// What `settings` leave to choose from, the path tracer first, those that are measured last.
struct SelectionCandidate {
    std::string name;
    PilotCandidate pilot;  ///< with the uniform draws that those of the offer are taken to be worth
    SettingTexts settings;
    SelectionOffer offer;

    bool predicted() const { return !offer.measured && !offer.by_pixel; }
};
std::vector<SelectionCandidate> selection_candidates(const RenderSettings& settings, bool cuda);
/// `settings` with those of a candidate, and no longer automatic.
RenderSettings settings_of(const RenderSettings& settings, const SelectionCandidate& candidate);

/// The rays and connections of one sample of a pixel, in multiples of one ray of a path tracer.
double selection_work(const PilotWork& work, const SelectionCandidate& candidate, bool cuda);

/// The blocks of a film but for the hundredth that is worst for the best candidate of each, `variance[candidate]
/// [block]`: what lies in a few pixels is not trimmed away by chance for some candidates only.
std::vector<size_t> kept_blocks(const std::vector<std::vector<double>>& variance);
/// Mean over these of each candidate's variance.
std::vector<double> trimmed_means(const std::vector<std::vector<double>>& variance);

/// What no pilot sees, from the means of all candidates.
double unseen_variance(const std::vector<double>& means);
/// Those of candidates that are not excluded.
std::vector<std::vector<double>> possible_variances(const Pilot& pilot, const std::vector<std::string>& excluded);

/// The variance of one sample that each candidate is selected by: the trimmed mean, and what no pilot sees, which is
/// the same for all per eye subpath. `excluded[candidate]`: why it cannot be chosen, or empty. What such a candidate
/// does not find would pass for little variance: it counts for nothing, and has infinity.
std::vector<double> selection_variances(const Pilot& pilot, const std::vector<std::string>& excluded);

/// Makes a renderer of given settings, which are not automatic.
using MakeRenderer = std::function<std::unique_ptr<Renderer>(const RenderSettings&)>;

/// Runs the pilot, times what it cannot tell apart, and makes the renderer of the selection.
std::unique_ptr<Renderer> make_automatic(const Scene& scene, const RenderSettings& settings, bool cuda,
                                         SharedAccels& accels, const MakeRenderer& make);

}  // namespace ambilux
