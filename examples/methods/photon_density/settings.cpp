#include "settings.h"

#include "variant.h"

namespace ambilux {

std::vector<Declaration<photon_density::Settings>> PhotonDensityVariant::settings() {
    using S = photon_density::Settings;
    return {
        Declare<S>::number("photon_radius", &S::radius, 1e-6f, 1.0f,
                           "radius around an eye vertex in which photons count, in the first iteration, over the "
                           "radius of the scene"),
        Declare<S>::number("photon_alpha", &S::alpha, 0.0f, 1.0f,
                           "the squared radius of iteration i is i^(alpha - 1) times that of the first; 1: it stays"),
        Declare<S>::number("photon_samples", &S::iteration_samples, 1u, 1024u,
                           "samples of every pixel in one iteration: they share photons and radius")};
}

photon_density::Settings photon_density::Settings::plan(const RenderSettings& settings) {
    return own_settings(PhotonDensityVariant::settings(), settings);
}

}  // namespace ambilux
