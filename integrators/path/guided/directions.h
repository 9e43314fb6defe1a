// Directions of the BSDF and of what was learned, mixed.
#pragma once

#include "integrators/path/guided/tree.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/bsdf_directions.h"

namespace ambilux {

/// Roughness of microfacets below which the BSDF alone samples: what such a lobe reflects is narrower than cells are.
constexpr float kLeastGuidedAlpha = 0.05f;

template <Features F>
AMBILUX_HD bool is_narrow(const Bsdf& b) {
    return visit_bsdf<F>(b.type, false, [&](auto model) {
        using Model = typename decltype(model)::type;
        if constexpr (std::is_same_v<Model, RoughConductor> || std::is_same_v<Model, RoughDielectric>) {
            const Resolved<Model> r = b.as<Model>();
            return max(r.alpha_u, r.alpha_v) < kLeastGuidedAlpha;
        } else {
            return !Model::smooth;
        }
    });
}

/// A share of directions comes from the BSDF, wherever anything can scatter: no density is 0 where the integrand is
/// not. All densities are those of the mixture but for deltas, which the BSDF alone finds.
struct GuidedDirections {
    GuideTree tree = {};

    template <Features F, class Mis>
    AMBILUX_HD bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const {
        const uint32_t leaf = tree.leaf(v.point.p);
        const float share = bsdf_share<F>(v, leaf);
        if (!(u.x < share)) return sample_guide<F>(v, leaf, share, {u.y, u.z}, mode, s);
        if (!BsdfDirections::sample<F>(v, {u.x / share, u.y, u.z}, mode, s)) return false;
        const float pdf = s.flags & kScatterDelta ? share * s.pdf_sa : mixed(leaf, share, s.pdf_sa, s.wo);
        s.weight = s.weight * (s.pdf_sa / pdf);
        s.eta *= roulette_scale(s.pdf_sa, pdf);
        s.pdf_sa = pdf;
        return true;
    }
    template <Features F, class Mis>
    AMBILUX_HD BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) const {
        BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        if (is_zero(f.value)) return f;
        const uint32_t leaf = tree.leaf(v.point.p);
        f.pdf_sa = mixed(leaf, bsdf_share<F>(v, leaf), f.pdf_sa, wo);
        return f;
    }

private:
    template <Features F, class Mis>
    AMBILUX_HD float bsdf_share(const Vertex<Mis>& v, uint32_t leaf) const {
        return is_narrow<F>(v.scattering.bsdf) ? 1.0f : tree.leaves[leaf].bsdf_share;
    }
    AMBILUX_HD float mixed(uint32_t leaf, float share, float bsdf_pdf_sa, Vec3f wo) const {
        if (share == 1.0f) return bsdf_pdf_sa;
        return share * bsdf_pdf_sa + (1.0f - share) * tree.pdf_sa(leaf, wo);
    }
    /// Where the guide sends more paths than the BSDF would, each weighs less, and roulette by weight would take them
    /// away again: there it sees what the throughput would be had the BSDF sampled the direction. Where fewer go it
    /// sees the weight, lest it add to what is large already.
    AMBILUX_HD static float roulette_scale(float bsdf_pdf_sa, float pdf_sa) {
        return pdf_sa > bsdf_pdf_sa ? sqrtf(pdf_sa / max(bsdf_pdf_sa, 0x1p-40f * pdf_sa)) : 1.0f;
    }
    template <Features F, class Mis>
    AMBILUX_HD bool sample_guide(const Vertex<Mis>& v, uint32_t leaf, float share, Vec2f u, TransportMode mode,
                                 BsdfSample& s) const {
        const Vec3f wo = tree.sample(leaf, u);
        if (!may_scatter(v.scattering, wo)) return false;
        BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        if (is_zero(f.value)) return false;
        const float bsdf_pdf_sa = f.pdf_sa;
        f.pdf_sa = mixed(leaf, share, f.pdf_sa, wo);
        return smooth_sample(wo, f, roulette_scale(bsdf_pdf_sa, f.pdf_sa), 0, s);
    }
};

/// Weights of the path tracer, with the densities of the mixture.
struct GuidedMis : UnidirectionalMis {
    using Directions = GuidedDirections;

    struct Sums : UnidirectionalMis::Sums {
        float before;  ///< luminance of the throughput before it was scattered into the ray
    };

    template <Features>
    AMBILUX_HD void start_eye(const SceneView&, Vec3f, Sums& sums, Start&) const {
        sums = {{0.0f}, 1.0f};
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView&, const Lights&, Side, const Path& path, const Sums& sums,
                            const SurfacePoint&) const {
        return {sums, luminance(path.throughput)};
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& s, bool, bool, float pdf_forward_sa, float, float) const {
        return {{pdf_forward_sa}, s.before};
    }
};

}  // namespace ambilux
