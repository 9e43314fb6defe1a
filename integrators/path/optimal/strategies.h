// Strategies that find the light of an emitter at a vertex. Hits by BSDF sampling are one; next event estimation is one
// for each of the emitters that it picks most often and one for the others, of which a vertex samples one.
#pragma once

#include "core/vec.h"
#include "integrators/path/optimal/settings.h"

namespace ambilux {

/// Next event estimation as several strategies, by the emitter that was picked.
struct EmitterStrategies {
    static constexpr uint32_t kMost = OptimalSettings::kMostStrategies;

    uint32_t count;
    uint32_t emitters[kMost - 1];  ///< those that are a strategy each: all but the last
    float probability[kMost];      ///< that a vertex samples this strategy

    AMBILUX_HD uint32_t of(uint32_t emitter) const {
        for (uint32_t k = 0; k + 1 < count; ++k)
            if (emitters[k] == emitter) return k;
        return count - 1;
    }
};

/// Light that a sample found, times the weight of the balance heuristic.
struct FoundLight {
    Rgb weighted;
    float other;  ///< weight of the other strategy for this light; 0 where there is none
};

/// A vertex that samples an emitter and a direction.
struct VertexStrategies {
    FoundLight next_event, hit;
    float scale;  ///< of light at this vertex: how much of it the camera sees; 0: there is no such vertex
    uint32_t next_event_strategy;
    uint32_t hit_strategy;  ///< that could have found by next event estimation what the ray hit
    uint32_t pad;
};

}  // namespace ambilux
