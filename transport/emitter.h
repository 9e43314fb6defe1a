// Emitters: light towards a point (next event estimation), its density, and radiance seen directly. Units and
// orientation are Mitsuba's.
#pragma once

#include "transport/emitter/area.h"
#include "transport/emitter/collimated.h"
#include "transport/emitter/constant.h"
#include "transport/emitter/directional.h"
#include "transport/emitter/directional_area.h"
#include "transport/emitter/envmap.h"
#include "transport/emitter/hidden_area.h"
#include "transport/emitter/lights.h"
#include "transport/emitter/point.h"
#include "transport/emitter/projector.h"
#include "transport/emitter/spot.h"

namespace ambilux {

/// `op` with the model of that type; `otherwise` when kernels of features F do not know it.
template <Features F, class Result, class Op>
AMBILUX_HD Result visit_emitter(EmitterType type, Result otherwise, Op op) {
    return EmitterModels::visit<F.emitters>(uint32_t(type), otherwise, op);
}

namespace detail {

template <Features F, LightStart Start>
AMBILUX_HD constexpr bool starts_at(EmitterType type) {
    return EmitterModels::contains<(F.emitters & kEmittersFrom<Start>)>(uint32_t(type));
}

}  // namespace detail

/// Where light of an emitter starts that kernels of features F know. Comparisons, the commonest first.
template <Features F>
AMBILUX_HD constexpr LightStart light_start(EmitterType type) {
    static_assert((kEmittersFrom<LightStart::surface> | kEmittersFrom<LightStart::point> |
                   kEmittersFrom<LightStart::distant> | kEmittersFrom<LightStart::hidden_surface> |
                   kEmittersFrom<LightStart::beam> | kEmittersFrom<LightStart::environment>) == EmitterModels::kAll,
                  "a new LightStart needs a comparison here and its densities in transport/mis/bidirectional.h");
    if (detail::starts_at<F, LightStart::surface>(type)) return LightStart::surface;
    if (detail::starts_at<F, LightStart::point>(type)) return LightStart::point;
    if (detail::starts_at<F, LightStart::distant>(type)) return LightStart::distant;
    if (detail::starts_at<F, LightStart::hidden_surface>(type)) return LightStart::hidden_surface;
    if (detail::starts_at<F, LightStart::beam>(type)) return LightStart::beam;
    return LightStart::environment;
}

// The functions below compare types: one that starts where these do has to be added there.
static_assert(kEmittersFrom<LightStart::surface> == bit(EmitterType::area));
static_assert(kEmittersFrom<LightStart::environment> == (bit(EmitterType::constant) | bit(EmitterType::envmap)));

/// sample_emitter_direct without the lookup of an environment map, which costs more than the rest: s.radiance is to be
/// replaced by emitter_sample_radiance once it is clear that the sample matters. True does not promise light then.
/// `pick`: of the emitter.
template <Features F, class Lights>
AMBILUX_HD bool sample_emitter_deferred(const SceneView& view, const Lights& lights, const Receiver& receiver, Vec4f u,
                                        EmitterSample& s, typename Lights::Pick& pick) {
    if (view.emitter_count == 0) return false;
    pick = lights.pick(view, receiver, u);
    if constexpr (requires { pick.u; }) u = pick.u;
    const Vec3f reference_p = receiver.p;
    const Emitter& emitter = view.emitters[pick.emitter];
    s.emitter = pick.emitter;
    bool lit = false;
    // Not by visit_emitter: with a lambda in between, nvcc spills more in shading kernels.
    switch (emitter.type) {
#define AMBILUX_CASE(Model, name)                                                                                     \
    case EmitterType::name:                                                                                           \
        if constexpr (F.has(EmitterType::name))                                                                       \
            lit = EmitterFunctions<Model>::template sample_direct<F>(view, emitter, reference_p, {u.y, u.z, u.w}, s); \
        break;
        AMBILUX_EMITTERS(AMBILUX_CASE)
#undef AMBILUX_CASE
        default: break;
    }
    s.pdf_sa *= pick.over_power;
    // Written so that NaN fails too.
    return lit && s.pdf_sa > 0.0f && s.pdf_sa < kInfinity && max_component(s.radiance) > 0.0f;
}

/// The same of emitters picked by power.
template <Features F>
AMBILUX_HD bool sample_emitter_deferred(const SceneView& view, Vec3f reference_p, Vec4f u, EmitterSample& s) {
    LightsByPower::Pick pick;
    return sample_emitter_deferred<F>(view, LightsByPower{}, {reference_p, {}}, u, s, pick);
}

/// Radiance of a sample of sample_emitter_deferred, in the units of EmitterSample::radiance.
template <Features F>
AMBILUX_HD Rgb emitter_sample_radiance(const SceneView& view, const EmitterSample& s) {
    if constexpr (F.has(EmitterType::envmap)) {
        const Emitter& emitter = view.emitters[s.emitter];
        if (emitter.type == EmitterType::envmap) return envmap_lookup(view, emitter, s.env_uv);
    }
    return s.radiance;
}

/// True for the emitter that surrounds the scene.
template <Features F>
AMBILUX_HD bool is_environment(const SceneView& view, uint32_t emitter) {
    return F.has_environment() && emitter == view.environment;
}

/// Picks an emitter for `receiver` (world space) and samples its light towards there. `u` in [0,1)^4: x picks the
/// emitter, y and z place the sample on it, w picks the primitive of a mesh or the row of an environment map. False
/// when the sample carries no light (nothing to add, still one sample); then `s` is not to be read.
template <Features F, class Lights>
AMBILUX_HD bool sample_emitter_direct(const SceneView& view, const Lights& lights, const Receiver& receiver, Vec4f u,
                                      EmitterSample& s) {
    typename Lights::Pick pick;
    if (!sample_emitter_deferred<F>(view, lights, receiver, u, s, pick)) return false;
    s.radiance = emitter_sample_radiance<F>(view, s);
    return max_component(s.radiance) > 0.0f;
}
/// The same of emitters picked by power.
template <Features F>
AMBILUX_HD bool sample_emitter_direct(const SceneView& view, Vec3f reference_p, Vec4f u, EmitterSample& s) {
    return sample_emitter_direct<F>(view, LightsByPower{}, {reference_p, {}}, u, s);
}

/// Density per solid angle, pick probability by power included, with which sample_emitter_direct returns unit `wi` at
/// `reference_p` by way of area emitter `emitter`, which a ray along `wi` meets at `hit`. Zero for every other type: no
/// ray meets those. Relative error: 8 roundings and 4 over the cosine at `hit`; spheres 12 and 8 over that of their
/// cone.
template <Features F>
AMBILUX_HD float pdf_emitter_direct(const SceneView& view, uint32_t emitter, Vec3f reference_p, Vec3f wi,
                                    const SurfacePoint& hit) {
    if constexpr (F.has(EmitterType::area)) {
        const Emitter& e = view.emitters[emitter];
        if (e.type == EmitterType::area) return area_pdf_direct<F>(view, e, reference_p, wi, hit);
    }
    return 0.0f;
}

/// Density per solid angle, pick probability by power included, with which sample_emitter_direct returns unit `wi` by
/// way of the environment; zero without one.
template <Features F>
AMBILUX_HD float pdf_environment_direct(const SceneView& view, Vec3f wi) {
    if constexpr (F.has_environment()) {
        if (view.environment == kNone) return 0.0f;
        const Emitter& e = view.emitters[view.environment];
        if (F.has(EmitterType::envmap) && e.type == EmitterType::envmap)
            return e.pick_probability * envmap_pdf_direction(view, e, wi);
        return e.pick_probability * kInv4Pi;
    }
    return 0.0f;
}

/// Radiance that a ray which meets emitter `emitter` at `point` brings, looking back along unit `wo`: of a masked one
/// over its chance to meet it. Zero if it is no area emitter.
template <Features F>
AMBILUX_HD Rgb emitted_radiance(const SceneView& view, uint32_t emitter, const SurfacePoint& point, Vec3f wo) {
    if constexpr (F.has(EmitterType::area)) {
        if (emitter == kNone) return {0, 0, 0};
        const Emitter& e = view.emitters[emitter];
        if (e.type == EmitterType::area) return area_hit_radiance<F>(view, e, point, wo);
    }
    return {0, 0, 0};
}

/// Chance, as weights know it, that a ray which met area emitter `emitter` at `point` would do so.
template <Features F>
AMBILUX_HD float hit_opacity(const SceneView& view, uint32_t emitter, const SurfacePoint& point) {
    return weight_opacity(area_opacity<F>(view, view.emitters[emitter], point.uv));
}

/// Chance, as weights know it, that a ray towards the light sample `s` would meet the emitter there.
AMBILUX_HD float sample_opacity(const SceneView& view, const EmitterSample& s) {
    return view.emitters[s.emitter].type == EmitterType::area ? weight_opacity(s.opacity) : 1.0f;
}

/// Radiance that arrives from unit `wi` where nothing is met; zero without an environment.
template <Features F>
AMBILUX_HD Rgb environment_radiance(const SceneView& view, Vec3f wi) {
    if constexpr (F.has_environment()) {
        if (view.environment == kNone) return {0, 0, 0};
        const Emitter& e = view.emitters[view.environment];
        if (F.has(EmitterType::envmap) && e.type == EmitterType::envmap) return envmap_radiance(view, e, wi);
        return e.radiance.value;
    }
    return {0, 0, 0};
}

}  // namespace ambilux
