// libs: ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// A method brings samplers of its own, of directions and of lights, by a model of weights that names them, and nothing
// else: the expectation of the image stays, whatever they prefer. A sampler that tells wrong densities changes it.
#include <cmath>

#include "accel/cwbvh.h"
#include "core/sampling.h"
#include "integrators/bdpt/wavefront/integrator.h"
#include "integrators/path/integrator.h"
#include "integrators/path/ris/integrator.h"
#include "tests/support/render_scene.h"
#include "tests/support/third_sum.h"
#include "tests/support/wave_film.h"

using namespace ambilux;

namespace {

/// Half of the directions come from the BSDF, half are uniform over the hemisphere of the side that the subpath came
/// from. `kTells`: evaluate() says so; else its densities are those of the BSDF, which is wrong.
template <bool kTells>
struct MixedDirections {
    float share = 0.5f;  ///< of the BSDF

    float uniform_pdf(const Scattering& s, Vec3f wo) const {
        return dot(s.ng, s.wi_world) * dot(s.ng, wo) > 0.0f ? (1.0f - share) * kInv2Pi : 0.0f;
    }
    BsdfValue mixed(const Scattering& s, Vec3f wo, BsdfValue f) const {
        const float uniform = uniform_pdf(s, wo);  // the same from the other side
        f.pdf_sa = share * f.pdf_sa + uniform;
        f.pdf_reverse_sa = share * f.pdf_reverse_sa + uniform;
        return f;
    }
    template <Features F, class Mis>
    BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) const {
        const BsdfValue f = scatter_evaluate<F>(v.scattering, wo, mode);
        return kTells ? mixed(v.scattering, wo, f) : f;
    }
    template <Features F, class Mis>
    bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const {
        const Scattering& at = v.scattering;
        if (u.x < share) {
            if (!scatter_sample<F>(at, {u.x / share, u.y, u.z}, mode, s)) return false;
            if (s.flags & kScatterDelta) {
                s.pdf_sa *= share;
                s.weight = s.weight / share;
                return true;
            }
        } else {
            const Vec3f n = dot(at.ng, at.wi_world) > 0.0f ? at.ng : -at.ng;
            const float z = (u.x - share) / (1.0f - share), r = std::sqrt(1.0f - z * z);
            s.wo = frame_from_normal(n).to_world({r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z});
            s.eta = 1.0f;
            s.flags = 0;
        }
        BsdfValue f = scatter_evaluate<F>(at, s.wo, mode);
        if (is_zero(f.value)) return false;
        f = mixed(at, s.wo, f);
        s.pdf_sa = f.pdf_sa;
        s.pdf_reverse_sa = f.pdf_reverse_sa;
        s.weight = f.value / f.pdf_sa;
        return true;
    }
};

/// Picks emitters uniformly, but those of even number three times as often where the receiver lies in the upper half of
/// the scene or, kByNormal, looks up or down rather than to a side. `kTells`: over_power() says so.
template <bool kTells, bool kByNormal = false>
struct FickleLights {
    struct Pick {
        uint32_t emitter;
        float over_power;
    };

    static bool prefers_even(const SceneView& view, const Receiver& r) {
        return kByNormal ? std::fabs(r.n.z) > 0.7f : r.p.z > view.bounds_center.z;
    }
    static float weight(const SceneView& view, const Receiver& r, uint32_t i) {
        return view.emitters[i].pick_probability > 0.0f ? (prefers_even(view, r) && i % 2 == 0 ? 3.0f : 1.0f) : 0.0f;
    }
    static float probability(const SceneView& view, const Receiver& r, uint32_t emitter) {
        float total = 0.0f;
        for (uint32_t i = 0; i < view.emitter_count; ++i) total += weight(view, r, i);
        return weight(view, r, emitter) / total;
    }
    static Pick pick(const SceneView& view, const Receiver& r, Vec4f u) {
        uint32_t i = 0, last = 0;
        for (float left = u.x; i < view.emitter_count; ++i) {
            const float p = probability(view, r, i);
            if (p > 0.0f) last = i;
            if (left < p) break;
            left -= p;
        }
        return {last, probability(view, r, last) / view.emitters[last].pick_probability};
    }
    static float over_power(const SceneView& view, const Receiver& r, uint32_t emitter, uint32_t) {
        if (!kTells) return 1.0f;
        return probability(view, r, emitter) / view.emitters[emitter].pick_probability;
    }
};

template <class Base, class DirectionsOf, class LightsOf>
struct With : Base {
    using Directions = DirectionsOf;
    using Lights = LightsOf;
};

/// A path tracer whose rays know the normal where they began, as lights are picked by it.
struct ByNormalMis : UnidirectionalMis {
    using Lights = FickleLights<true, true>;
    struct Sums {
        float pdf_sa;
        Vec2f normal;  ///< octahedral

        Vec3f receiver_normal() const { return octahedral_decode(normal); }
        operator UnidirectionalMis::Sums() const { return {pdf_sa}; }
    };

