// Directions of the BSDF and of what was learned, mixed.
#pragma once

#include "integrators/shared/guide/state.h"
#include "transport/mis/bidirectional.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/bsdf_directions.h"
#include "transport/subpath/roulette.h"

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

/// luminance() with the same rounding in every copy of the code: a kernel has several for what a warp holds, in
/// which a compiler may join other pairs of products and sums, and bits of a render must not depend on that.
AMBILUX_HD float recorded_luminance(Rgb c) { return dot(c, {0.212671f, 0.715160f, 0.072169f}); }

/// What a subpath knows of the guide, beside the sums of a model of weights. Vertices of bidirectional methods keep all
/// that is theirs, in a lane that they need anyway.
template <class Base, bool kBidirectional>
struct GuidedSums : Base {
    static constexpr uint32_t kVertexWords = sizeof(Base) / sizeof(float) + 1;

    uint32_t leaf;     ///< of a vertex; of a ray: where it was scattered
    float before;      ///< of an eye ray: luminance of the throughput where it was scattered
    float whole;       ///< of an eye ray: luminance of the throughput after it was scattered, without roulette
    float over_pixel;  ///< 1 over what the pixel of an eye subpath is expected to be; 0: not known
};
template <class Base>
struct GuidedSums<Base, true> : Base {
    static constexpr uint32_t kVertexWords = sizeof(Base) / sizeof(float) + 4;

    uint32_t leaf;
    union {
        float share;  ///< of a vertex: of directions that the BSDF samples there
        float before;
    };
    union {
        float back_share;  ///< of a vertex: the same of subpaths of the other side
        float whole;
    };
    float back_sa;  ///< of a vertex: density that was learned of the way back, by subpaths of the other side
    float over_pixel;
};

/// Density of the direction of a scattered ray, unless that was a delta.
AMBILUX_HD float pdf_of_ray(const UnidirectionalMis::Sums& ray) { return ray.pdf_sa; }
AMBILUX_HD float pdf_of_ray(const MisSums& ray) { return 1.0f / ray.dvcm; }

/// What subpaths follow: those from the camera where light comes from, those from emitters where the camera's
/// importance does. A tree of a side that is not guided has no grid.
template <bool kBidirectional>
struct GuideTrees {
    GuideTree eye;

    AMBILUX_HD const GuideTree& of(Side) const { return eye; }
};
template <>
struct GuideTrees<true> {
    GuideTree eye, light;

    AMBILUX_HD const GuideTree& of(Side side) const { return side == Side::eye ? eye : light; }
    /// Of subpaths that come the other way.
    AMBILUX_HD const GuideTree& against(Side side) const { return side == Side::eye ? light : eye; }
};

/// A share of directions comes from the BSDF, wherever anything can scatter, so no density is 0 where the integrand is
/// not. All densities are those of the mixture but for deltas, which the BSDF alone finds. Subpaths of either side have
/// a mixture of their own, and know that of the other as the density of the way back.
template <bool kBidirectional>
struct GuidedDirections {
    GuideTrees<kBidirectional> trees = {};
    bool roulette = true;  ///< by what subpaths are expected to bring

