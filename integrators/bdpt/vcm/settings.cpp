#include "integrators/bdpt/vcm/settings.h"

#include "integrators/bdpt/vcm/variant.h"

namespace ambilux {

std::vector<Declaration<VcmSettings>> VcmVariant::settings() {
    using Of = Declare<VcmSettings>;
    return {Of::number("merge_radius", &VcmSettings::radius, 1e-7f, 1.0f,
                       "radius around an eye vertex within which light vertices merge with it, in the first iteration, "
                       "over the radius of the scene"),
            Of::number("merge_alpha", &VcmSettings::alpha, 0.0f, 1.0f,
                       "the squared radius of iteration i is i^(alpha - 1) times that of the first; 1: it stays"),
            Of::flag("merge_first", &VcmSettings::first, "eye subpaths merge at their first vertex too"),
            Of::number("merge_samples", &VcmSettings::samples, 1u, 1024u,
                       "samples of every pixel in one iteration: they share light vertices and radius")};
}

VcmSettings VcmSettings::plan(const RenderSettings& settings) { return own_settings(VcmVariant::settings(), settings); }

}  // namespace ambilux
