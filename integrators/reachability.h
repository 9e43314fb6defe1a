// Which paths a set of strategies cannot find, from what a scene is made of: no sample decides it (docs/theory.md,
// section 11).
#pragma once

#include <string>

#include "integrators/settings.h"
#include "models/features.h"

namespace ambilux {

/// Words of Heckbert's notation with emitters told apart: "L" has extent, "Ld" is a delta (point, spot, directional),
/// "Lb" a beam (is_beam); "S" is passed by a delta lobe, "D" by another one; "E" is the camera. Returns the shortest
/// word that paths of a scene of `features` may have, that `reference` (StrategyBits, kMergeStrategies, kJoinedAtFirst)
/// finds and `strategies` do not; empty if there is none. Conservative: a word counts as soon as the scene has its
/// letters. `max_depth`: segments; -1: no limit.
std::string unreachable_path(const Features& features, uint32_t strategies, uint32_t reference, int max_depth);

/// The shortest word that `strategies` do not find, whether others do or not; empty if there is none.
std::string unreachable_path(const Features& features, uint32_t strategies, int max_depth);

/// Groups of strategies (StrategyBits) that a render of these settings, which are not automatic, samples; 0: none
/// that this notation describes.
uint32_t sampled_strategies(const RenderSettings& settings);

/// A sentence that says which light the image will lack; empty if `settings` find all light. Single strategies leave
/// light out on purpose and are not judged.
std::string missing_light(const Features& features, const RenderSettings& settings);

}  // namespace ambilux
