// No path is found twice, so nothing is weighted; a geometry term above its bound is a weight below 1.
#pragma once

#include "integrators/bdpt/vcm/merging_mis.h"

namespace ambilux {

struct VplMis : BidirectionalMis {
    using Directions = MergingDirections;

    float inverse_bound = 0.0f;  ///< of the geometry term; 0: there is none

    template <Features F>
    AMBILUX_HD void start_eye(const SceneView&, Vec3f, MisSums&, SubpathStart&) const {}
    AMBILUX_HD static void start_light(const EmissionSample&, SubpathStart&) {}
    template <Features F, class Path, class Lights>
    AMBILUX_HD static MisSums sums_at(const SceneView&, const Lights&, Side, const Path&, MisSums,
                                      const SurfacePoint&) {
        return {};
    }
    AMBILUX_HD static MisSums sums_after_scatter(MisSums, bool, bool, float, float, float) { return {}; }

    // ---- ratios: eye subpaths meet emitters after deltas alone ----

    template <Features F, class Path, class Lights>
    AMBILUX_HD static bool hit_ratio(const SceneView&, const Lights&, const Path&, MisSums, uint32_t,
                                     const SurfacePoint&, float& ratio) {
        ratio = 0.0f;
        return true;
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD static bool escape_ratio(const SceneView&, const Lights&, const Path&, MisSums, float& ratio) {
        ratio = 0.0f;
        return true;
    }
    template <Features F>
    AMBILUX_HD static float next_event_ratio(const SceneView&, float, MisSums, bool, const EmitterSample&,
                                             const BsdfValue&, float) {
        return 0.0f;
    }
    /// 1 / (1 + ratio) = min(1, bound / geometry term): the bounded term of Kollig and Keller 2004.
    AMBILUX_HD float connection_ratio(MisSums, bool, MisSums, bool, const ConnectionDensities& p) const {
        return max(0.0f, p.geometry * inverse_bound - 1.0f);
    }
};

}  // namespace ambilux
