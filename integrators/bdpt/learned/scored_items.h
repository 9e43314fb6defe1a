// Items from which draws of light vertices are learned: those of other methods, with a score.
#pragma once

#include "items/candidate_items.h"

namespace ambilux {

/// Where a score goes to in the table, kNone for nothing to be learned, and what it is.
struct Score {
    uint32_t entry = kNone;
    float value = 0.0f;
};

struct ScoredCandidate {
    CandidateItem candidate;
    Score score;
    uint32_t pad[2];

    ScoredCandidate() = default;
    /// Of next event estimation: nothing is learned from it.
    AMBILUX_HD ScoredCandidate(const CandidateItem& c, const Score& s = {}) : candidate(c), score(s), pad{} {}

    AMBILUX_HD uint32_t path() const { return candidate.path; }
};

/// A ShadowItem with a score.
struct ScoredShadowItem {
    Rgb value;
    uint32_t path;
    Vec3f origin;
    float tmax;
    Vec3f direction;
    uint32_t opacity_seed;
    Score score;
    uint32_t pad[2];

    AMBILUX_HD ShadowItem ray() const { return {value, path, origin, tmax, direction, opacity_seed}; }
};

AMBILUX_HD ScoredCandidate noted(const CandidateItem& c, const Score& score) { return {c, score}; }
AMBILUX_HD const CandidateItem& plain(const ScoredCandidate& c) { return c.candidate; }
AMBILUX_HD void make_shadow(const CandidateItem& c, Rgb value, ScoredShadowItem& item) {
    item = {value, c.path, c.origin, c.tmax, c.direction, c.opacity_seed, {}, {}};
}
AMBILUX_HD void make_shadow(const ScoredCandidate& c, Rgb value, ScoredShadowItem& item) {
    make_shadow(c.candidate, value, item);
    item.score = c.score;
}

}  // namespace ambilux
