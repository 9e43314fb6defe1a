// What travels through the queues of light tracing and bidirectional path tracing.
#pragma once

#include "stages/path_items.h"
#include "stages/techniques.h"
#include "transport/walk.h"

namespace ambilux {

/// A ray of a walk.
struct WalkItem {
    static constexpr uint32_t kPairedLanes = 4;

    Vec3f o;
    uint32_t path;
    Vec3f d;
    WalkBits bits;
    Rgb throughput;
    float tmax;        ///< first ray of an eye walk: to the far plane
    float dvcm, dvc;   ///< sums of the ray; first ray of a light walk: LightStart::inv_pdf and direction
    uint32_t extra[2]; ///< first ray of an eye walk: start_distance; of a light walk: LightStart::prim and emitter
};

/// Where that ray ended; `prim == kNone`: nowhere.
struct WalkHit {
    static constexpr uint32_t kPairedLanes = 4;

    WalkItem ray;
    float u, v;
    uint32_t prim;
    uint32_t pad;
};

/// To which sides a vertex scatters, and its depth. Of the normal 8 bits of either coordinate of its octahedral map are kept.
struct VertexSide {
    uint32_t bits;

    /// For whoever asks for the depth only.
    AMBILUX_HD static VertexSide of_depth(uint32_t depth) { return {depth | kThrough}; }
    /// `n`: unit geometric normal on the side that the walk came from; `through`: the BSDF passes light to the other side too.
    AMBILUX_HD static VertexSide make(uint32_t depth, Vec3f n, bool through) {
        const Vec2f e = octahedral_encode(n);
        return {depth | (through ? kThrough : 0u) | quantised(e.x) << 16 | quantised(e.y) << 24};
    }
    AMBILUX_HD uint32_t depth() const { return bits & WalkBits::kMaxDepth; }
    /// False if nothing is scattered towards `w`, of any length. True for a few directions more: up to two degrees behind the surface.
    AMBILUX_HD bool reaches(Vec3f w) const {
        if (bits & kThrough) return true;
        const Vec3f n = octahedral_decode({(float(bits >> 16 & 255u) - 127.0f) * (1.0f / 127.0f), (float(bits >> 24) - 127.0f) * (1.0f / 127.0f)});
        const float along = dot(n, w);
        return !(along <= 0.0f && sqr(along) >= sqr(kError) * length_squared(w));
    }

private:
    static constexpr uint32_t kThrough = 1u << WalkBits::kDepthBits;
    static constexpr float kError = 0.017f;  ///< half a step, 1/254, in x and y, as much as both in z, over the least length, 1/sqrt(3), of a vector whose coordinates have the sum 1

    AMBILUX_HD static uint32_t quantised(float x) { return uint32_t(clamp(x * 127.0f + 127.5f, 0.0f, 254.0f)); }
};

/// What tells whether a vertex can be connected with a point, and which vertex is next: memory moves 32 bytes at a time, and most pairs need no more.
struct VertexFront {
    Vec3f p;
    VertexSide side;
    Vec3f d;           ///< of the ray that met it
    uint32_t link;     ///< the path; of a vertex that is kept over a wave, the one before it in the same walk or kNone
};

/// A point on a surface as hits name it.
struct SurfacePlace {
    float u, v;
    uint32_t prim;
};

/// True if vertices hold all that a connection asks for. Else their surfaces are looked up again: without textures that costs less than 64 bytes more of every vertex (docs/performance.md).
template <Features F>
constexpr bool vertices_are_whole() {
    return F.textures;
}

/// A vertex of a walk.
struct VertexItem {
    static constexpr uint32_t kPairedLanes = 8;

    VertexFront front;
    Rgb throughput;
    float dvcm;
    union {
        SurfacePlace place;        ///< of a vertex that is not whole
        Rgb specular_reflectance;  ///< of one that is (ScatteringParts), which has what follows `dvc` too
    };
    float dvc;
    Vec3f ng;
    float offset;                  ///< WalkVertex::offset
    Vec3f n;
    uint32_t record;
    Vec3f tangent;
    float alpha_u;
    Rgb color;
    float alpha_v;

