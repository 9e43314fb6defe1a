// Loops that GCC makes vectors of, of 16 floats with AVX-512 and else of 8 with AVX2, because all that they call is
// inlined, early returns included, whose conditions it joins. What it needs for that: the options in
// render/CMakeLists.txt; a function around the body, whose locals are not those of the loop; structs that are not const
// where parts of them are copied; no bool that is one of two bools.
#include "backends/cpu/plain_vertices.h"

#include "items/vertex_items.h"
#include "queues/counter.h"
#include "stages/subpath_numbers.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/scatter.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define AMBILUX_LANES __attribute__((flatten, target_clones("arch=x86-64-v4", "default")))
#else
#define AMBILUX_LANES
#endif

namespace ambilux {

namespace {

using Mis = UnidirectionalMis;

/// What lanes know.
constexpr Features kPlain = {bit(BsdfType::diffuse), bit(EmitterType::area), bit(PrimitiveType::triangle)};

inline Vec3f vector_of(const Vec4f& v) { return {v.x, v.y, v.z}; }
inline Vec4f with_word(const Vec3f& v, float word) { return {v.x, v.y, v.z, word}; }

inline SubpathBits bits_of(const PlainVertices& b, uint32_t i) { return {float_bits(b.direction[i].w)}; }

struct Corners {
    Vec3f p0, p1, p2, ng;
};
inline Corners corners_of(const PlainVertices::Row<Vec4f>* rows, uint32_t i) {
    const Vec4f a = rows[0][i], b = rows[1][i], c = rows[2][i];
    return {{a.x, a.y, a.z}, {a.w, b.x, b.y}, {b.z, b.w, c.x}, {c.y, c.z, c.w}};
}

template <bool kSmooth>
inline Vertex<Mis> vertex_of(const PlainVertices& b, uint32_t i) {
    Corners face = corners_of(b.face, i);
    const float b1 = b.place[i].x, b2 = b.place[i].y;
    Vertex<Mis> v;
    detail::place_on_triangle(v.point, face.p0, face.p1, face.p2, b1, b2);
    v.point.ng = v.point.ns = face.ng;
    v.point.dpdu = vector_of(b.face[3][i]);
    v.point.framed = true;
    if constexpr (kSmooth) {
        MeshVertex corner[3];
        for (int k = 0; k < 3; ++k) corner[k].n = vector_of(b.normal[k][i]);
        const Vec3f ns = detail::interpolated_normal(corner[0], corner[1], corner[2], b1, b2, face.ng);
        v.point.framed = b.normal[0][i].w == 0.0f;
        if (!v.point.framed) v.point.ns = ns;
    }
    v.offset = ray_offset(v.point.p, v.point.p_error, v.point.ng);
    const Vec3f wi = -vector_of(b.direction[i]);
    const bool flip = (b.reflectance[i].w != 0.0f) & (dot(face.ng, wi) < 0.0f);
    const float again = b.place[i].z != 0.0f ? inverse_sqrt(length_squared(v.point.ns)) : 1.0f;
    v.scattering.frame = scattering_frame(v.point, v.point.ns * again);
    v.scattering.ng = face.ng;
    if (flip) {
        v.scattering.frame.n = -v.scattering.frame.n;
        v.scattering.ng = -v.scattering.ng;
    }
    v.scattering.wi_world = wi;
    v.scattering.wi = v.scattering.frame.to_local(wi);
    v.scattering.flipped = flip;
    v.scattering.bsdf.type = BsdfType::diffuse;
    v.scattering.bsdf.inputs.colors[0] = vector_of(b.reflectance[i]);
    v.scattering.map_rules = 0;
    v.sums = {0.0f};
    v.first = false;
    return v;
}

inline void numbers_at(const Wave& wave, PlainVertices& v, uint32_t i) {
    const uint32_t depth = bits_of(v, i).depth();
    const RandomNumbers numbers = {wave.key(float_bits(v.throughput[i].w))};
    const Vec4f a = numbers.next_event(depth), b = numbers.scatter(Side::eye, depth);
    v.u_light[0][i] = a.x, v.u_light[1][i] = a.y, v.u_light[2][i] = a.z, v.u_light[3][i] = a.w;
    v.u_scatter[0][i] = b.x, v.u_scatter[1][i] = b.y, v.u_scatter[2][i] = b.z, v.u_scatter[3][i] = b.w;
}

inline void shadow_seed_at(const Wave& wave, PlainVertices& v, uint32_t i) {
    v.shadow_seed[i] = RandomNumbers{wave.key(float_bits(v.throughput[i].w))}.shadow_seed(bits_of(v, i).depth());
}

/// A place on a triangle of an emitter, seen from `reference_p`.
inline LightGeometry sample_triangle(const PlainVertices& b, uint32_t i, Vec3f reference_p, EmitterSample& s) {
    Corners lamp = corners_of(b.light, i);
    const Vec2f place = square_to_triangle({b.u_light[1][i], b.u_light[2][i]});
    SurfacePoint point = {};
    detail::place_on_triangle(point, lamp.p0, lamp.p1, lamp.p2, place.x, place.y);
    point.ng = lamp.ng;
    LightGeometry light = light_from_point(point, reference_p, s);
    s.delta = false;
    s.radiance = vector_of(b.radiance[i]);
    s.pdf_sa = pdf_from_area(b.radiance[i].w, light);
    return light;
}
inline void load_sample(const PlainVertices& b, uint32_t i, EmitterSample& s) {
    const Vec4f p = b.light[0][i], p_error = b.light[1][i], ng = b.light[2][i];
    s.p = vector_of(p);
    s.distance = p.w;
    s.p_error = vector_of(p_error);
    s.pdf_sa = p_error.w;
    s.ng = vector_of(ng);
    s.delta = ng.w != 0.0f;
    s.wi = vector_of(b.wi[i]);
    s.radiance = vector_of(b.radiance[i]);
}

/// next_event() of the sample `light`.
inline void next_event_of(const Rules<Mis>& rules, const Vertex<Mis>& v, Rgb throughput, const EmitterSample& light,
                          Candidate<Mis>& c) {
    const SceneView none = {};
    if (!may_scatter(v.scattering, light.wi)) return;
    const BsdfValue f = rules.directions.template evaluate<kPlain>(v, light.wi, TransportMode::radiance);
    if (is_zero(f.value)) return;
    c.value = next_event_value(throughput, f, light, false);
    if (is_zero(c.value)) return;
    complete_next_event<kPlain>(none, rules, v, 1, 1.0f, light, f, c);
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
    const Vec4f throughput = b.throughput[i];
    // As sample_emitter_deferred ends.
    if ((light.cosine > 0.0f) & (s.pdf_sa > 0.0f) & (s.pdf_sa < kInfinity) & (max_component(s.radiance) > 0.0f))
        next_event_of(rules, v, vector_of(throughput), s, c);
    b.value[i] = with_word(c.value, c.ratio);
    b.origin[i] = with_word(c.origin, c.tmax);
    b.to_light[i] = with_word(c.direction, throughput.w);
}

template <bool kSmooth>
inline void scatter_at(const Rules<Mis>& rules, PlainVertices& b, uint32_t i) {
    Vertex<Mis> v = vertex_of<kSmooth>(b, i);
    const Vec4f throughput = b.throughput[i];
    Subpath<Mis> path = {};
    path.direction = vector_of(b.direction[i]);
    path.throughput = vector_of(throughput);
    path.depth = bits_of(b, i).depth();
    path.roulette_scale = bits_of(b, i).roulette_scale();
    const Vec4f u = {b.u_scatter[0][i], b.u_scatter[1][i], b.u_scatter[2][i], b.u_scatter[3][i]};
    const bool goes_on = scatter<kPlain>(rules, Side::eye, v, u, path);
    const SubpathBits bits = SubpathBits::make(path.depth, path.delta, path.roulette_scale);
    b.next_origin[i] = with_word(path.origin, goes_on ? throughput.w : bits_float(kNoPath));
    b.next_direction[i] = with_word(path.direction, bits_float(bits.bits));
    b.next_throughput[i] = with_word(path.throughput, path.sums.pdf_sa);
}

/// unpack_end() of a diffuse one. Fields one by one: a struct that is copied whole stays in memory.
inline void load_end(const PlainPairs::Row<Vec4f>* rows, uint32_t i, SubpathEnd<BidirectionalMis>& end) {
    Vec4f a = rows[0][i], b = rows[1][i], c = rows[2][i], d = rows[3][i];
    const VertexBits bits = {float_bits(a.w)};
    Scattering& s = end.vertex.scattering;
    end.vertex.point.p = vector_of(a);
    end.vertex.point.ng = s.ng = octahedral_decode({b.x, b.y});
    end.vertex.offset = bits.offset();
    end.vertex.sums.dvcm = c.w;
    end.vertex.sums.dvc = b.w;
    end.vertex.first = bits.depth() == 1;
    s.frame.s = s.frame.t = {0.0f, 0.0f, 0.0f};
    s.frame.n = octahedral_decode({d.z, d.w});
    s.wi_world = -octahedral_decode({d.x, d.y});
    s.wi.z = dot(s.frame.n, s.wi_world);
    s.bsdf.type = BsdfType::diffuse;
    s.bsdf.inputs.colors[0] = splat(1.0f);
    s.map_rules = 0;
    end.throughput = vector_of(c);
    end.depth = bits.depth();
}

inline void connection_at(const Rules<BidirectionalMis>& rules, PlainPairs& b, uint32_t i) {
    SubpathEnd<BidirectionalMis> z, y;
    load_end(b.eye, i, z);
    load_end(b.light, i, y);
    Candidate<BidirectionalMis> c = {};
    float tmax = -1.0f;
    if (connection<kPlain>(rules, z, y, c)) tmax = c.tmax;
    b.value[i] = with_word(c.value, c.ratio);
    b.origin[i] = with_word(c.origin, tmax);
    b.direction[i] = with_word(c.direction, tmax);
}

/// Parameters are copied: no store may change them.
struct OwnWave {
    WaveState state;
    Wave wave;

