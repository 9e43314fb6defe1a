// Ground truth: a path-traced image with its standard error, made in parts that may lie days apart.
#pragma once

#include <functional>
#include <string>

#include "experiments/drive.h"
#include "experiments/hooks.h"
#include "film/exr_io.h"

namespace ambilux {

/// The random seed of a reference. References and renders of equal `seed` must not share random numbers: an image compared with a reference that holds the same
/// samples would look better than it is. A bijective hash (SplitMix64, Steele et al. 2014) takes it far from the small seeds that people use.
uint64_t reference_seed(uint64_t seed);

struct ReferenceRequest {
    std::string path;         ///< EXR file; continued if it exists
    uint64_t spp = 0;         ///< total; at least 2
    RenderSettings settings;  ///< seed, depths, backend; integrator and estimator are replaced by path and mis
    double checkpoint_seconds = 30;
    const volatile bool* interrupt = nullptr;
    std::function<void(const RenderPosition&)> on_batch;
};

struct ReferenceResult {
    Reference reference;
    Attributes attributes;
    RenderStats stats;             ///< of this call only
    uint64_t continued_from = 0;   ///< samples that the file held before
    bool interrupted = false;
};

/// Brings the file up to `spp` samples and saves it every `checkpoint_seconds` and at the end, also when interrupted. A file that holds as many samples already is
/// returned as it is. Throws Error(bad_input) that names what differs if the file is of another scene, size, depth or seed.
ReferenceResult make_reference(const Scene& scene, const ReferenceRequest& request, const Hooks& hooks);

}  // namespace ambilux
