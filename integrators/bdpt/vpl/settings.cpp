#include "integrators/bdpt/vpl/settings.h"

#include <fmt/format.h>

#include "integrators/bdpt/vpl/variant.h"
#include "integrators/registry.h"

namespace ambilux {

std::vector<Declaration<VplSettings>> VplVariant::settings() {
    using Of = Declare<VplSettings>;
    return {Of::number("vpl_subpaths", &VplSettings::subpaths, 1u, VplSettings::kMostSubpaths,
                       "light subpaths of an iteration, whose vertices all pixels share"),
            Of::number("vpl_samples", &VplSettings::samples, 1u, 1024u,
                       "samples of every pixel in one iteration: they share its light vertices"),
            Of::number("vpl_draws", &VplSettings::draws, 0u, 1u << 16,
                       "light vertices that an eye vertex is connected with, drawn from those of the iteration if "
                       "there are more; 0: all of them"),
            Of::number("vpl_clamp", &VplSettings::clamp, 0.0f, 1e12f,
                       "bound of the geometry term of a connection (cosines over the squared distance) in units of "
                       "1 / (radius of the scene)^2; 0: none, unbiased")};
}

VplSettings VplSettings::plan(const RenderSettings& settings) { return own_settings(VplVariant::settings(), settings); }

std::string VplVariant::bias(const RenderSettings& settings) {
    const float clamp = VplSettings::plan(settings).clamp;
    if (clamp == 0.0f) return "";
    return fmt::format("biased: geometry term of connections clamped at {:.3g} over the squared radius of the scene",
                       clamp);
}

}  // namespace ambilux
