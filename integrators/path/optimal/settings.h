// What variant optimal of integrator path can be told.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

/// How the weights of least variance follow from samples.
enum class OptimalLearning : uint32_t {
    least_squares,  ///< of what samples brought
    densities,      ///< by integrals of products of densities (Kondapaneni et al. 2019)
};

struct OptimalSettings {
    static constexpr uint32_t kMostStrategies = 4, kMostVertices = 4;

    OptimalLearning learning = OptimalLearning::least_squares;
    uint32_t strategies = 4;         ///< of next event estimation, at most
    uint32_t vertices = 1;           ///< of a path, the first ones, whose strategies have optimal weights
    uint32_t block = 2;              ///< side of the blocks of pixels that learn together
    uint32_t iteration_samples = 4;  ///< samples of every pixel in one iteration

    static OptimalSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
