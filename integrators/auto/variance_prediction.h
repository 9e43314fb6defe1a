// What the paths of a pilot tell of the second moments of the estimators that it judges (docs/theory.md, section 11).
#pragma once

#include <algorithm>
#include <vector>

#include "core/math.h"
#include "integrators/auto/pilot.h"

namespace ambilux {

constexpr uint32_t kMostCandidates = 24;
/// A candidate that finds a path this much less often than the pilot does may show it as single bright pixels.
constexpr float kRareShare = 0.02f;

/// Densities of the groups that could have sampled a path, in multiples of that which did, all with the numbers of
/// samples of paired subpaths.
struct PilotShares {
    float unidirectional, light, connections;
};

/// What a path brings without a weight, and who could have found it.
struct PilotEvent {
    Rgb value;  ///< f / (n p) of the strategy that found it, for paired subpaths
    PilotShares shares;
    float coverage = 1.0f;  ///< of a splat: how much of it pixels of the film take
    bool nearby = false;    ///< found by none of the strategies (integrators/auto/merging.h): of density 1
    float total() const { return nearby ? 1.0f : shares.unidirectional + shares.light + shares.connections; }
};

struct PilotSplat {
    PilotEvent event;
    uint32_t block;
    bool seen;     ///< the emitter itself
    Rgb radiance;  ///< of it
};

/// Sums over the samples of one pixel, or of one splat.
struct PilotSums {
    double mean[3] = {};
    double variance[kMostCandidates][3] = {};
    double seen[3] = {};           ///< largest radiance of emitters that the camera sees here
    std::vector<PilotEvent> rare;  ///< for some candidate
};

/// How the paths that a pilot found would add to the second moments of its candidates.
struct SecondMoments {
    std::vector<PilotCandidate> candidates;
    uint32_t samples = 0;       ///< eye subpaths of the pilot, and as many light subpaths
    size_t light_vertices = 0;  ///< of these
    float filter_energy =
        1;  ///< mean over places on the film of the sum of squares of what a splat counts for its pixels

    /// Sum of the candidate's densities over that of the strategy that found the path.
    float sum_of(uint32_t c, const PilotShares& s) const {
        const PilotCandidate& candidate = candidates[c];
        float sum = s.unidirectional + candidate.light_subpaths * s.light;
        if (candidate.connect) sum += s.connections * connections(candidate);
        return sum;
    }
    float connections(const PilotCandidate& c) const {
        return c.draws == 0 ? 1.0f
                            : float(double(c.draws) * double(samples) / double(std::max<size_t>(1, light_vertices)));
    }

    /// Adds a path of the pilot's own estimator to the second moments of all candidates (equation 30).
    void add(const PilotEvent& e, PilotSums& sums) const {
        const float weight = e.coverage / e.total();
        bool rare = false;
        for (int k = 0; k < 3; ++k) sums.mean[k] += double(e.value[k] * weight);
        for (uint32_t c = 0; c < candidates.size(); ++c) {
            const float sum = sum_of(c, e.shares);
            if (!(sum > 0.0f)) continue;  // it does not find it, or rounding says so (integrators/reachability.h)
            rare |= sum < kRareShare * e.total();
            for (int k = 0; k < 3; ++k) sums.variance[c][k] += second_moment(c, e, sum) * sqr(double(e.value[k]));
        }
        if (rare) sums.rare.push_back(e);
    }

    /// What a path adds to the second moment of a candidate, over its squared value.
    double second_moment(uint32_t c, const PilotEvent& e, float sum) const {
        const double by_light = double(candidates[c].light_subpaths * e.shares.light / sum);
        return double(e.coverage) * (1.0 - (1.0 - double(filter_energy)) * by_light) /
               (double(e.total()) * double(sum));
    }
};

/// All that a pilot found.
struct PilotPaths {
    const std::vector<PilotSums>& pixels;  ///< block by block
    const std::vector<const PilotSplat*>& splats;
    uint32_t pixels_per_block, samples_per_pixel;
    double expected_samples;  ///< of every pixel, that the render takes
    uint64_t film_pixels;
};

/// Fills Pilot::variance from sums over pixels and splats.
void predict_variances(const SecondMoments& moments, const PilotPaths& paths, Pilot& result);

}  // namespace ambilux