    template <Features F, class Mis>
    AMBILUX_HD bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const {
        if (!mixed<F>(v, bsdf_share<F>(v), u, mode, s)) return false;
        if constexpr (kBidirectional)
            if (!(s.flags & kScatterDelta)) s.pdf_reverse_sa = way_back<F>(v, s.pdf_reverse_sa);
        return true;
    }
    template <Features F, class Mis>
    AMBILUX_HD BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) const {
        const BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        return is_zero(f.value) ? f : densities<F>(v, wo, mode, f);
    }
    /// `f`, of the BSDF, with the densities of either side.
    template <Features F, class Mis>
    AMBILUX_HD BsdfValue densities(const Vertex<Mis>& v, Vec3f wo, TransportMode mode, BsdfValue f) const {
        f.pdf_sa = mixture<F>(v, wo, mode, f.pdf_sa);
        if constexpr (kBidirectional) f.pdf_reverse_sa = way_back<F>(v, f.pdf_reverse_sa);
        return f;
    }
    /// A subpath finds a delta with the share that its side has of the BSDF of the probability there.
    template <Features F, class Mis>
    AMBILUX_HD void complete(Side side, const Vertex<Mis>& v, Rgb before, Subpath<Mis>& path) const {
        const bool narrow = is_narrow<F>(v.scattering.bsdf);
        if constexpr (kBidirectional) {
            if (path.delta && !narrow) path.sums.dvc *= v.sums.back_share / v.sums.share;
            if (side == Side::light) {
                if (roulette && !path.delta && !narrow && v.sums.share < 1.0f) spare(v, path);
                return;
            }
        }
        path.sums.before = recorded_luminance(before);
        path.sums.whole = recorded_luminance(path.throughput);
        // Nothing was recorded of what follows a narrow lobe: no reason to end there.
        if (roulette && learns())
            path.roulette_scale = scale_for_roulette(
                max_component(path.throughput),
                narrow || path.delta
                    ? 1.0f
                    : path.sums.before * trees.eye.leaves[v.sums.leaf].reflected * path.sums.over_pixel);
    }

private:
    /// Eye subpaths do.
    AMBILUX_HD bool learns() const {
        if constexpr (kBidirectional)
            return trees.eye.grid;
        else
            return true;
    }
    /// Of directions at `v`.
    template <Features F, class Mis>
    AMBILUX_HD float bsdf_share(const Vertex<Mis>& v) const {
        if (is_narrow<F>(v.scattering.bsdf)) return 1.0f;
        if constexpr (kBidirectional)
            return v.sums.share;
        else
            return trees.eye.leaves[v.sums.leaf].bsdf_share;
    }
    AMBILUX_HD const GuideTree& tree(TransportMode mode) const {
        return trees.of(mode == TransportMode::radiance ? Side::eye : Side::light);
    }
    /// Density with which a subpath leaves `v` for `d`, where the BSDF has `pdf_sa`.
    template <Features F, class Mis>
    AMBILUX_HD float mixture(const Vertex<Mis>& v, Vec3f d, TransportMode mode, float pdf_sa) const {
        const float share = bsdf_share<F>(v);
        return share < 1.0f ? fmaf(share, pdf_sa, (1.0f - share) * tree(mode).pdf_sa(v.sums.leaf, d)) : pdf_sa;
    }
    /// The same of one of the other side that leaves it for where this one came from.
    template <Features F, class Mis>
    AMBILUX_HD static float way_back(const Vertex<Mis>& v, float pdf_sa) {
        const float share = v.sums.back_share;
        return share < 1.0f && !is_narrow<F>(v.scattering.bsdf) ? fmaf(share, pdf_sa, (1.0f - share) * v.sums.back_sa)
                                                                : pdf_sa;
    }
    /// From the BSDF with probability `share`, else from the quadtree of the leaf, in which either looks once.
    template <Features F, class Mis>
    AMBILUX_HD bool mixed(const Vertex<Mis>& v, float share, Vec3f u, TransportMode mode, BsdfSample& s) const {
        const bool guided = !(u.x < share);
        if (!guided && !BsdfDirections::sample<F>(v, {u.x / share, u.y, u.z}, mode, s)) return false;
        if (share == 1.0f) return true;
        if (!guided && s.flags & kScatterDelta) return weigh(s, share * s.pdf_sa);
        const Vec2f place = guided ? Vec2f{u.y, u.z} : square_of_direction(s.wo);
        const GuideQuads::Cell cell = tree(mode).quads.descend(v.sums.leaf, place, guided);
        const float guide_sa = (1.0f - share) * kInv4Pi * cell.density;
        if (!guided) return weigh(s, fmaf(share, s.pdf_sa, guide_sa));
        const Vec3f wo = square_to_sphere(cell.at);
        if (!may_scatter(v.scattering, wo)) return false;
        BsdfValue f = BsdfDirections::evaluate<F>(v, wo, mode);
        if (is_zero(f.value)) return false;
        f.pdf_sa = fmaf(share, f.pdf_sa, guide_sa);
        return smooth_sample(wo, f, 1.0f, 0, s);
    }
    AMBILUX_HD static bool weigh(BsdfSample& s, float pdf) {
        s.weight = s.weight * (s.pdf_sa / pdf);
        s.pdf_sa = pdf;
        return true;
    }
    /// Roulette of a light subpath sees the throughput that the BSDF alone would have left it, up to where it is sure
    /// to survive: f cos / p is least where the guide is strongest.
    template <class Mis>
    AMBILUX_HD void spare(const Vertex<Mis>& v, Subpath<Mis>& path) const {
        constexpr float kAbove = 1.008f, kMostGained = 1e3f;
        const float share = v.sums.share, pdf_sa = pdf_of_ray(path.sums),
                    most = max_component(path.throughput) * sqr(path.roulette_scale);
        const float guide_sa = (1.0f - share) * trees.light.pdf_sa(v.sums.leaf, path.direction),
                    bsdf_sa = (pdf_sa - guide_sa) / share;
        const float gain = min(pdf_sa / max(bsdf_sa, pdf_sa / kMostGained), 1.0f / most);
        if (gain > 1.0f) path.roulette_scale = rounded_scale(kAbove * path.roulette_scale * sqrtf(gain));
    }
    /// What Subpath::roulette_scale has to be so that roulette (survives) sees what the subpath is expected to bring,
    /// of what its pixel is expected to be; if that is not known (0), its throughput, whose largest component is
    /// `most`. Any value more than 0 is unbiased.
    AMBILUX_HD static float scale_for_roulette(float most, float expected) {
        constexpr float kAbove = 1.008f;  // what is sure stays so when the scale is rounded
        if (!(expected > 0.0f && most > 1e-30f)) return 1.0f;
        return rounded_scale(kAbove * sqrtf(clamp(kSurvivalOfExpected * expected, kLeastSurvival, 1.0f) / most));
    }
};

