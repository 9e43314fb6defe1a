// The megakernel's threads on a device. A lane is in one of a few phases: its ray is under way, its ray has an answer,
// it connects, or it begins a subpath. Rays of all lanes go through one persistent traversal (trace_kernels.cuh),
// whatever they are for; a lane whose ray has ended does not wait for those of the others (Aila and Laine 2009), and
// what is no traversal runs when so many lanes want the same of it that the warp pays for it (Laine et al. 2013,
// section 2, on what divergence costs a megakernel; path regeneration by Novak et al. 2010).
#pragma once

#include "backends/cuda/trace_kernels.cuh"

namespace ambilux::detail {

/// Counts of lanes.
struct RegenerationTuning {
    uint32_t resting = 24;  ///< rays are left for something else when so many lanes have none under way
    uint32_t together = 4;  ///< that want the same before it is done, as long as others have rays under way;
    uint32_t waiting = 8;   ///< or that wait at all
};

/// Does the slots `slot`, `slot + stride` ... below `end`. All threads of a block call it.
template <class Machine>
__device__ void run_regenerating(const Machine& machine, uint32_t slot, uint32_t end, uint32_t stride,
                                 RegenerationTuning tuning = {}) {
    constexpr Features F = Machine::kFeatures;
    enum Phase : uint32_t { kRests, kAnswer, kConnect, kBegin, kAsk };
    using Cursor = Walk<F, CwbvhTracer, false>;
    const WholeWarp warp;
    typename Machine::State s{};
    typename Machine::Counts counts{};
    Cursor walk;
    typename Cursor::Entry stack[Cursor::kEntries];
    Ray ray = {};
    CwbvhRay box_ray = {};
    RayShear shear = {};
    float t = 0.0f;
    uint32_t prim = kNone;
    bool asked = false;  // a ray is under way, or has an answer

    const auto under_way = [&] { return walk.has_primitives() || walk.has_nodes(); };
    const auto phase_of = [&] {
        if (under_way()) return kRests;
        if (asked) return kAnswer;
        if (!s.active) return slot < end ? kBegin : kRests;
        const auto want = machine.wants(s);
        return want == Machine::Want::ray ? kAsk : want == Machine::Want::connection ? kConnect : kBegin;
    };
    const auto ask = [&] {
        asked = true;
        prim = kNone;
        if (!machine.next_ray(s, ray, counts)) {
            if (s.testing) prim = 0;
        } else if (is_traceable(ray)) {
            t = ray.tmax;
            box_ray = make_cwbvh_ray(ray.o, ray.d);
            shear = make_ray_shear(ray.d);
            walk.begin(machine.tracer, stack);
        }
    };
    const auto take_answer = [&] {
        asked = false;
        machine.answer(s, prim != kNone, Cursor::kept(stack, t, prim));
    };

    for (;;) {
        const uint32_t resting = 32u - warp.count(under_way());
        if (resting >= tuning.resting || resting == 32u) {
            Phase phase = phase_of();
            // What a shadow ray brings is added at once.
            if (phase == kAnswer && s.testing) {
                take_answer();
                phase = phase_of();
            }
            if (phase == kAsk) {
                ask();
                phase = phase_of();
            }
            const uint32_t answers = warp.count(phase == kAnswer), connections = warp.count(phase == kConnect),
                           begins = warp.count(phase == kBegin), rays = warp.count(under_way());
            const uint32_t most = max(answers, max(connections, begins));
            if (most == 0 && rays == 0) break;
            if (most >= tuning.together || answers + connections + begins >= tuning.waiting || rays == 0) {
                const Phase next = answers == most ? kAnswer : connections == most ? kConnect : kBegin;
                if (phase == next) {
                    if (phase == kAnswer) {
                        take_answer();
                    } else if (phase == kConnect) {
                        machine.connect(s);
                    } else if (s.active) {
                        machine.turn(s);
                    } else {
                        machine.begin(s, slot);
                        slot += stride;
                    }
                }
                warp.meet();
                continue;
            }
        }
        walk_together<F>(machine.scene, machine.tracer, kIncoherentTuning, s.testing, walk, stack, ray, box_ray, shear,
                         t, prim);
    }
    machine.add(counts);
}

}  // namespace ambilux::detail
