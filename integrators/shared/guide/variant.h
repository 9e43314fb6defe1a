// What guided variants have.
#pragma once

#include "integrators/setting.h"
#include "integrators/shared/guide/settings.h"

namespace ambilux {

struct GuidedVariant {
    static std::vector<Declaration<GuidedSettings>> settings();
};
/// And those whose light subpaths may be guided.
struct GuidedSidesVariant {
    static std::vector<Declaration<GuidedSettings>> settings();
};

}  // namespace ambilux
