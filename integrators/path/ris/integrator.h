// path, variant ris: the path tracer with another stage in the place of next event estimation.
#pragma once

#include "integrators/path/integrator.h"
#include "integrators/path/ris/ris.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
using PathRisIntegrator = PathIntegrator<F, Tracer, kFusion, ResampledNextEvent, RisSettings>;

}  // namespace ambilux