/// The trees that subpaths follow.
template <bool kBidirectional>
GuideTrees<kBidirectional> followed(const GuidedStates& s, const GuidedSettings& settings) {
    GuideTrees<kBidirectional> trees = {};
    trees.eye = s.eye.tree;
    if constexpr (kBidirectional) {
        trees.light = s.light.tree;
        if (!settings.guides(Side::eye)) trees.eye.grid = nullptr;
    }
    return trees;
}

/// The weights of `Base`, with the densities of the mixture.
template <class Base>
struct GuidedMis : Base {
    using Directions = GuidedDirections<Base::kBidirectional>;
    using Sums = GuidedSums<typename Base::Sums, Base::kBidirectional>;

    GuideTrees<Base::kBidirectional> trees = {};

    template <Features F>
    AMBILUX_HD void start_eye(const SceneView& scene, Vec3f d, Sums& sums, typename Base::Start& start) const {
        sums = {};
        Base::template start_eye<F>(scene, d, sums, start);
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, const Sums& sums,
                            const SurfacePoint& point) const {
        Sums s = {};
        static_cast<typename Base::Sums&>(s) = Base::template sums_at<F>(scene, lights, side, path, sums, point);
        s.over_pixel = sums.over_pixel;
        if constexpr (!Base::kBidirectional) {
            s.leaf = trees.eye.leaf(point.p);
        } else {
            const GuideTree &own = trees.of(side), &back = trees.against(side);
            s.share = s.back_share = 1.0f;
            if (own.grid) s.share = own.leaves[s.leaf = own.leaf(point.p)].bsdf_share;
            if (!back.grid) return s;
            const uint32_t leaf = back.leaf(point.p);
            s.back_share = back.leaves[leaf].bsdf_share;
            if (s.back_share < 1.0f) s.back_sa = back.pdf_sa(leaf, -path.direction);
        }
        return s;
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& s, bool first, bool delta, float pdf_forward_sa,
                                       float pdf_reverse_sa, float cos_out) const {
        Sums ray = {};
        static_cast<typename Base::Sums&>(ray) =
            Base::sums_after_scatter(s, first, delta, pdf_forward_sa, pdf_reverse_sa, cos_out);
        ray.leaf = s.leaf;
        ray.over_pixel = s.over_pixel;
        return ray;
    }
};

}  // namespace ambilux
