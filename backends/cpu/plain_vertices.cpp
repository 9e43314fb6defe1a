#include "backends/cpu/plain_vertices.h"

#include <cstdlib>

#include "items/subpath_items.h"
#include "queues/counter.h"
#include "stages/subpath_numbers.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/scatter.h"

#if defined(__x86_64__)
#define AMBILUX_LANES __attribute__((flatten, target("avx512f,avx512dq,avx512bw,avx512vl,prefer-vector-width=512")))
#else
#define AMBILUX_LANES __attribute__((flatten))
#endif

namespace ambilux {

namespace {

using Mis = UnidirectionalMis;

constexpr Features kPlain = {bit(BsdfType::diffuse), bit(EmitterType::area), bit(PrimitiveType::triangle)};

inline Vec3f vector_of(const Vec4f& v) { return {v.x, v.y, v.z}; }
inline Vec4f with_word(const Vec3f& v, float w) { return {v.x, v.y, v.z, w}; }

struct Corners {
    Vec3f p0, p1, p2, ng;
};
inline Corners corners(const PlainVertices::Row<Vec4f>* rows, uint32_t i) {
    const Vec4f a = rows[0][i], b = rows[1][i], c = rows[2][i];
    return {{a.x, a.y, a.z}, {a.w, b.x, b.y}, {b.z, b.w, c.x}, {c.y, c.z, c.w}};
}

template <bool kSmooth>
inline Vertex<Mis> vertex_of(const PlainVertices& b, uint32_t i) {
    Corners face = corners(b.face, i);
    Vertex<Mis> v;
    detail::place_on_triangle(v.point, face.p0, face.p1, face.p2, b.place[i].x, b.place[i].y);
    v.point.ng = v.point.ns = face.ng;
    v.point.dpdu = vector_of(b.face[3][i]);
    v.point.framed = true;
    if constexpr (kSmooth) {
        MeshVertex corner[3];
        for (int k = 0; k < 3; ++k) corner[k].n = vector_of(b.normal[k][i]);
        const Vec3f ns = detail::interpolated_normal(corner[0], corner[1], corner[2], b.place[i].x, b.place[i].y, face.ng);
        if (b.normal[0][i].w != 0.0f) v.point.ns = ns;
        v.point.framed = b.normal[0][i].w == 0.0f;
    }
    v.offset = ray_offset(v.point.p, v.point.p_error, v.point.ng);
    const Vec3f wi = -vector_of(b.direction[i]);
    const bool flip = (b.reflectance[i].w != 0.0f) & (dot(face.ng, wi) < 0.0f);
    place_scattering(v.scattering, v.point, v.point.ns, flip, wi);
    v.scattering.bsdf.type = BsdfType::diffuse;
    v.scattering.bsdf.inputs.colors[0] = vector_of(b.reflectance[i]);
    v.scattering.map_rules = 0;
    v.sums = {0.0f};
    v.first = false;
    return v;
}

inline void numbers_at(const Wave& wave, PlainVertices& v, uint32_t i) {
    const uint32_t depth = SubpathBits{float_bits(v.direction[i].w)}.depth();
    const RandomNumbers numbers = {wave.key(float_bits(v.throughput[i].w))};
    const Vec4f a = numbers.next_event(depth), b = numbers.scatter(Side::eye, depth);
    v.u_light[0][i] = a.x, v.u_light[1][i] = a.y, v.u_light[2][i] = a.z, v.u_light[3][i] = a.w;
    v.u_scatter[0][i] = b.x, v.u_scatter[1][i] = b.y, v.u_scatter[2][i] = b.z, v.u_scatter[3][i] = b.w;
}

inline void seeds_at(const Wave& wave, PlainVertices& v, uint32_t i) {
    const uint32_t depth = SubpathBits{float_bits(v.direction[i].w)}.depth();
    v.seed[i] = RandomNumbers{wave.key(float_bits(v.throughput[i].w))}.shadow_seed(depth);
}

/// A place on a triangle of an emitter, seen from `reference_p`.
inline LightGeometry sample_triangle(const PlainVertices& b, uint32_t i, Vec3f reference_p, EmitterSample& s) {
    Corners lamp = corners(b.light, i);
    Vec2f place = square_to_triangle({b.u_light[1][i], b.u_light[2][i]});
    SurfacePoint point = {};
    detail::place_on_triangle(point, lamp.p0, lamp.p1, lamp.p2, place.x, place.y);
    point.ng = lamp.ng;
    LightGeometry light = light_from_point(point, reference_p, s);
    s.delta = false;
    s.opacity = 1.0f;
    s.radiance = vector_of(b.radiance[i]);
    s.pdf_sa = pdf_from_area(b.radiance[i].w, light);
    return light;
}
/// What was sampled.
inline void load_sample(const PlainVertices& b, uint32_t i, EmitterSample& s) {
    const Vec4f p = b.light[0][i], p_error = b.light[1][i], ng = b.light[2][i], wi = b.wi[i], radiance = b.radiance[i];
    s.p = vector_of(p);
    s.distance = p.w;
    s.p_error = vector_of(p_error);
    s.pdf_sa = p_error.w;
    s.ng = vector_of(ng);
    s.delta = ng.w != 0.0f;
    s.wi = vector_of(wi);
    s.radiance = vector_of(radiance);
    s.opacity = radiance.w;
}

template <bool kSmooth, bool kSampled>
inline void next_event_at(const Rules<Mis>& rules, PlainVertices& b, uint32_t i) {
    Vertex<Mis> v = vertex_of<kSmooth>(b, i);
    EmitterSample s = {};
    LightGeometry light = {1.0f, 1.0f};
    if constexpr (kSampled)
        load_sample(b, i, s);
    else
        light = sample_triangle(b, i, v.point.p, s);
    Candidate<Mis> c = {};
    const SceneView none = {};
    const Vec4f throughput = b.throughput[i];
    if ((light.cosine > 0.0f) & may_bring_light(s))
        next_event_from<kPlain>(none, rules, v, vector_of(throughput), 1, 1.0f, s, c);
    b.value[i] = with_word(c.value, c.ratio);
    b.origin[i] = with_word(c.origin, c.tmax);
    b.to_light[i] = with_word(c.direction, throughput.w);
}

template <bool kSmooth>
inline void scatter_at(const Rules<Mis>& rules, PlainVertices& b, uint32_t i) {
    Vertex<Mis> v = vertex_of<kSmooth>(b, i);
    Subpath<Mis> path = {};
    path.direction = vector_of(b.direction[i]);
    const Vec4f throughput = b.throughput[i];
    path.throughput = vector_of(throughput);
    const SubpathBits bits = {float_bits(b.direction[i].w)};
    path.depth = bits.depth();
    path.roulette_scale = bits.roulette_scale();
    const Vec4f u = {b.u_scatter[0][i], b.u_scatter[1][i], b.u_scatter[2][i], b.u_scatter[3][i]};
    const bool on = scatter<kPlain>(rules, Side::eye, v, u, path);
    b.next_origin[i] = with_word(path.origin, on ? throughput.w : bits_float(kNoPath));
    b.next_direction[i] = with_word(path.direction, bits_float(SubpathBits::make(path.depth, path.delta, path.roulette_scale).bits));
    b.next_throughput[i] = with_word(path.throughput, path.sums.pdf_sa);
}

}  // namespace

bool has_plain_lanes() {
#if defined(__x86_64__)
    static const bool has = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                            __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
                            !std::getenv("AMBILUX_NO_LANES");
    return has;
#else
    return false;
#endif
}

AMBILUX_LANES void plain_numbers(const Wave& wave, PlainVertices& v, uint32_t count) {
    const WaveState state = *wave.state;
    Wave own = wave;
    own.state = &state;
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) numbers_at(own, v, i);
}

