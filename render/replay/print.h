// Replays for a person and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "render/replay/record.h"

namespace ambilux {

/// "s1t3": one vertex from the light, three from the camera.
std::string strategy_text(Strategy strategy);
/// Throws Error(usage) unless `text` is of this form.
Strategy parse_strategy(const std::string& text);

/// Of contributions only those of strategy `only`, if it is given.
struct ReplayFilter {
    std::optional<Strategy> only;
    bool shows(const ReplayCandidate& c) const { return !only || c.strategy.code == only->code; }
};

std::string replay_text(const ReplaySample& sample, const ReplayFilter& filter);
/// A light subpath alone, with its splats.
std::string replay_text(const ReplaySubpath& subpath, const std::vector<ReplayCandidate>& splats,
                        const ReplayFilter& filter);

/// Numbers that are not finite are null; floats read back have the same bits.
nlohmann::json replay_json(const ReplaySample& sample, const ReplayFilter& filter);
nlohmann::json replay_json(const ReplaySubpath& subpath, const std::vector<ReplayCandidate>& splats,
                           const ReplayFilter& filter);

}  // namespace ambilux
