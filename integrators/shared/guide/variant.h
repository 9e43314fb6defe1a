// What all guided variants have.
#pragma once

#include "integrators/setting.h"
#include "integrators/shared/guide/settings.h"

namespace ambilux {

struct GuidedVariant {
    static std::vector<Declaration<GuidedSettings>> settings();
};

}  // namespace ambilux
