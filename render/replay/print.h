// Replays for a person and for programs.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "render/replay/record.h"

namespace ambilux {

/// Strategy (s,t), or merges of subpaths of s and t vertices.
struct ReplayStrategy {
    Strategy strategy;
    bool merged;

    ReplayStrategy(Strategy s, bool m = false) : strategy(s), merged(m) {}
};
/// "s1t3": one vertex from the light, three from the camera. "s2+t3": subpaths of two and three that merge.
std::string strategy_text(ReplayStrategy strategy);
/// Throws Error(usage) unless `text` is of one of these forms.
ReplayStrategy parse_strategy(const std::string& text);

/// What is printed of a replay, and where its scene lies.
struct ReplayFormat {
    std::optional<ReplayStrategy> only;  ///< contributions of this strategy, if it is given
    std::array<double, 3> origin{};      ///< Scene::origin: positions are printed in coordinates of the file

    bool moved() const { return origin != std::array<double, 3>{}; }
    std::array<double, 3> in_file(Vec3f p) const {
        return {origin[0] + double(p.x), origin[1] + double(p.y), origin[2] + double(p.z)};
    }
    bool shows(const ReplayCandidate& c) const {
        return !only || (c.strategy.code == only->strategy.code && c.merged == only->merged);
    }
};

std::string replay_text(const ReplaySample& sample, const ReplayFormat& format);
/// A light subpath alone, with its splats.
std::string replay_text(const ReplaySubpath& subpath, const std::vector<ReplayCandidate>& splats,
                        const ReplayFormat& format);

/// Numbers that are not finite are null; floats read back have the same bits.
nlohmann::json replay_json(const ReplaySample& sample, const ReplayFormat& format);
nlohmann::json replay_json(const ReplaySubpath& subpath, const std::vector<ReplayCandidate>& splats,
                           const ReplayFormat& format);

}  // namespace ambilux
