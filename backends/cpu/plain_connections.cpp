#include "backends/cpu/plain_connections.h"

#include "backends/cpu/lanes.h"
#include "items/vertex_items.h"
#include "transport/subpath/connection.h"

namespace ambilux {

namespace {

using Mis = BidirectionalMis;

/// A diffuse end of reflectance 1. Fields one by one: a struct that is copied whole stays in memory.
inline void set_end(SubpathEnd<Mis>& end, Vec3f p, Vec3f ng, Vec3f n, Vec3f wi, float offset, Rgb throughput,
                    uint32_t depth, float sum0, float sum1) {
    Scattering& s = end.vertex.scattering;
    end.vertex.point.p = p;
    end.vertex.point.ng = ng;
    end.vertex.offset = offset;
    end.vertex.sums.dvcm = sum0;
    end.vertex.sums.dvc = sum1;
    end.vertex.first = depth == 1;
    s.frame.s = s.frame.t = {0.0f, 0.0f, 0.0f};
    s.frame.n = n;
    s.ng = ng;
    s.wi_world = wi;
    s.wi.z = dot(n, wi);
    s.bsdf.type = BsdfType::diffuse;
    s.bsdf.inputs.colors[0] = splat(1.0f);
    s.map_rules = 0;
    end.throughput = throughput;
    end.depth = depth;
}

inline Vec3f rounded(Vec3f d) { return octahedral_decode(octahedral_encode(d)); }

inline void connection_at(const Rules<Mis>& rules, PlainPairs& b, uint32_t i) {
    Vec4f place = b.eye[0][i], ng = b.eye[1][i], n = b.eye[2][i], d = b.eye[3][i], thr = b.eye[4][i];
    Vec4f y0 = b.light[0][i], y1 = b.light[1][i], y2 = b.light[2][i], y3 = b.light[3][i];
    const uint32_t depth = float_bits(place.w);
    SubpathEnd<Mis> z, y;
    set_end(z, vector_of(place), vector_of(ng), vector_of(n), -vector_of(d), ng.w, vector_of(thr), depth, n.w, thr.w);
    ConnectionVertexFront front = {vector_of(y0), {float_bits(y0.w)}, {y1.x, y1.y}, 0, 0.0f};
    float found = 0.0f;
    if (depth + front.bits.depth() + 1 <= rules.max_depth)
        if (may_connect(front, z.vertex)) found = 1.0f;
    const VertexBits bits = VertexBits::make(depth, z.vertex);
    set_end(z, vector_of(place), rounded(vector_of(ng)), rounded(vector_of(n)), -rounded(vector_of(d)), bits.offset(),
            vector_of(thr), depth, n.w, thr.w);
    set_end(y, front.p, octahedral_decode(front.ng), octahedral_decode({y3.z, y3.w}), -octahedral_decode({y3.x, y3.y}),
            front.bits.offset(), vector_of(y2), front.bits.depth(), y2.w, y1.w);
    Candidate<Mis> c = {};
    float tmax = PlainPairs::kNone;
    if (connection<kPlain>(rules, z, y, c))
        if (found > 0.0f) tmax = c.tmax;
    b.value[i] = with_word(c.value, c.ratio);
    b.origin[i] = with_word(c.origin, tmax);
    b.direction[i] = with_word(c.direction, found);
}

}  // namespace

AMBILUX_LANES void plain_connections(const Rules<Mis>& rules, PlainPairs& pairs, uint32_t count) {
    Rules<Mis> own = rules;
    own.singles.on = false;  // a table that is looked at under conditions makes no vectors
#pragma omp simd
    for (uint32_t i = 0; i < count; ++i) connection_at(own, pairs, i);
}

}  // namespace ambilux
