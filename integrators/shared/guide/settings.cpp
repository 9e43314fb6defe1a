#include "integrators/shared/guide/settings.h"

#include "integrators/shared/guide/variant.h"

namespace ambilux {

std::vector<Declaration<GuidedSettings>> GuidedVariant::settings() {
    using Of = Declare<GuidedSettings>;
    return {
        Of::choice("guide_target", &GuidedSettings::target, {"radiance", "moment"},
                   "what directions are learned in proportion to: incident radiance (Müller et al. 2017), or the root "
                   "of the second moment of what a sample brings, BSDF and all (Rath et al. 2020)"),
        Of::number("guide_bsdf", &GuidedSettings::bsdf_share, 0.05f, 1.0f,
                   "share of directions that the BSDF samples, at first; the others follow what was learned"),
        Of::flag("guide_learn_bsdf", &GuidedSettings::learn_share,
                 "every leaf takes the share of the BSDF with which what it found would have had the least second "
                 "moment"),
        Of::flag(
            "guide_roulette", &GuidedSettings::roulette,
            "Russian roulette goes by what a path is expected to bring, over what its pixel is expected to be (Vorba "
            "and Křivánek 2016); false: by throughput"),
        Of::flag(
            "guide_filter", &GuidedSettings::filter,
            "what a path has found is learned at a random direction within the cell around it (Müller 2019, without "
            "his filter over space)"),
        Of::number(
            "guide_split", &GuidedSettings::split, 16u, 1u << 24,
            "records that brought light to a leaf above which it splits in the first round of training; in round "
            "k sqrt(2^k) times as many"),
        Of::number("guide_leaves", &GuidedSettings::most_leaves, 0u, 1u << 16,
                   "leaves of the tree over space, at most, of 13 KiB each; 0: 8192, of bdpt 4096"),
        Of::number("guide_until", &GuidedSettings::until, 0u, 1u << 20,
                   "iterations that are learned from, which takes time; later ones sample from the last trees. 0: "
                   "training alone"),
        Of::number("guide_samples", &GuidedSettings::iteration_samples, 0u, 1024u,
                   "samples of every pixel in one iteration; training before the first takes up to twice as many. 0: "
                   "by the size of the film, so that a device has eight million paths in one, a CPU 250 thousand, but "
                   "at most an eighth of the samples that are asked for, and a divisor of their number"),
    };
}

std::vector<Declaration<GuidedSettings>> GuidedSidesVariant::settings() {
    auto all = GuidedVariant::settings();
    all.push_back(Declare<GuidedSettings>::choice(
        "guide_sides", &GuidedSettings::sides, {"eye", "light", "both"},
        "which subpaths are guided: eye subpaths by where light comes from, light subpaths by where importance comes "
        "from; with both, each side has half of guide_leaves"));
    return all;
}

GuidedSettings GuidedSettings::plan(const RenderSettings& settings) {
    return own_settings(GuidedSidesVariant::settings(), settings);
}

}  // namespace ambilux