AMBILUX_LANES void plain_seeds(const Wave& wave, PlainVertices& v, uint32_t count) {
    const WaveState state = *wave.state;
    Wave own = wave;
    own.state = &state;
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) seeds_at(own, v, i);
}

template <bool kSmooth, bool kSampled>
AMBILUX_LANES void next_events(const Rules<Mis>& rules, PlainVertices& v, uint32_t count) {
    const Rules<Mis> own = rules;
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) next_event_at<kSmooth, kSampled>(own, v, i);
}

void plain_next_event(const Rules<Mis>& rules, PlainVertices& v, uint32_t count, bool smooth, bool sampled) {
    if (sampled)
        smooth ? next_events<true, true>(rules, v, count) : next_events<false, true>(rules, v, count);
    else
        smooth ? next_events<true, false>(rules, v, count) : next_events<false, false>(rules, v, count);
}

AMBILUX_LANES void plain_scatter(const Rules<Mis>& rules, PlainVertices& v, uint32_t count, bool smooth) {
    const Rules<Mis> own = rules;
    if (smooth) {
#pragma omp simd
        for (uint32_t i = 0; i < count; ++i) scatter_at<true>(own, v, i);
    } else {
#pragma omp simd
        for (uint32_t i = 0; i < count; ++i) scatter_at<false>(own, v, i);
    }
}

}  // namespace ambilux
