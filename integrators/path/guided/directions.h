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

/// Survival of a subpath that is expected to bring as much as its pixel, were it no probability: what one brings
/// varies.
constexpr float kSurvivalOfExpected = 2.0f;

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

/// What a subpath knows of the guide. Vertices and rays need other things of it: a lane beside what the path tracer
/// has.
struct GuidedSums : UnidirectionalMis::Sums {
    static constexpr uint32_t kVertexWords = 2;
    uint32_t leaf;  ///< of vertices: the leaf (lower half) and Subpath::roulette_scale
    float word[3];

    struct AtVertex {
        uint32_t leaf;
        float roulette_scale, over_pixel;
        Rgb throughput;
    };
    struct OfRay {
        uint32_t leaf;     ///< where it was scattered
        float before;      ///< luminance of the throughput there
        float whole;       ///< and after it, without roulette
        float over_pixel;  ///< 1 over what the pixel is expected to be; 0: not known
    };
    AMBILUX_HD static GuidedSums of(const AtVertex& v) {
        return {{v.over_pixel},
                v.leaf | (float_bits(v.roulette_scale) & 0xffff0000u),
                {v.throughput.x, v.throughput.y, v.throughput.z}};
    }
    AMBILUX_HD static GuidedSums of(const OfRay& r, float pdf_sa) {
        return {{pdf_sa}, r.leaf, {r.before, r.whole, r.over_pixel}};
    }
    AMBILUX_HD uint32_t leaf_of_vertex() const { return leaf & 0xffffu; }
    AMBILUX_HD AtVertex at_vertex() const {
        return {leaf_of_vertex(), bits_float(leaf & 0xffff0000u), pdf_sa, {word[0], word[1], word[2]}};
    }
    AMBILUX_HD OfRay of_ray() const { return {leaf, word[0], word[1], word[2]}; }
};

/// A share of directions comes from the BSDF, wherever anything can scatter: no density is 0 where the integrand is
/// not. All densities are those of the mixture but for deltas, which the BSDF alone finds.
struct GuidedDirections {
    GuideTree tree = {};
    bool roulette = true;  ///< by what subpaths are expected to bring

    template <Features F, class Mis>
    AMBILUX_HD bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const {
        const GuidedSums::AtVertex at = v.sums.at_vertex();
        const GuideLeaf leaf = tree.leaves[at.leaf];
        const bool narrow = is_narrow<F>(v.scattering.bsdf);
        if (!direction<F>(v, at.leaf, narrow ? 1.0f : leaf.bsdf_share, u, mode, s)) return false;
        const Rgb whole = at.throughput * s.weight;
        const bool delta = s.flags & kScatterDelta;
        // Nothing was recorded of what follows a narrow lobe: no reason to end there.
        if (roulette)
            s.eta = scale_for_roulette(
                max_component(whole),
                narrow || delta ? 1.0f : luminance(at.throughput) * leaf.reflected * at.over_pixel, at.roulette_scale);
        if (!delta) s.pdf_reverse_sa = luminance(whole);  // nobody asks for that density: sums_after_scatter gets it
        return true;
    }
    template <Features F, class Mis>
    AMBILUX_HD BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) const {
        BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        if (is_zero(f.value) || is_narrow<F>(v.scattering.bsdf)) return f;
        const uint32_t leaf = v.sums.leaf_of_vertex();
        const float share = tree.leaves[leaf].bsdf_share;
        if (share < 1.0f) f.pdf_sa = share * f.pdf_sa + (1.0f - share) * tree.pdf_sa(leaf, wo);
        return f;
    }

private:
    /// From the BSDF with probability `share`, else from the quadtree of `leaf`, in which either looks once.
    template <Features F, class Mis>
    AMBILUX_HD bool direction(const Vertex<Mis>& v, uint32_t leaf, float share, Vec3f u, TransportMode mode,
                              BsdfSample& s) const {
        const bool guided = !(u.x < share);
        if (!guided && !BsdfDirections::sample<F>(v, {u.x / share, u.y, u.z}, mode, s)) return false;
        if (share == 1.0f) return true;
        if (!guided && s.flags & kScatterDelta) return weigh(s, share * s.pdf_sa);
        const Vec2f place = guided ? Vec2f{u.y, u.z} : square_of_direction(s.wo);
        const GuideQuads::Cell cell = tree.quads.descend(leaf, place, guided);
        const float guide_sa = (1.0f - share) * kInv4Pi * cell.density;
        if (!guided) return weigh(s, share * s.pdf_sa + guide_sa);
        const Vec3f wo = square_to_sphere(cell.at);
        if (!may_scatter(v.scattering, wo)) return false;
        BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        if (is_zero(f.value)) return false;
        f.pdf_sa = share * f.pdf_sa + guide_sa;
        return smooth_sample(wo, f, 1.0f, 0, s);
    }
    AMBILUX_HD static bool weigh(BsdfSample& s, float pdf) {
        s.weight = s.weight * (s.pdf_sa / pdf);
        s.pdf_sa = pdf;
        return true;
    }
    /// What BsdfSample::eta has to be so that roulette (survives) sees what the subpath is expected to bring, of what
    /// its pixel is expected to be; if that is not known (0), its throughput, whose largest component is `most`. Any
    /// value more than 0 is unbiased.
    AMBILUX_HD static float scale_for_roulette(float most, float expected, float scale) {
        constexpr float kAbove = 1.008f;  // what is sure stays so when the scale is rounded
        if (!(expected > 0.0f && most > 1e-30f)) return 1.0f / scale;
        return kAbove * sqrtf(clamp(kSurvivalOfExpected * expected, kLeastSurvival, 1.0f) / most) / scale;
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
        return Sums::of({tree.leaf(point.p), path.roulette_scale, sums.of_ray().over_pixel, path.throughput});
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& s, bool, bool, float pdf_forward_sa, float whole, float) const {
        const Sums::AtVertex v = s.at_vertex();
        return Sums::of({v.leaf, luminance(v.throughput), whole, v.over_pixel}, pdf_forward_sa);
    }
};

}  // namespace ambilux
