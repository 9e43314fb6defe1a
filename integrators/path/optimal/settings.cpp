#include "integrators/path/optimal/settings.h"

#include "integrators/path/optimal/variant.h"

namespace ambilux {

std::vector<Declaration<OptimalSettings>> PathOptimalVariant::settings() {
    using Of = Declare<OptimalSettings>;
    return {
        Of::choice(
            "optimal_learning", &OptimalSettings::learning, {"least_squares", "densities"},
            "how weights follow from samples: by least squares of what they brought, or by integrals of products "
            "of densities (Kondapaneni et al. 2019)"),
        Of::number("optimal_strategies", &OptimalSettings::strategies, 1u, OptimalSettings::kMostStrategies,
                   "strategies of next event estimation at most: the emitters that are picked most often are one each, "
                   "all others together are the last; 1: all are one"),
        Of::number("optimal_vertices", &OptimalSettings::vertices, 1u, OptimalSettings::kMostVertices,
                   "vertices of a path, the first ones, whose strategies have optimal weights; Russian roulette begins "
                   "behind them"),
        Of::number("optimal_block", &OptimalSettings::block, 1u, 64u,
                   "side of the square blocks of pixels that have their weights in common"),
        Of::number("optimal_samples", &OptimalSettings::iteration_samples, 1u, 1024u,
                   "samples of every pixel in one iteration, which has the weights that those before it have taught"),
    };
}

OptimalSettings OptimalSettings::plan(const RenderSettings& settings) {
    return own_settings(PathOptimalVariant::settings(), settings);
}

}  // namespace ambilux