    template <Features>
    void start_eye(const SceneView&, Vec3f, Sums& sums, Start&) const {
        sums = {};
    }
    template <Features F, class Path>
    Sums sums_at(const SceneView&, const Lights&, Side, const Path&, const Sums& sums,
                 const SurfacePoint& point) const {
        return {sums.pdf_sa, octahedral_encode(point.ng)};
    }
    Sums sums_after_scatter(const Sums& s, bool, bool, float pdf_forward_sa, float, float) const {
        return {pdf_forward_sa, s.normal};
    }
};

/// Numbers of its own: those of another seed.
struct OtherNumbers : RandomNumbers {
    OtherNumbers(const RngKey& k, uint32_t n = 0) : RandomNumbers{k, n} { key.seed ^= 0x5bd1e995u; }
};
template <class Base>
struct WithOtherNumbers : Base {
    using Numbers = OtherNumbers;
};

template <class Mis>
using PathBy =
    PathIntegrator<kAllFeatures, CwbvhTracer, Fusion{.weigh = true, .connect = true}, NextEvent, NoSettings, Mis>;
template <class Mis>
using BdptBy = WavefrontOf<kAllFeatures, CwbvhTracer, Fusion{.weigh = true, .connect = true}, Mis>;

constexpr uint32_t kFilmSide = 16;

/// Mean and its variance of blocks of pixels, by channel, over samples of the film.
struct BlockMeans {
    static constexpr uint32_t kSide = 4;  ///< blocks along each axis
    std::vector<double> sum = std::vector<double>(kSide * kSide * 3), squares = sum;
    uint32_t samples = 0;

    void add(const std::vector<double>& film) {
        std::vector<double> block(sum.size());
        for (uint32_t i = 0; i < kFilmSide * kFilmSide; ++i) {
            const uint32_t x = i % kFilmSide * kSide / kFilmSide, y = i / kFilmSide * kSide / kFilmSide;
            for (uint32_t c = 0; c < 3; ++c) block[(y * kSide + x) * 3 + c] += film[3 * i + c];
        }
        for (size_t b = 0; b < block.size(); ++b) {
            sum[b] += block[b];
            squares[b] += block[b] * block[b];
        }
        ++samples;
    }
    double mean(size_t b) const { return sum[b] / samples; }
    double variance(size_t b) const { return std::max(0.0, squares[b] / samples - mean(b) * mean(b)) / (samples - 1); }
};

struct Case {
    const char* scene;
    MisHeuristic heuristic = MisHeuristic::balance;
    uint32_t samples = 192;
};

/// add(film of A, film of B) for each sample. `seeds`: of A and B.
template <class A, class B, class Add>
void for_films(const Case& c, const std::string& integrator, std::pair<uint64_t, uint64_t> seeds, Add add) {
    const Scene scene = project_scene(c.scene, kFilmSide, kFilmSide);
    const CwbvhAccel accel(scene);
    RenderSettings s;
    s.integrator = integrator;
    s.heuristic = c.heuristic;
    s.max_depth = 6;
    const auto a = A::plan(scene, s);
    const auto b = B::plan(scene, s);
    for (uint32_t i = 0; i < c.samples; ++i)
        add(wave_film<A>(scene, accel.tracer(), a, seeds.first, i),
            wave_film<B>(scene, accel.tracer(), b, seeds.second, i));
}

/// The image by Integrator is that by Reference.
template <class Integrator, class Reference>
void check(const Case& c, const std::string& integrator) {
    BlockMeans a, b;
    for_films<Integrator, Reference>(c, integrator, {1, 2}, [&](const auto& x, const auto& y) { a.add(x), b.add(y); });
    double most = 0, squares = 0;
    for (size_t k = 0; k < a.sum.size(); ++k) {
        const double variance = a.variance(k) + b.variance(k);
        const double z = variance > 0 ? std::fabs(a.mean(k) - b.mean(k)) / std::sqrt(variance) : 0.0;
        most = std::max(most, z);
        squares += z * z;
    }
    INFO(c.scene << " " << integrator << " heuristic " << int(c.heuristic) << ", deviations: most " << most
                 << ", mean square " << squares / double(a.sum.size()));
    CHECK(most < 4.5);
    CHECK(squares < 2.0 * double(a.sum.size()));
}

/// Two that differ in what they tell, with the same random numbers, do not have the same expectation.
template <class Right, class Wrong>
void check_found(const Case& c, const std::string& integrator) {
    BlockMeans difference;
    for_films<Right, Wrong>(c, integrator, {1, 1}, [&](auto x, const auto& y) {
        for (size_t i = 0; i < x.size(); ++i) x[i] -= y[i];
        difference.add(x);
    });
    double most = 0;
    for (size_t k = 0; k < difference.sum.size(); ++k)
        if (difference.variance(k) > 0)
            most = std::max(most, std::fabs(difference.mean(k)) / std::sqrt(difference.variance(k)));
    INFO(c.scene << " " << integrator << ", deviations " << most);
    CHECK(most > 6);
}

