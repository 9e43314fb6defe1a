// What guided variants can be told.
#pragma once

#include <algorithm>

#include "transport/subpath/subpath.h"

namespace ambilux {

struct RenderSettings;

/// What directions are sampled in proportion to.
enum class GuideTarget : uint32_t {
    radiance,  ///< incident radiance (Müller et al. 2017)
    moment,    ///< root of the second moment of what a sample brings (Rath et al. 2020)
};

/// Subpaths of which side are guided.
enum class GuideSides : uint32_t { eye, light, both };

struct GuidedSettings {
    GuideSides sides = GuideSides::eye;
    GuideTarget target = GuideTarget::radiance;
    float bsdf_share = 0.5f;         ///< of directions that the BSDF samples, at first
    bool learn_share = true;         ///< every leaf has a share of its own from the second update on
    bool roulette = true;            ///< by what paths are expected to bring
    bool filter = true;              ///< what was learned is spread over the directions around it
    uint32_t split = 32;             ///< records that brought light to a leaf above which it splits, in the first round
    uint32_t most_leaves = 0;        ///< of the trees over space together; 0: by the method
    uint32_t until = 1u << 20;       ///< iterations that are learned from; trees stay as they are after them
    uint32_t iteration_samples = 0;  ///< samples of every pixel in one iteration; 0: by the size of the film

    static GuidedSettings plan(const RenderSettings& settings);
    bool guides(Side side) const { return (uint32_t(sides) + 1) >> uint32_t(side) & 1u; }
    /// What light subpaths bring is not known where they scatter.
    GuidedSettings of_light() const {
        GuidedSettings s = *this;
        s.target = GuideTarget::radiance;
        return s;
    }
    /// Of the tree of a side.
    uint32_t leaves_of(Side side) const {
        return guides(side) ? std::max(most_leaves / (sides == GuideSides::both ? 2 : 1), 1u) : 1;
    }
};

}  // namespace ambilux