    AMBILUX_HD uint32_t path() const { return front.link; }
};

/// Lanes of a VertexItem that kernels of these features use.
template <Features F>
constexpr uint32_t vertex_lanes() {
    return vertices_are_whole<F>() ? sizeof(VertexItem) / sizeof(Lane) : 4;
}

/// Vertices of light walks, kept over a wave.
using LightVertices = Queue<VertexItem>;

/// An eye vertex and a vertex of a light walk to be connected.
struct PairItem {
    uint32_t vertex;  ///< place of the eye vertex in the queue of its depth
    uint32_t light;   ///< place of the light vertex
    uint32_t path;
    uint32_t next;    ///< what the pairs of the next launch start from (first_pair); kNone: no pairs are left, or another pair has it
};

/// Light for a place on the film, before it is weighted, and the ray that must be free.
struct SplatCandidate {
    Rgb value;
    uint32_t path;
    Vec3f o;
    float tmax;
    Vec3f d;
    uint32_t alpha_seed;
    Vec2f film;        ///< position in pixels of the full film
    float others;      ///< weight = 1 / (1 + others)
    Strategy strategy;
};

/// Light that arrived on the film.
struct SplatItem {
    Rgb value;
    uint32_t path;
    Vec2f film;
    Strategy strategy;
    float others;      ///< what it was weighted by
};

/// What became of a walk at a hit: the ray with which it goes on.
struct WalkStep {
    WalkItem ray;
    bool goes_on = false;
};

AMBILUX_HD Ray ray_of(const WalkItem& r) { return {r.o, r.bits.depth() == 1 ? r.tmax : kInfinity, r.d, 0}; }
AMBILUX_HD WalkHit hit_of(const WalkItem& r, const Hit& hit) { return {r, hit.u, hit.v, hit.prim, 0}; }

/// `first_tmax`: WalkItem::tmax.
AMBILUX_HD WalkItem pack_walk(const Walk& w, uint32_t path, bool light, float first_tmax) {
    WalkItem item = {w.o, path, w.d, WalkBits::make(w.depth, w.delta, w.eta_scale), w.throughput, first_tmax, w.sums.dvcm, w.sums.dvc, {0, 0}};
    if (w.depth == 1 && light) {
        item.dvcm = w.start.inv_pdf;
        item.dvc = w.start.direction;
        item.extra[0] = w.start.prim;
        item.extra[1] = w.start.emitter;
    } else if (w.depth == 1) {
        item.extra[0] = float_bits(w.start_distance);
    }
    return item;
}

AMBILUX_HD Walk unpack_walk(const WalkItem& item) {
    Walk w{};
    w.o = item.o;
    w.d = item.d;
    w.throughput = item.throughput;
    w.sums = {item.dvcm, item.dvc};
    w.start = {item.dvcm, item.dvc, item.extra[0], item.extra[1]};
    w.start_distance = bits_float(item.extra[0]);
    w.depth = item.bits.depth();
    w.eta_scale = item.bits.eta_scale();
    w.delta = item.bits.delta();
    return w;
}

/// The vertex `v` at `place` that a ray along `d` met.
template <Features F>
AMBILUX_HD VertexItem pack_vertex(const WalkVertex& v, SurfacePlace place, Vec3f d, Rgb throughput, VertexSide side, uint32_t link) {
    VertexItem item = {};
    item.front = {v.point.p, side, d, link};
    item.throughput = throughput;
    item.dvcm = v.sums.dvcm;
    item.dvc = v.sums.dvc;
    if constexpr (vertices_are_whole<F>()) {
        const ScatteringParts s = parts_of(v.scattering);
        item.specular_reflectance = s.parameters.specular_reflectance;
        item.ng = s.ng;
        item.offset = v.offset;
        item.n = s.n;
        item.record = s.record;
        item.tangent = s.tangent;
        item.alpha_u = s.parameters.alpha_u;
        item.color = s.parameters.color;
        item.alpha_v = s.parameters.alpha_v;
    } else {
        item.place = place;
    }
    return item;
}
/// For connections of the path of `hit`.
template <Features F>
AMBILUX_HD VertexItem pack_vertex(const WalkVertex& v, const WalkHit& hit) {
    return pack_vertex<F>(v, {hit.u, hit.v, hit.prim}, hit.ray.d, hit.ray.throughput, VertexSide::of_depth(hit.ray.bits.depth()), hit.ray.path);
}
/// Of a light walk, after the vertex `previous`.
template <Features F>
AMBILUX_HD VertexItem pack_light_vertex(const WalkVertex& y, SurfacePlace place, Vec3f d, Rgb throughput, uint32_t depth, uint32_t previous) {
    const bool in_front = dot(y.point.ng, d) < 0.0f;
    return pack_vertex<F>(y, place, d, throughput, VertexSide::make(depth, in_front ? y.point.ng : -y.point.ng, bsdf_transmits(y.scattering.bsdf.type)), previous);
}

template <Features F>
AMBILUX_HD WalkVertex unpack_vertex(const SceneView& scene, const VertexItem& item) {
    WalkVertex v = {};
    if constexpr (vertices_are_whole<F>()) {
        v.point.p = item.front.p;
        v.point.ng = item.ng;
        v.offset = item.offset;
        v.scattering = scattering_of<F>(scene, {item.ng, item.n, item.tangent, item.record, {item.color, item.alpha_u, item.specular_reflectance, item.alpha_v}}, -item.front.d);
        v.first = item.front.side.depth() == 1;
    } else {
        v = walk_vertex<F>(scene, item.front.d, item.front.side.depth(), item.place.prim, item.place.u, item.place.v);
    }
    v.sums = {item.dvcm, item.dvc};
    return v;
}

/// False if no light can pass between the vertex `y` of a light walk and `z`: may_connect of their vertices, in doubt true.
AMBILUX_HD bool may_connect(const VertexFront& y, const WalkVertex& z) {
    const Vec3f w = z.point.p - y.p;
    return y.side.reaches(w) && may_scatter(z.scattering, -w);
}

}  // namespace ambilux