template <bool kTells>
using MixedPath = With<UnidirectionalMis, MixedDirections<kTells>, LightsByPower>;
template <bool kTells>
using MixedBdpt = With<BidirectionalMis, MixedDirections<kTells>, LightsByPower>;
template <bool kTells>
using FicklePath = With<UnidirectionalMis, BsdfDirections, FickleLights<kTells>>;
template <bool kTells>
using FickleBdpt = With<BidirectionalMis, BsdfDirections, FickleLights<kTells>>;

using PathByTree = PathBy<ByTree<UnidirectionalMis>>;
using BdptByTree = BdptBy<ByTree<BidirectionalMis>>;
template <class Mis>
using RisBy = PathIntegrator<kAllFeatures, CwbvhTracer, Fusion{.weigh = true, .connect = true}, ResampledNextEvent,
                             RisSettings, Mis>;

constexpr Case kDirectionCases[] = {{"cornell"}, {"materials", MisHeuristic::power}, {"glass"}};
constexpr Case kLightCases[] = {{"lights"}, {"lights", MisHeuristic::power}, {"textured"}};

}  // namespace

TEST_CASE("Directions half from the BSDF and half uniform give the same image, by paths and bidirectionally") {
    for (const Case& c : kDirectionCases) {
        check<PathBy<MixedPath<true>>, PathBy<UnidirectionalMis>>(c, "path");
        check<BdptBy<MixedBdpt<true>>, BdptBy<BidirectionalMis>>(c, "bdpt");
    }
}

TEST_CASE("Lights picked by a tree give the same image, by paths and bidirectionally") {
    for (const Case& c : {Case{"lights"}, Case{"lights", MisHeuristic::power}, Case{"textured"}, Case{"glass"},
                          Case{"bathroom", MisHeuristic::balance, 96}}) {
        check<PathByTree, PathBy<UnidirectionalMis>>(c, "path");
        check<BdptByTree, BdptBy<BidirectionalMis>>(c, "bdpt");
    }
    check<RisBy<ByTree<UnidirectionalMis>>, PathBy<UnidirectionalMis>>({"lights"}, "path");
}

TEST_CASE("Samplers that tell wrong densities are found") {
    check_found<PathBy<MixedPath<true>>, PathBy<MixedPath<false>>>({"cornell"}, "path");
    check_found<BdptBy<MixedBdpt<true>>, BdptBy<MixedBdpt<false>>>({"cornell"}, "bdpt");
    check_found<PathBy<FicklePath<true>>, PathBy<FicklePath<false>>>({"lights"}, "path");
    check_found<BdptBy<FickleBdpt<true>>, BdptBy<FickleBdpt<false>>>({"lights"}, "bdpt");
}

TEST_CASE("Lights picked by what the receiver is give the same image, by paths and bidirectionally") {
    for (const Case& c : kLightCases) {
        check<PathBy<FicklePath<true>>, PathBy<UnidirectionalMis>>(c, "path");
        check<BdptBy<FickleBdpt<true>>, BdptBy<BidirectionalMis>>(c, "bdpt");
    }
    check<PathBy<ByNormalMis>, PathBy<UnidirectionalMis>>({"lights"}, "path");
}

TEST_CASE("Samplers of directions and lights go with each other and with a third sum") {
    using Both = With<ThirdSumMis, MixedDirections<true>, LightsByPower>;
    check<BdptBy<Both>, BdptBy<BidirectionalMis>>({"materials"}, "bdpt");
    // What a render does without is said of them as of the model that they add to.
    const Scene scene = project_scene("cornell", 8, 8);
    RenderSettings s;
    s.integrator = "bdpt";
    const auto skipped = [&]<class Integrator>() { return Integrator::skipped(scene, Integrator::plan(scene, s)); };
    for (const int max_depth : {8, 1}) {
        s.max_depth = max_depth;
        CHECK(skipped.template operator()<BdptBy<Both>>() == skipped.template operator()<BdptBy<BidirectionalMis>>());
        CHECK(skipped.template operator()<BdptBy<Both>>().empty() == (max_depth == 8));
    }
}

TEST_CASE("A model's random numbers are those of its subpaths") {
    const Scene scene = project_scene("cornell", 16, 16);
    const CwbvhAccel accel(scene);
    RenderSettings s;
    s.integrator = "path";
    const auto film = [&]<class Integrator>(uint64_t seed) {
        return wave_film<Integrator>(scene, accel.tracer(), Integrator::plan(scene, s), seed, 0);
    };
    using Own = PathBy<UnidirectionalMis>;
    using Other = PathBy<WithOtherNumbers<UnidirectionalMis>>;
    CHECK(film.template operator()<Other>(5) == film.template operator()<Own>(5 ^ 0x5bd1e995u));
    CHECK(film.template operator()<Other>(5) != film.template operator()<Own>(5));
}
