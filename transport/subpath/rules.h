// What an integrator does at the vertices of its subpaths, decided once by the host.
#pragma once

#include "transport/mis/strategy.h"
#include "transport/subpath/directions.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

template <class Mis>
struct Rules {
    Mis mis;
    uint32_t max_depth;      ///< segments of a path; kMaxDepth stands for no limit
    uint32_t rr_depth;       ///< Russian roulette at vertices with at least this many segments
    float rr_cap;            ///< its highest probability of survival
    bool hide_emitters;      ///< the camera does not see emitters
    bool count_hits;         ///< eye subpaths count the area emitters that they meet
    bool count_environment;  ///< eye subpaths count the environment
    bool next_event;         ///< eye vertices sample emitters
    bool splat;              ///< light vertices are connected with the camera
    bool connect;            ///< eye vertices are connected with light vertices
    bool background_only;  ///< eye subpaths end at their first vertex: they serve the directly seen environment, which
                           ///< no light subpath finds
    SingleStrategies singles;
    typename Mis::Directions directions;  ///< how directions are sampled at vertices
    typename Mis::Lights lights;          ///< how emitters are picked by next event estimation

    /// The same with another model, whose samplers are as they come.
    template <class Other>
    Rules<Other> with(const Other& other) const {
        return {other,      max_depth, rr_depth, rr_cap,          hide_emitters, count_hits, count_environment,
                next_event, splat,     connect,  background_only, singles,       {},         {}};
    }
    /// Eye subpaths of `depth` segments count the environment that they reach: beyond the first segment as hits only.
    AMBILUX_HD bool counts_environment(uint32_t depth) const {
        if constexpr (Mis::kBidirectional)
            return count_environment && (depth == 1 || mis.has(kHitStrategies));
        else
            return count_environment;
    }
    AMBILUX_HD bool sees_emitters(uint32_t depth) const { return !(hide_emitters && depth == 1); }
    /// Segments that a subpath may have: the last of an eye subpath brings nothing but emission, and a path has one
    /// more than its light subpath.
    AMBILUX_HD uint32_t longest(Side side) const {
        return side == Side::eye && (count_hits || counts_environment(2)) ? max_depth : max_depth - 1;
    }
    /// True if what strategy (s,t) finds counts.
    AMBILUX_HD bool wants(uint32_t s, uint32_t t) const {
        return !Mis::kBidirectional || singles.has(Strategy::make(s, t));
    }
    /// The ratio of a strategy that counts: one that is alone has weight 1.
    AMBILUX_HD typename Mis::Ratio counted(typename Mis::Ratio ratio) const {
        if constexpr (Mis::kBidirectional)
            if (singles.on) return typename Mis::Ratio{};
        return ratio;
    }
};

}  // namespace ambilux
