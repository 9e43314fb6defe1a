// What is asked of replays (render/replay/) and what they say, for program and package alike.
#pragma once

#include <nlohmann/json.hpp>

#include "render/replay/by_length.h"
#include "render/replay/outliers.h"

namespace ambilux {

/// A render that remembers its largest samples. Throws Error(usage) where there are no replays of it, or where several
/// samples come at once; `prefix` stands before "outliers".
std::unique_ptr<SampleWatch> watch_samples(std::unique_ptr<Renderer> renderer, const RenderSettings& settings,
                                           const std::string& prefix);

/// kind, strategy, eye_depth, light_depth, light_subpath, contribution; null of what brought nothing.
nlohmann::json contribution_json(const ReplayCandidate& c);
/// pixel, sample, value, excess, replayed, complete, largest.
nlohmann::json outlier_json(const Outlier& outlier);
/// A list of {segments, or_more, rendered, replayed, differs}.
nlohmann::json by_length_json(const std::vector<LengthComparison>& lengths);

}  // namespace ambilux
