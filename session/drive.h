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
};

/// Ends at whichever comes first; 0 is no limit, but one must be set. Counted from the start of the whole render, not
/// of one call.
struct Budget {
    uint64_t samples = 0;
    double seconds = 0;
};

/// Adds samples to `position` until the budget is used up or *interrupt becomes true. Clocks and signals are looked at
/// after batches of about 0.2 s. A time budget is met to within half a sample of every pixel: the last batches are
/// sized by the measured time of a sample (pitfall G14), which a position brings along from an earlier call; with
/// it, a call that has no time for half a sample makes none, and else at least one. `on_batch` sees the position after
/// each batch. Throws Error(device) if the renderer makes no progress, Error(usage) past 2^32 - 1 samples.
RenderPosition drive(Renderer& renderer, RenderPosition position, const Budget& budget,
                     const volatile bool* interrupt = nullptr,
                     const std::function<void(const RenderPosition&)>& on_batch = {});

}  // namespace ambilux
