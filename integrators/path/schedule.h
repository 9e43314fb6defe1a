// The path tracer as a schedule of stages: what runs in which order on which queue, for any backend.
#pragma once

#include "integrators/path/path_wave.h"

namespace ambilux {

/// One wave. An executor has
/// - run_slots(id, stage, n): stage over n slots for each sample of the wave; with a last argument 1, over n slots
/// once;
/// - run(id, stage, queue): over the queue's size where the queue lives, then empties it;
/// - trace(id, stage, queue): the same for rays in no order;
/// - extend(id, stage, rays, hits): rays become hits where they lie; extend_coherent for neighbouring rays that stay
/// together;
/// - set_depth(d), next_depth(n), and repeat_while(queue, body): body until the queue is found empty.
template <class Executor, Features F, class Tracer>
void run_path_wave(Executor& exec, const PathStages<F, Tracer>& stages) {
    const PathMemory& m = stages.memory;
    const uint32_t slots = stages.wave.tiles * kTilePixels;
    start_eye_walks(exec, stages.generate, stages.extend[0], m, slots,
                    stages.policy.connect_in_shade && stages.policy.max_depth > 0);
    repeat_depths(exec, StageId::shade, stages.shade, StageId::extend, stages.extend, m, stages.policy.tail_below,
                  [&](bool tail) {
                      if (stages.policy.count_hits && !stages.policy.fuse) {
                          exec.run(StageId::mis_weight, stages.weight_hits, m.hit_candidates);
                          exec.run(StageId::accumulate, stages.accumulate_hits, m.hit_contributions);
                      }
                      if (stages.policy.connect) {
                          if (!stages.policy.connect_in_shade)
                              exec.run(StageId::connect, stages.connect, m.connections);
                          if (!stages.policy.fuse)
                              exec.run(StageId::mis_weight, stages.weight_connections, m.connect_candidates);
                          exec.trace(StageId::occlude, tail ? stages.occlude_tail : stages.occlude, m.shadows);
                          if (!stages.policy.fuse)
                              exec.run(StageId::accumulate, stages.accumulate_shadows, m.shadow_contributions);
                      }
                  });
    exec.set_depth(0);
    exec.run_slots(StageId::develop, stages.develop, slots, 1);
}

}  // namespace ambilux
