// Weights where numbers may be shuffled, Owen-scrambled Sobol' points (core/sobol.h). All else is that of `Base`.
#pragma once

#include "core/sobol.h"
#include "transport/mis/by_tree.h"

namespace ambilux {

using ChosenNumbers = NumbersFrom<ChosenPoints>;

template <class Base>
struct BySobol : Base {
    using Numbers = ChosenNumbers;

    bool sobol = false;
    uint32_t light_subpaths_per_tile = 0;  ///< which number a light subpath has among those of its sample
};

/// The model of weights for kernels of features F.
template <Features F, class Mis>
using ModelFor = std::conditional_t<F.sampling, BySobol<ByTree<Mis>>, Mis>;

}  // namespace ambilux
