// The variants of integrators bdpt and light.
#pragma once

#include "integrators/bdpt/lvc/integrator.h"
#include "integrators/bdpt/megakernel/integrator.h"
#include "integrators/bdpt/streaming/integrator.h"
#include "integrators/bdpt/wavefront/integrator.h"

namespace ambilux {

struct BdptFamily {
    static constexpr bool kConnectsOnHost = true;

    template <class Function>
    static auto with_variant(const std::string& variant, Function f) {
        if (variant == "megakernel") return f.template operator()<MegakernelIntegrator>();
        if (variant == "streaming") return f.template operator()<StreamingIntegrator>();
        if (variant == "lvc") return f.template operator()<LvcIntegrator>();
        return f.template operator()<WavefrontIntegrator>();
    }
};

}  // namespace ambilux
