// What guided variants can be told.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

/// What directions are sampled in proportion to.
enum class GuideTarget : uint32_t {
    radiance,  ///< incident radiance (Müller et al. 2017)
    moment,    ///< root of the second moment of what a sample brings (Rath et al. 2020)
};

struct GuidedSettings {
    GuideTarget target = GuideTarget::radiance;
    float bsdf_share = 0.5f;         ///< of directions that the BSDF samples, at first
    bool learn_share = true;         ///< every leaf has a share of its own from the second update on
    bool roulette = true;            ///< by what paths are expected to bring
    bool filter = true;              ///< what was learned is spread over the directions around it
    uint32_t split = 32;             ///< records that brought light to a leaf above which it splits, in the first round
    uint32_t most_leaves = 0;        ///< of the tree over space; 0: by the method
    uint32_t until = 1u << 20;       ///< iterations that are learned from; trees stay as they are after them
    uint32_t iteration_samples = 0;  ///< samples of every pixel in one iteration; 0: by the size of the film

    static GuidedSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
