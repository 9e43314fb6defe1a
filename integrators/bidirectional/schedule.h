// Bidirectional path tracing, and light tracing as its part, as a schedule of stages: light walks of a wave first, then
// the eye walks of the same slots.
#pragma once

#include "integrators/bidirectional/wave.h"

namespace ambilux {

/// Splat candidates of one depth: weighted, tested, kept for the end of the wave.
template <class Executor, Features F, class Tracer>
void run_splats(Executor& exec, const BidirectionalStages<F, Tracer>& stages) {
    if (!stages.policy.fuse) exec.run(StageId::mis_weight, stages.weight_splats, stages.memory.splat_candidates);
    exec.trace(StageId::occlude, stages.occlude_splats, stages.memory.weighted_splats);
}

template <class Executor, Features F, class Tracer>
void run_light_walks(Executor& exec, const BidirectionalStages<F, Tracer>& stages) {
    const BidirectionalMemory& m = stages.memory;
    for (uint32_t round = 0; round < stages.policy.light_rounds(); ++round) {
        const auto light = stages.light(round);
        exec.run_slots(StageId::light_generate, light.generate, stages.wave.tiles * kTilePixels);
        if (stages.policy.splat) run_splats(exec, stages);
        exec.set_depth(1);
        exec.extend(StageId::light_extend, light.extend[0], m.rays[0], m.hits[0]);
        repeat_depths(exec, StageId::light_shade, light.shade, StageId::light_extend, light.extend, m,
                      stages.policy.tail_below, [&](bool) {
                          if (stages.policy.splat) {
                              if (!stages.policy.connect_in_shade)
                                  exec.run(StageId::connect_camera, light.connect_camera, m.vertices);
                              run_splats(exec, stages);
                          }
                      });
        exec.set_depth(0);
    }
    exec.settle(m.light_vertices, m.splats);
}

/// Most pairs of an eye vertex.
inline uint32_t longest_pairing(const BidirectionalPolicy& policy) {
    return policy.cache_draws > 0 ? policy.cache_draws : policy.max_depth - 2;
}

/// Candidates of one launch: weighted, tested, added to their paths. `several`: there may be several of a path.
template <class Executor, Features F, class Tracer>
void run_connections(Executor& exec, const BidirectionalStages<F, Tracer>& stages, bool several = false) {
    const BidirectionalMemory& m = stages.memory;
    if (!stages.policy.fuse) exec.run(StageId::mis_weight, stages.weight_connections, m.connect_candidates);
    exec.trace(StageId::occlude, several ? stages.occlude_several : stages.occlude, m.shadows);
    if (!stages.policy.fuse)
        exec.run(StageId::accumulate, several ? stages.accumulate_several : stages.accumulate_shadows,
                 m.shadow_contributions);
}

/// connect_vertices with its shadow rays, where the policy wants that; else false.
template <class Executor, Features F, class Tracer>
bool run_pairs_in_place([[maybe_unused]] Executor& exec, const BidirectionalStages<F, Tracer>& stages,
                        [[maybe_unused]] bool tail) {
    if constexpr (requires { Executor::kTracesPairs; } && F.bsdfs == bit(BsdfType::diffuse)) {
        if (stages.policy.trace_pairs)
            exec.run(StageId::connect_vertices, tail ? stages.connect_and_occlude_several : stages.connect_and_occlude,
                     stages.memory.pairs);
        return stages.policy.trace_pairs;
    }
    return false;
}

template <class Executor, Features F, class Tracer>
void run_eye_walks(Executor& exec, const BidirectionalStages<F, Tracer>& stages) {
    const BidirectionalMemory& m = stages.memory;
    const BidirectionalPolicy& policy = stages.policy;
    start_eye_walks(exec, stages.generate, stages.extend[0], m, stages.wave.tiles * kTilePixels,
                    policy.connect_in_shade && policy.max_depth > 0);
    repeat_depths(exec, StageId::shade, stages.shade, StageId::extend, stages.extend, m, policy.tail_below,
                  [&](bool tail) {
                      if ((policy.count_hits || policy.count_environment) && !policy.fuse) {
                          exec.run(StageId::mis_weight, stages.weight_hits, m.hit_candidates);
                          exec.run(StageId::accumulate, stages.accumulate_hits, m.hit_contributions);
                      }
                      if ((policy.next_event || policy.connect_vertices) && !policy.connect_in_shade)
                          exec.run(StageId::connect, stages.connect, m.vertices);
                      if (policy.next_event) run_connections(exec, stages, tail);
                      if (policy.connect_vertices && !run_pairs_in_place(exec, stages, tail)) {
                          const bool several = tail || !policy.one_pair;
                          exec.run(StageId::connect_vertices, stages.connect_vertices, m.pairs);
                          run_connections(exec, stages, several);
                          if (longest_pairing(policy) > 1)
                              exec.repeat_while(m.rest, [&] {
                                  exec.run(StageId::connect_vertices, stages.connect_rest, m.rest);
                                  run_connections(exec, stages, several);
                                  exec.run(StageId::connect_vertices, stages.connect_vertices, m.pairs);
                                  run_connections(exec, stages, several);
                              });
                      }
                      if (policy.connect_vertices) exec.clear(m.eye_vertices);
                  });
    exec.set_depth(0);
}

/// Variant streaming: one ray per slot in every round, of its eye walk or of a light walk for the eye vertex at which
/// that waits.
template <class Executor, Features F, class Tracer>
void run_streams(Executor& exec, const BidirectionalStages<F, Tracer>& stages) {
    const BidirectionalMemory& m = stages.memory;
    const BidirectionalPolicy& policy = stages.policy;
    exec.run_slots(StageId::generate, stages.stream_begin, policy.stream_slots, 1);
    exec.repeat_while(m.rays[0], [&] {
        exec.trace(StageId::extend, stages.stream_extend, m.rays[0]);
        exec.run(StageId::shade, stages.stream_eye_shade, m.eye_hits);
        if (policy.light_walks) exec.run(StageId::light_shade, stages.stream_light_shade, m.light_hits);
        exec.run(StageId::light_generate, stages.stream_turn, m.turns);
        if ((policy.count_hits || policy.count_environment) && !policy.fuse) {
            exec.run(StageId::mis_weight, stages.weight_hits, m.hit_candidates);
            exec.run(StageId::accumulate, stages.accumulate_hits, m.hit_contributions);
        }
        if (policy.next_event) {
            exec.run(StageId::connect, stages.connect, m.vertices);
            run_connections(exec, stages);
        }
        if (policy.connect_vertices) {
            exec.run(StageId::connect_vertices, stages.stream_connect, m.waiting);
            run_connections(exec, stages);
        }
        if (policy.splat) {
            exec.run(StageId::connect_camera, stages.stream_connect_camera, m.camera_vertices);
            run_splats(exec, stages);
            exec.run(StageId::splat, stages.splat, m.splats);
        }
    });
}

/// One wave, without developing the film. An executor has what run_path_wave asks for (integrators/path/schedule.h),
/// settle(queue, queue) and clear(queue), and may have kTracesPairs: then it runs ConnectAndOcclude.
template <class Executor, Features F, class Tracer>
void run_bidirectional_wave(Executor& exec, const BidirectionalStages<F, Tracer>& stages) {
    if (stages.policy.stream_slots) return run_streams(exec, stages);
    if (stages.policy.megakernel) {
        exec.run_paths(StageId::megakernel, stages.megakernel, stages.wave.tiles * kTilePixels);
        exec.settle(stages.memory.light_vertices, stages.memory.splats);
    } else {
        if (stages.policy.light_walks) run_light_walks(exec, stages);
        run_eye_walks(exec, stages);
    }
    if (stages.policy.splat) exec.run(StageId::splat, stages.splat, stages.memory.splats);
    if (stages.policy.connect_vertices) exec.clear(stages.memory.light_vertices);
}

}  // namespace ambilux
