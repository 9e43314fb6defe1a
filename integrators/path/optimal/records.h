// What the strategies of a path's first vertices found, by slot, until the wave is done.
#pragma once

#include "integrators/path/optimal/strategies.h"
#include "models/parameters.h"
#include "queues/lane_array.h"

namespace ambilux {

/// Those of a wave, `vertices` for each slot.
struct StrategyRecords {
    LaneArray<VertexStrategies> items;
    uint32_t vertices;

    /// Of the vertex at the end of `depth` segments; kNone if it has none.
    AMBILUX_HD uint32_t place(uint32_t slot, uint32_t depth) const {
        return depth >= 1 && depth <= vertices ? slot * vertices + depth - 1 : kNone;
    }
    AMBILUX_HD void clear(uint32_t slot) const {
        for (uint32_t d = 1; d <= vertices; ++d) set_start(lane(place(slot, d), kOfVertex), OfVertex{});
    }
    AMBILUX_HD void begin(uint32_t place, float scale, uint32_t next_event_strategy) const {
        items.store(place, {{}, {}, scale, next_event_strategy, 0, 0});
    }
    AMBILUX_HD void found_by_next_event(uint32_t place, const FoundLight& light) const {
        set_start(lane(place, kByNextEvent), light);
    }
    AMBILUX_HD void found_by_hit(uint32_t place, const FoundLight& light, uint32_t strategy) const {
        set_start(lane(place, kByHit), light);
        OfVertex vertex = start_of<OfVertex>(lane(place, kOfVertex));
        vertex.hit_strategy = strategy;
        set_start(lane(place, kOfVertex), vertex);
    }
    AMBILUX_HD bool has_vertex(uint32_t place) const { return start_of<OfVertex>(lane(place, kOfVertex)).scale > 0.0f; }

private:
    enum : uint32_t { kByNextEvent, kByHit, kOfVertex };
    struct OfVertex {
        float scale;
        uint32_t next_event_strategy, hit_strategy;
    };
    AMBILUX_HD Lane& lane(uint32_t place, uint32_t k) const { return items.base[items.place(place, k)]; }
};

}  // namespace ambilux
