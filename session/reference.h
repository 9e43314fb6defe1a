// Ground truth: a converged image with its standard error, made in parts that may lie days apart.
#pragma once

#include <functional>
#include <string>

#include "film/exr_io.h"
#include "session/drive.h"
#include "session/hooks.h"

namespace ambilux {

/// The random seed of a reference. References and renders of equal `seed` must not share random numbers: an image
/// compared with a reference that holds the same samples would look better than it is. A bijective hash (SplitMix64,
/// Steele et al. 2014) takes it far from the small seeds that people use.
uint64_t reference_seed(uint64_t seed);

struct ReferenceRequest {
    std::string path;           ///< EXR file; continued if it exists
    uint64_t spp = 0;           ///< total; at least 2
    RenderSettings settings;    ///< integrator path or bdpt and all else that decides the image; estimator mis
    std::string settings_text;  ///< what is not as usual, such as "variant=lvc": names the making, and a file of
                                ///< another is refused. Empty: the path tracer
    double checkpoint_seconds = 30;
    const volatile bool* interrupt = nullptr;
    std::function<void(const RenderPosition&)> on_batch;
};

/// A reference by given settings, which are part of its identity. Throws Error(usage) for those that it cannot have.
ReferenceRequest reference_request(const std::string& path, uint64_t spp, const RenderSettings& settings);

struct ReferenceResult {
    Reference reference;
    Attributes attributes;
    RenderStats stats;            ///< of this call only
    uint64_t continued_from = 0;  ///< samples that the file held before
    bool interrupted = false;
};

/// Brings the file up to `spp` samples and saves it every `checkpoint_seconds` and at the end, also when interrupted. A
/// file that holds as many samples already is returned as it is. Until the file is complete its sums lie beside it in
/// full precision (PATH.sums), so that a reference that was killed and continued has the values of one that was not;
/// one that is extended later starts from the stored floats (6e-8 relative), and its method learns anew. Throws
/// Error(bad_input) that names what differs if the file is of another scene, size, depth, seed or integrator.
ReferenceResult make_reference(const Scene& scene, const ReferenceRequest& request, const Hooks& hooks);

}  // namespace ambilux
