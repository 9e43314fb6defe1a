// Whether tests of a device can run.
#pragma once

#include "render/renderer.h"
#include "tests/support/skip.h"

namespace ambilux {

/// False, with a warning that the test was skipped, where no device answers.
inline bool device() {
    if (cuda_available()) return true;
    skip("no CUDA device: skipped");
    return false;
}

}  // namespace ambilux
