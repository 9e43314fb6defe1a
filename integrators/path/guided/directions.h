// Directions of the BSDF and of what was learned, mixed.
#pragma once

#include "integrators/path/guided/tree.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/bsdf_directions.h"

namespace ambilux {

/// Roughness of microfacets below which the BSDF alone samples: what such a lobe reflects is narrower than cells are.
constexpr float kLeastGuidedAlpha = 0.05f;

/// Lowest probability of surviving roulette: what was learned may be wrong, and survivors weigh more by its inverse.
constexpr float kLeastSurvival = 0.1f;

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

/// What a vertex of an eye subpath knows of the guide.
struct GuidedSums : UnidirectionalMis::Sums {
    static constexpr uint32_t kVertexWords = 2;
    uint32_t leaf;     ///< of vertices: where they lie
    float before;      ///< luminance of the throughput before it was scattered into the ray
    float over_pixel;  ///< 1 over what the pixel is expected to be; 0: not known
    float over_scale;  ///< of vertices: 1 over Subpath::roulette_scale
};

/// A share of directions comes from the BSDF, wherever anything can scatter: no density is 0 where the integrand is
/// not. All densities are those of the mixture but for deltas, which the BSDF alone finds.
struct GuidedDirections {
    GuideTree tree = {};
    bool roulette = true;  ///< by what subpaths are expected to bring

    template <Features F, class Mis>
    AMBILUX_HD bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const {
        const GuideLeaf& leaf = tree.leaves[v.sums.leaf];
        const float share = bsdf_share<F>(v, leaf);
        if (u.x < share) {
            if (!BsdfDirections::sample<F>(v, {u.x / share, u.y, u.z}, mode, s)) return false;
            const float pdf = s.flags & kScatterDelta ? share * s.pdf_sa : mixed(v.sums.leaf, share, s.pdf_sa, s.wo);
            s.weight = s.weight * (s.pdf_sa / pdf);
            s.pdf_sa = pdf;
        } else {
            float guide_sa;
            const Vec3f wo = tree.sample(v.sums.leaf, {u.y, u.z}, guide_sa);
            if (!may_scatter(v.scattering, wo)) return false;
            BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
            if (is_zero(f.value)) return false;
            f.pdf_sa = share * f.pdf_sa + (1.0f - share) * guide_sa;
            if (!smooth_sample(wo, f, 1.0f, 0, s)) return false;
        }
        if (roulette) {
            // Nothing was recorded of what follows a narrow lobe: no reason to end there.
            const bool narrow = s.flags & kScatterDelta || is_narrow<F>(v.scattering.bsdf);
            s.eta = scale_for_roulette(v.sums, luminance(s.weight),
                                       narrow ? 1.0f : v.sums.before * leaf.reflected * v.sums.over_pixel);
        }
        return true;
    }
    template <Features F, class Mis>
    AMBILUX_HD BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) const {
        BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        if (is_zero(f.value)) return f;
        f.pdf_sa = mixed(v.sums.leaf, bsdf_share<F>(v, tree.leaves[v.sums.leaf]), f.pdf_sa, wo);
        return f;
    }

private:
    template <Features F, class Mis>
    AMBILUX_HD float bsdf_share(const Vertex<Mis>& v, const GuideLeaf& leaf) const {
        return is_narrow<F>(v.scattering.bsdf) ? 1.0f : leaf.bsdf_share;
    }
    AMBILUX_HD float mixed(uint32_t leaf, float share, float bsdf_pdf_sa, Vec3f wo) const {
        if (share == 1.0f) return bsdf_pdf_sa;
        return share * bsdf_pdf_sa + (1.0f - share) * tree.pdf_sa(leaf, wo);
    }
    /// What BsdfSample::eta has to be so that roulette (survives) sees what the subpath is expected to bring, of what
    /// its pixel is expected to be; if that is not known (0), its throughput. Any value more than 0 is unbiased.
    AMBILUX_HD static float scale_for_roulette(const GuidedSums& sums, float weight, float expected) {
        const float after = sums.before * weight;
        if (!(expected > 0.0f && after > 1e-30f)) return sums.over_scale;
        return sqrtf(clamp(expected, kLeastSurvival, 1.0f) / after) * sums.over_scale;
    }
};

/// Weights of the path tracer, with the densities of the mixture.
struct GuidedMis : UnidirectionalMis {
    using Directions = GuidedDirections;
    using Sums = GuidedSums;

    GuideTree tree = {};

    template <Features>
    AMBILUX_HD void start_eye(const SceneView&, Vec3f, Sums& sums, Start&) const {
        sums = {};
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView&, const Lights&, Side, const Path& path, const Sums& sums,
                            const SurfacePoint& point) const {
        return {{}, tree.leaf(point.p), luminance(path.throughput), sums.over_pixel, 1.0f / path.roulette_scale};
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& s, bool, bool, float pdf_forward_sa, float, float) const {
        return {{pdf_forward_sa}, s.leaf, s.before, s.over_pixel, 0.0f};
    }
};

}  // namespace ambilux
