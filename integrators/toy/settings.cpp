#include "integrators/toy/variant.h"

namespace ambilux {

std::vector<Declaration<ToySettings>> ToyVariant::settings() {
    return {Declare<ToySettings>::number("radius", &ToySettings::radius, 0.0f, 1e30f,
                                         "surfaces further away than this do not shade; 0: no limit")};
}

ToySettings ToySettings::plan(const RenderSettings& settings) { return own_settings(ToyVariant::settings(), settings); }

}  // namespace ambilux
