// Weights where numbers are shuffled, Owen-scrambled Sobol' points (core/sobol.h). All else is that of `Base`.
#pragma once

#include "core/sobol.h"
#include "transport/mis/by_tree.h"

namespace ambilux {

using SobolNumbers = NumbersFrom<SobolPoints>;

template <class Base>
struct BySobol : Base {
    using Numbers = SobolNumbers;

    uint32_t light_subpaths_per_tile = 0;  ///< which number a light subpath has among those of its sample
};

/// The model of weights for kernels of features F.
template <Features F, class Mis>
using ModelFor = std::conditional_t<F.sobol, BySobol<PickingMis<F, Mis>>, PickingMis<F, Mis>>;

}  // namespace ambilux
