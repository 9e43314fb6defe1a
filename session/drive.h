// Runs a renderer up to a budget of samples or of wall-clock time.
#pragma once

#include <functional>

#include "render/renderer.h"

namespace ambilux {

/// A renderer that says what its last call of render() cost: one in another process, where handing images over does not
/// count.
class SelfTimed {
public:
    virtual ~SelfTimed() = default;
    virtual double last_seconds() const = 0;
};

/// Where a render stands. `seconds` is wall clock inside Renderer::render, or what a SelfTimed renderer says, so that
/// progress output, metrics and file writing do not count.
struct RenderPosition {
    uint64_t samples = 0;  ///< per pixel
    double seconds = 0;
    bool interrupted = false;
    double per_sample = 0;  ///< seconds, as last measured; 0: unknown
    uint64_t last_count = 0;
    uint32_t iteration_samples = 1;  ///< of the renderer

    double per_iteration() const { return per_sample * iteration_samples; }
};

/// Ends at whichever comes first; 0 is no limit, but one must be set. Counted from the start of the whole render, not
/// of one call.
struct Budget {
    uint64_t samples = 0;
    double seconds = 0;
};

/// Throws Error(usage) if `samples`, which `name` asks for, are no whole iterations of `k` samples.
void check_iterations(const std::string& name, uint64_t samples, uint32_t k, const RenderSettings& method);

/// Adds samples to `position` until the budget is used up or *interrupt becomes true. Clocks and signals are looked at
/// after batches of about 0.2 s, which are whole iterations (for most methods: samples). A time budget is met to within
/// half an iteration: the last batches are sized by the measured time of a sample (pitfall G14), which a position
/// brings along from an earlier call; with it, a call that has no time for half an iteration makes none, and else at
/// least one. `on_batch` sees the position after each batch. Throws Error(device) if the renderer makes no progress,
/// Error(usage) past 2^32 - 1 samples and for a number of samples that is no whole iterations.
RenderPosition drive(Renderer& renderer, RenderPosition position, const Budget& budget,
                     const volatile bool* interrupt = nullptr,
                     const std::function<void(const RenderPosition&)>& on_batch = {});

}  // namespace ambilux
