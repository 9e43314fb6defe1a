// What vpl does where, decided once by the host.
#pragma once

#include "integrators/bdpt/shared/policy.h"
#include "integrators/bdpt/vpl/settings.h"
#include "integrators/bdpt/vpl/vpl_mis.h"

namespace ambilux {

struct VplPolicy : BdptPolicyOf<VplMis> {
    VplSettings vpl;
    uint32_t vertex_lanes;  ///< of a light vertex, as kernels of these features use them

    /// Of light subpaths. Their vertices go where others have connections with the camera, and the segment that
    /// connects them is none of theirs.
    Rules<VplMis> light_rules() const {
        Rules<VplMis> r = rules;
        r.splat = true;
        r.connect = false;
        --r.max_depth;
        return r;
    }

    /// Throws Error(usage) if the film has no slots for that many light subpaths.
    static VplPolicy plan(const Scene& scene, const RenderSettings& settings);
};

}  // namespace ambilux
