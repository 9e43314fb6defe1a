// Trees of path guiding that tests teach.
#pragma once

#include "backends/cpu/host_memory.h"
#include "backends/cpu/whole_executor.h"
#include "integrators/shared/guide/update.h"

namespace ambilux::test {

/// Trees in memory of their own, and the steps that make them.
struct Trees {
    struct Policy {
        GuidedSettings guided;
        GuideTraining training;
    } policy;
    HostMemory memory;
    GuidedState state;
    StageRecord record{};

    explicit Trees(const GuidedSettings& settings) : policy{settings, {0, 4}} {
        if (policy.guided.most_leaves == 0) policy.guided.most_leaves = 8192;
        Layout dry;
        const StateSize size = {0, host_primitive_bytes()};
        GuidedState::lay_out(dry, policy, size);
        memory = HostMemory(dry.bytes());
        Layout placed(dry, memory.data());
        state = GuidedState::lay_out(placed, policy, size);
        state.init(policy, [](auto* to, const auto& from) { std::copy(from.begin(), from.end(), to); });
        state.tree.inverse_side = 1.0f;
        state.progress->unit[0] = 1.0f;
    }
    /// The next step of learning, after `add(leaf)` has recorded what there is in a leaf.
    template <class Add>
    void learn(Add add) {
        for (uint32_t leaf = 0; leaf < state.progress->leaves; ++leaf) add(leaf);
        GuideStep step = {state, policy.guided, &record, state.progress->rounds};
        CpuWholeExecutor exec;
        GuideUpdate::of(step).run(exec);
    }
    /// `units` in the cell where direction `d` lies.
    void put(uint32_t leaf, Vec3f d, int64_t units) const {
        const GuideQuads::Cell c = state.tree.quads.cell(leaf, square_of_direction(d));
        const size_t place = (leaf * GuideQuads::kNodes + c.node) * 4 + c.quadrant;
        state.sums[place] += units;
        ++state.found[place];
    }
    /// Light from one side, some of it from a spot.
    void put_light(uint32_t leaf, uint32_t records) const {
        for (uint32_t i = 0; i < records; ++i) {
            const Vec4f u = random_floats({1, i, leaf, Stream::test}, 0);
            const bool spot = u.w < 0.5f;
            Vec3f d = spot ? square_to_cone({u.x, u.y}, 1e-3f) : square_to_sphere({u.x, u.y});
            if (spot || d.x > 0.2f) put(leaf, d, 1000);
        }
    }
    uint32_t leaves() const { return state.progress->leaves; }
};

}  // namespace ambilux::test
