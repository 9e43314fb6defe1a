// The variants of integrator path.
#pragma once

#include "integrators/path/integrator.h"

namespace ambilux {

struct PathFamily {
    static constexpr bool kConnectsOnHost = false;  ///< Fusion: next event estimation as a stage of its own on a host

    /// f.template operator()<Integrator>() for the variant of this name.
    template <class Function>
    static auto with_variant(const std::string&, Function f) {
        return f.template operator()<PathIntegrator>();
    }
};

}  // namespace ambilux
