// vcm, variant correlated: the same stages with other weights.
#pragma once

#include "integrators/bdpt/correlated/correlation_mis.h"
#include "integrators/bdpt/vcm/integrator.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct CorrelatedIntegrator : VcmOf<F, Tracer, kFusion, CorrelationMis> {
    using Vcm = VcmOf<F, Tracer, kFusion, CorrelationMis>;

    static typename Vcm::Policy plan(const Scene& scene, const RenderSettings& settings) {
        typename Vcm::Policy p = Vcm::plan(scene, settings);
        p.rules.mis.least_factor = 1.0f / p.subpaths();
        return p;
    }
};

}  // namespace ambilux
