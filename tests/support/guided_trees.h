// Trees of path guiding that tests teach.
#pragma once

#include "backends/cpu/host_memory.h"
#include "backends/cpu/whole_executor.h"
#include "integrators/shared/guide/update.h"

namespace ambilux::test {

/// Trees in memory of their own, and the steps that make them.
struct Trees {
    GuidedSettings settings;
    HostMemory memory;
    GuidedState state;
    StageRecord record{};

    explicit Trees(const GuidedSettings& of) : settings(of) {
        if (settings.most_leaves == 0) settings.most_leaves = 8192;
        Layout dry;
        const auto lay_out = [this](Layout& layout) {
            return GuidedState::lay_out(layout, settings.most_leaves, 4, {0, host_primitive_bytes()});
        };
        lay_out(dry);
        memory = HostMemory(dry.bytes());
        Layout placed(dry, memory.data());
        state = lay_out(placed);
        state.init([](auto* to, const auto& from) { std::copy(from.begin(), from.end(), to); });
        state.tree.inverse_side = 1.0f;
        state.progress->unit[0] = 1.0f;
    }
    /// The next step of learning, after `add(leaf)` has recorded what there is in a leaf.
    template <class Add>
    void learn(Add add) {
        for (uint32_t leaf = 0; leaf < state.progress->leaves; ++leaf) add(leaf);
        GuideStep step = {state, settings, &record, state.progress->rounds};
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
