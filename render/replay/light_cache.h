// Light vertices in the order in which a wave on the CPU keeps them.
#pragma once

#include "integrators/integrator.h"
#include "render/replay/light.h"
#include "stages/light_vertex_search.h"

namespace ambilux {

/// Vertices in a queue, as connections look for them, and the light subpath that each belongs to.
template <class Mis>
class ReplayVertices {
public:
    /// `link`: each vertex follows the one before it.
    ReplayVertices(std::vector<ConnectionVertex<Mis>> vertices, std::vector<uint32_t> owners, bool link)
        : lanes_(vertices.size() * LaneArray<ConnectionVertex<Mis>>::kLanes), owners_(std::move(owners)) {
        queue_.items = {lanes_.data(), uint32_t(vertices.size())};
        counter_.count = counter_.capacity = uint32_t(vertices.size());
        for (uint32_t i = 0; i < vertices.size(); ++i) {
            if (link) vertices[i].front.link = i == 0 ? kNone : i - 1;
            queue_.store(i, vertices[i]);
        }
        last_ = vertices.empty() ? kNone : uint32_t(vertices.size()) - 1;
        queue_.counter = &counter_;
    }
    ReplayVertices(const ReplayVertices&) = delete;
    ReplayVertices& operator=(const ReplayVertices&) = delete;

    uint32_t size() const { return counter_.count; }
    void name_owner(uint32_t place, ReplayCandidate& c) const { c.light_subpath = owners_[place]; }
    /// `draws`: of an eye vertex; 0: those of the subpath one after the other, from the last on.
    LightVertexSource<Mis> source(uint32_t draws) const { return {queue_, &last_, draws, false}; }

private:
    std::vector<Lane> lanes_;
    std::vector<uint32_t> owners_;
    mutable QueueCounter counter_{};
    LightVertices<Mis> queue_;
    uint32_t last_ = kNone;
};

/// The light subpaths of a sample of the tiles from `first_tile` on, in the order in which a wave runs them: round
/// after round, depth after depth, slot after slot. `wave`: its shape; `request`: what they have in common.
template <class Mis>
std::unique_ptr<ReplayVertices<Mis>> replay_cache(const ReplayContext<Mis>& ctx, Wave wave, uint32_t first_tile,
                                                  uint32_t per_tile, uint32_t rounds, ReplayLightRequest<Mis> request) {
    WaveState state{};
    state.first_tile = first_tile;
    state.first_sample = request.sample;
    state.samples = 1;
    wave.state = &state;
    request.details = request.splats = false;
    std::vector<ConnectionVertex<Mis>> all;
    std::vector<uint32_t> owners;
    for (uint32_t round = 0; round < rounds; ++round) {
        std::vector<std::vector<std::pair<ConnectionVertex<Mis>, uint32_t>>> by_depth;
        for (uint32_t slot = 0; slot < wave.tiles * kTilePixels; ++slot) {
            const PathSlot p = wave.locate(slot);
            if (!p.active || round >= light_subpaths_of(slot, per_tile)) continue;
            request.number = round * wave.width * wave.height + p.pixel;
            for (const ConnectionVertex<Mis>& v : replay_light(ctx, request).vertices) {
                by_depth.resize(std::max<size_t>(by_depth.size(), v.bits().depth() + 1));
                by_depth[v.bits().depth()].emplace_back(v, request.number);
            }
        }
        for (const auto& depth : by_depth)
            for (const auto& [vertex, number] : depth) {
                all.push_back(vertex);
                owners.push_back(number);
            }
    }
    return std::make_unique<ReplayVertices<Mis>>(std::move(all), std::move(owners), false);
}

}  // namespace ambilux
