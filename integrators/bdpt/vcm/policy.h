// What vcm does where, decided once by the host.
#pragma once

#include "integrators/bdpt/shared/policy.h"
#include "integrators/bdpt/shared/subpath_number.h"
#include "integrators/bdpt/vcm/merge_keys.h"
#include "integrators/bdpt/vcm/merging_mis.h"
#include "integrators/bdpt/vcm/settings.h"

namespace ambilux {

template <class Mis>
struct VcmPolicyOf : BdptPolicyOf<Mis> {
    using BdptPolicyOf<Mis>::rules;
    using BdptPolicyOf<Mis>::waves;

    VcmSettings vcm;
    MergeKeys keys;
    float first_radius;     ///< of the first iteration
    uint32_t vertex_lanes;  ///< of a light vertex, as kernels of these features use them

    /// First vertices of light subpaths merge; else next event estimation finds what arrives there, beams excepted.
    bool keeps_first() const { return rules.mis.competes() || !rules.next_event; }
    /// Light subpaths of an iteration.
    float subpaths() const { return rules.mis.light_subpaths * float(vcm.samples); }
    IterationNumbers numbers() const { return {vcm.samples, waves.light_rounds()}; }
    /// Iterations from `iteration` on that may be done at once.
    uint32_t together(uint32_t iteration) const {
        return vcm.alpha < 1.0f ? RadiusStep::of(iteration).end() - iteration : ~0u;
    }

    /// Throws Error(usage) if light subpaths of an iteration are more than keys can number.
    static VcmPolicyOf plan(const Scene& scene, const RenderSettings& settings);
    /// Chooses the table by the mean number of vertices that a light subpath leaves, and how many there may be.
    void size_table(double mean_vertices);
};
using VcmPolicy = VcmPolicyOf<MergingMis>;

}  // namespace ambilux
