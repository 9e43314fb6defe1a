// Integrators that keep something from wave to wave, such as what variant learned has learned.
#pragma once

#include "queues/layout.h"

namespace ambilux {

/// Its lay_out_kept, fill_kept, learn and items_to_learn are as those of LearnedIntegrator. Renderers bring what is
/// kept up to date after every sample of the whole film.
template <class Integrator>
concept KeepsBetweenWaves =
    requires(Layout& layout, typename Integrator::Policy& policy) { Integrator::lay_out_kept(layout, policy); };

}  // namespace ambilux
