// One render over several devices and ranks.
#pragma once

#include "session/parallel/devices.h"

namespace ambilux {

struct ParallelRequest {
    RenderSettings settings;
    Budget budget;
    std::vector<std::string> devices;  ///< of each process (choose_devices)
    uint32_t range_size = 0;           ///< samples; 0: default_range_size, or what the first device does in a second
    std::string state_path;
    bool resume = false;
    double checkpoint_seconds = 60;
    unsigned block_nodes = 0;  ///< films that a rank adds up for the first one; 0: default_block_nodes
    const volatile bool* interrupt = nullptr;
    std::function<void(const RenderPosition&, const RenderStats&)> on_progress = {};
};

/// What a device did.
struct WorkerShare {
    int rank = 0;
    std::string host, device;
    uint64_t samples = 0, ranges = 0;
    double seconds = 0;  ///< that it was busy
};

struct ParallelResult {
    FilmMoments film;
    RenderStats stats;
    RenderPosition position;
    Ranges ranges;
    std::vector<WorkerShare> workers;
    /// Of the first rank: adding films up, and receiving those of other ranks.
    double merge_seconds = 0, receive_seconds = 0;
    std::string state_path;  ///< of what is left, if it was interrupted; else empty
};

/// Called by the first rank, while the others serve. The image depends on the bounds of ranges alone where the devices
/// are deterministic. Budgets in seconds are wall clock of the whole. The state is saved every checkpoint_seconds and
/// at an interrupt, and removed at the end. Throws Error(usage) if there is a state and no `resume`, Error(bad_input)
/// if it is that of another render.
ParallelResult render_parallel(const Scene& scene, const ParallelRequest& request, Ranks& ranks);

/// Called by the other ranks: renders what the first one orders, until it says that nothing is left.
void serve_parallel(const Scene& scene, const ParallelRequest& request, Ranks& ranks);

}  // namespace ambilux
