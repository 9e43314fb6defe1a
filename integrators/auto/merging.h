// Light that passes mirrors or glass before and after a diffuse surface: of all strategies only hits of the emitter
// find it, so seldom that a pilot does not see it and a render does. Light vertices that lie near an eye vertex tell of
// it: a density estimate (Jensen 2001, "Realistic Image Synthesis Using Photon Mapping"), with the density of hits
// beside it as in vertex merging (Georgiev et al. 2012, "Light Transport Simulation with Vertex Connection and
// Merging").
#pragma once

#include <cmath>
#include <vector>

#include "integrators/auto/nearest.h"
#include "integrators/auto/pilot_mis.h"
#include "transport/subpath/connection.h"

namespace ambilux {

template <Features F>
class HitsOnlyLight {
public:
    using End = SubpathEnd<PilotMis>;

    HitsOnlyLight() = default;
    HitsOnlyLight(const PilotMis& mis, const std::vector<const End*>& vertices, uint32_t subpaths)
        : mis_(mis), subpaths_(subpaths) {
        std::vector<Vec3f> places;
        for (const End* v : vertices) {
            if (v->depth < kFewestSegments || !hits_only(v->vertex.sums, 1.0f)) continue;
            ends_.push_back(v);
            places.push_back(v->vertex.point.p);
        }
        nearest_ = NearestPoints(std::move(places));
    }

    /// Whether there is enough of it for an estimate.
    bool any() const { return ends_.size() >= kNearest; }

    /// Whether such light is found at eye vertex `z` instead of by hits: the first that can be connected, behind
    /// vertices that cannot. `depth` is its own, `segments` that of a path through it.
    static bool begins_at(uint32_t depth) { return depth >= 2; }
    static bool holds(uint32_t depth, uint32_t segments) {
        return begins_at(depth) && segments >= depth + kFewestSegments;
    }

    /// add(value, ratio): what light near eye vertex `z` brings to the pixel on average, and how often a hit of the
    /// emitter finds it meanwhile.
    template <class Add>
    void at(const End& z, uint32_t max_depth, Add add) const {
        const auto found = nearest_.nearest<kNearest>(z.vertex.point.p);
        // The farthest one is on the edge of the disk.
        const float paths = kPi * found[0].first * float(subpaths_) * float(kNearest) / float(kNearest - 1);
        if (!(paths > 0.0f)) return;
        for (const auto& [distance2, i] : found) {
            const End& y = *ends_[i];
            const Vec3f w = y.vertex.scattering.wi_world;
            const float cos = fabsf(dot(z.vertex.scattering.ng, w));
            if (y.depth + z.depth > max_depth || !(cos > 1e-3f) ||
                dot(y.vertex.point.ng, z.vertex.point.ng) < kSameSurface)
                continue;
            const BsdfValue f = scatter_evaluate<F>(z.vertex.scattering, w, TransportMode::radiance);
            if (is_zero(f.value) || !hits_only(y.vertex.sums, f.pdf_sa)) continue;
            const Rgb value = y.throughput * f.value * z.throughput * (1.0f / (cos * paths));
            const float ratio = ratio_of(0, y.vertex.sums, f.pdf_sa) / paths;
            if (std::isfinite(ratio) && ratio > 0.0f) add(value, ratio);
        }
    }

private:
    static constexpr size_t kNearest = 8;
    static constexpr uint32_t kFewestSegments = 2;  ///< of the light: with fewer, next event estimation finds it
    static constexpr float kSameSurface = 0.7f;     ///< cosine between normals

    /// Density of the strategies of a set behind light vertex `y`, per density of light subpaths there.
    float ratio_of(uint32_t set, const PilotMis::Sums& y, float pdf_reverse_sa) const {
        return mis_.sets[set].ratio_behind(y.of[set], false, 1.0f, pdf_reverse_sa);
    }
    bool hits_only(const PilotMis::Sums& y, float pdf_reverse_sa) const {
        const float hits = ratio_of(0, y, pdf_reverse_sa);
        return hits > 0.0f && ratio_of(2, y, pdf_reverse_sa) <= hits * 1.0001f;
    }

    PilotMis mis_;
    uint32_t subpaths_ = 0;
    std::vector<const End*> ends_;
    NearestPoints nearest_;
};

}  // namespace ambilux
