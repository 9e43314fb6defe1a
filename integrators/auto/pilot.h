// Second moments of several estimators from one set of paths, before the render (docs/theory.md, section 11).
#pragma once

#include "accel/shared_accels.h"
#include "integrators/settings.h"

namespace ambilux {

/// What is predicted is the error after all samples of the render, all pixels included, but for the brightest
/// contributions, of which the whole image is expected to have no more than this: most renders do without them.
constexpr double kUnexpected = 1.0;
/// A shadow ray of next event estimation in rays of subpaths.
constexpr double kShadowWork = 0.8;

/// An estimator that the pilot judges. All have hits and next event estimation.
struct PilotCandidate {
    float light_subpaths;  ///< light subpaths per pixel, each connected with the camera; 0: none
    bool connect;          ///< connections
    uint32_t draws;        ///< of each eye vertex from a cache of light vertices; 0: paired subpaths
};

/// Mean numbers per eye subpath, or per pair of subpaths.
struct PilotWork {
    double eye_rays = 0, light_rays = 0;
    double next_events = 0, splats = 0;  ///< shadow rays of them
    double vertices = 0;                 ///< of an eye subpath that can be connected
    double pairs = 0, pair_rays = 0;     ///< of paired subpaths: connections tried, shadow rays
    double draws = 0, draw_rays = 0;     ///< of one draw at each eye vertex

    /// What eye subpaths have, `share` times.
    void add_eye(const PilotWork& w, double share);
};

/// About how many samples of every pixel the render will take: those asked for; those that a path tracer makes in the
/// time asked for, on the usual machine of its backend and not on this one, so that the choice repeats everywhere; the
/// larger of both; 1000 if nothing is known. What shows as one bright pixel in a thousand after few samples is a part
/// of the noise after many.
double expected_samples(const RenderSettings& settings, const PilotWork& work, uint64_t pixels, bool cuda);

struct Pilot {
    uint32_t blocks_x = 0, blocks_y = 0;
    uint32_t samples = 0;         ///< eye subpaths, and as many light subpaths
    double expected_samples = 0;  ///< see above
    /// Of each candidate and block of the film: variance of one sample of a pixel over the block's squared mean plus
    /// 0.01, mean over pixels and channels; without rare outliers, for which the light that they bring counts as
    /// missing.
    std::vector<std::vector<double>> variance;
    double light_vertices = 0;  ///< mean of a light subpath
    PilotWork work;
    std::vector<PilotWork> block_work;  ///< of the eye subpaths of each block, with the light subpaths of the film
};

/// About `samples` eye subpaths, and as many light subpaths, over the whole film. The numbers are those of
/// Stream::pilot and depend on the seed alone. Weights are those of the balance heuristic, whatever the render uses.
/// `cuda`: for a render on a device. `cwbvh`: over this structure instead of Embree's.
Pilot run_pilot(const Scene& scene, const RenderSettings& settings, bool cuda, bool cwbvh, SharedAccels& accels,
                const std::vector<PilotCandidate>& candidates, uint32_t samples);

}  // namespace ambilux
