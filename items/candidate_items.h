// Light on its way to a pixel, as queues keep it.
#pragma once

#include "models/parameters.h"
#include "transport/mis/strategy.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

/// Emission that an eye subpath met, before it is weighted.
struct EmissionItem {
    Rgb value;
    uint32_t path;
    float ratio;  ///< weight = 1 / (1 + ratio)
    Strategy strategy;
    uint32_t pad[2];
};

/// `tmax` of a segment towards the environment: its value lacks the radiance, which is looked up only if the way is
/// free.
constexpr float kTowardsEnvironment = -kInfinity;

/// What an eye vertex or a light vertex found, and the segment that must be free for it.
struct CandidateItem {
    Rgb value;  ///< splats: weighted, once mis_weight has seen them
    uint32_t path;
    Vec3f origin;
    float tmax;  ///< or kTowardsEnvironment
    Vec3f direction;
    uint32_t opacity_seed;
    Vec2f film;  ///< splats: position in pixels of the full film
    float ratio;
    Strategy strategy;
};

/// A shadow ray and what it is worth if it is free.
struct ShadowItem {
    Rgb value;
    uint32_t path;
    Vec3f origin;
    float tmax;  ///< or kTowardsEnvironment
    Vec3f direction;
    uint32_t opacity_seed;
};

AMBILUX_HD void make_shadow(const CandidateItem& c, Rgb value, ShadowItem& item) {
    item = {value, c.path, c.origin, c.tmax, c.direction, c.opacity_seed};
}

/// Of a candidate from which nothing is to be learned.
struct NoNote {};
AMBILUX_HD const CandidateItem& noted(const CandidateItem& c, NoNote) { return c; }
/// Without what some methods add to it.
AMBILUX_HD const CandidateItem& plain(const CandidateItem& c) { return c; }

/// Light to be added to the sample of a path.
struct alignas(16) Contribution {
    Rgb value;
    uint32_t path;
};

/// Light that arrived on the film.
struct SplatItem {
    Rgb value;
    uint32_t path;
    Vec2f film;
    Strategy strategy;
    float ratio;  ///< by which it was weighted
};

/// An eye vertex and a light vertex to be connected.
struct PairItem {
    uint32_t vertex;  ///< place of the eye vertex in the queue of its depth
    uint32_t light;   ///< place of the light vertex
    uint32_t path;
    uint32_t next;  ///< where the search for the next light vertex starts (LightVertexSearch); kNone: there is no other
};

template <class Mis>
AMBILUX_HD CandidateItem pack_candidate(const Candidate<Mis>& c, uint32_t path, uint32_t opacity_seed) {
    return {c.value, path,    c.origin,  c.environment ? kTowardsEnvironment : c.tmax, c.direction, opacity_seed,
            c.film,  c.ratio, c.strategy};
}

}  // namespace ambilux