    explicit OwnWave(const Wave& w) : state(*w.state), wave(w) { wave.state = &state; }
};

template <bool kSmooth, bool kSampled>
AMBILUX_LANES void next_events(const Rules<Mis>& rules, PlainVertices& v, uint32_t count) {
    const Rules<Mis> own = rules;
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) next_event_at<kSmooth, kSampled>(own, v, i);
}
template <bool kSmooth>
AMBILUX_LANES void scatters(const Rules<Mis>& rules, PlainVertices& v, uint32_t count) {
    const Rules<Mis> own = rules;
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) scatter_at<kSmooth>(own, v, i);
}

}  // namespace

bool has_plain_lanes() {
#if defined(__clang__) || !defined(__x86_64__)
    return false;  // Clang 14 and 19 make vectors of the random numbers alone
#elif defined(__AVX2__) && defined(__FMA__)
    return !plain_lanes_off;
#else
    return !plain_lanes_off && __builtin_cpu_supports("x86-64-v4");
#endif
}

AMBILUX_LANES void plain_numbers(const Wave& wave, PlainVertices& v, uint32_t count) {
    const OwnWave own(wave);
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) numbers_at(own.wave, v, i);
}

AMBILUX_LANES void plain_shadow_seeds(const Wave& wave, PlainVertices& v, uint32_t count) {
    const OwnWave own(wave);
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) shadow_seed_at(own.wave, v, i);
}

void plain_next_event(const Rules<Mis>& rules, PlainVertices& v, uint32_t count, bool smooth, bool sampled) {
    if (sampled)
        smooth ? next_events<true, true>(rules, v, count) : next_events<false, true>(rules, v, count);
    else
        smooth ? next_events<true, false>(rules, v, count) : next_events<false, false>(rules, v, count);
}

void plain_scatter(const Rules<Mis>& rules, PlainVertices& v, uint32_t count, bool smooth) {
    smooth ? scatters<true>(rules, v, count) : scatters<false>(rules, v, count);
}

AMBILUX_LANES void plain_connections(const Rules<BidirectionalMis>& rules, PlainPairs& pairs, uint32_t count) {
    Rules<BidirectionalMis> own = rules;
    own.singles.on = false;  // a table that is looked at under conditions makes no vectors
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) connection_at(own, pairs, i);
}

}  // namespace ambilux
