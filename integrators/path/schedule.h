// The path tracer as a schedule of stages: what runs in which order on which queue, for any backend.
#pragma once

#include "integrators/path/path_wave.h"

namespace ambilux {

/// One wave. An executor has run(id, stage, n): stage(0) ... stage(n-1); run(id, stage, queue): over the queue's size where the queue lives, then empties it;
/// trace(id, stage, queue): the same for stages that trace rays; next_depth(); and repeat_while(queue, body): body until the queue is found empty.
template <class Executor, Features F, class Tracer>
void run_path_wave(Executor& exec, const PathStages<F, Tracer>& stages) {
    const PathMemory& m = stages.memory;
    exec.run(StageId::generate, stages.generate, stages.wave.slot_count());
    exec.repeat_while(m.rays, [&] {
        exec.trace(StageId::extend, stages.extend, m.rays);
        exec.run(StageId::shade, stages.shade, m.hits);
        if (stages.policy.count_hits) {
            exec.run(StageId::mis_weight, stages.weight_hits, m.hit_candidates);
            exec.run(StageId::accumulate, stages.accumulate_hits, m.hit_contributions);
        }
        if (stages.policy.connect) {
            exec.run(StageId::connect, stages.connect, m.connections);
            exec.run(StageId::mis_weight, stages.weight_connections, m.connect_candidates);
            exec.trace(StageId::occlude, stages.occlude, m.shadows);
            exec.run(StageId::accumulate, stages.accumulate_shadows, m.shadow_contributions);
        }
        exec.next_depth();
    });
    exec.run(StageId::develop, stages.develop, stages.wave.tiles * kTilePixels);
}

}  // namespace ambilux
