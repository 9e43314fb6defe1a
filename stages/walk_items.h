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

/// A vertex of a walk to connect.
struct VertexItem {
    static constexpr uint32_t kPairedLanes = 4;

    Vec3f d;           ///< of the ray that met it
    WalkBits bits;
    float u, v;
    uint32_t prim;
    uint32_t next;     ///< of an eye walk: the light vertex to connect next, or the draws from a cache that are left; kNone: nothing
    Rgb throughput;
    uint32_t path;
    float dvcm, dvc;
    uint32_t pad[2];
};

/// To which sides a vertex scatters, and its depth. Of the normal 8 bits of either coordinate of its octahedral map are kept.
struct VertexSide {
    uint32_t bits;

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

/// What tells whether a vertex of a light walk can be connected with a point, and which vertex is next: memory moves 32 bytes at a time, and most pairs need no more.
struct LightVertexFront {
    Vec3f p;
    VertexSide side;
    uint32_t prim;
    uint32_t previous; ///< the vertex before it in the same walk or kNone
    float u, v;
};

/// A vertex of a light walk, kept over a wave for connections.
struct LightVertexItem {
    LightVertexFront front;
    Vec3f d;           ///< of the ray that met it
    Rgb throughput;
    float dvcm, dvc;
};

using LightVertices = Queue<LightVertexItem, LaneOrder::together>;

/// An eye vertex and a vertex of a light walk to be connected.
struct PairItem {
    uint32_t vertex;  ///< place of the eye vertex in the queue of its depth
    uint32_t light;   ///< place of the light vertex
    uint32_t path;
    uint32_t next;    ///< what the pairs of the next launch start from (VertexItem::next); kNone: no pairs are left, or another pair has it
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

/// What became of a walk at a hit: a vertex that connections may use, and the ray with which it goes on.
struct WalkStep {
    VertexItem vertex;
    WalkItem ray;
    bool connectable = false, goes_on = false;
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

AMBILUX_HD uint32_t depth_of(const VertexItem& item) { return item.bits.depth(); }
AMBILUX_HD uint32_t depth_of(const LightVertexItem& item) { return item.front.side.depth(); }

template <Features F>
AMBILUX_HD SurfacePoint surface_of(const SceneView& scene, const VertexItem& item) {
    return surface_at<F>(scene, item.prim, item.u, item.v);
}
template <Features F>
AMBILUX_HD SurfacePoint surface_of(const SceneView& scene, const LightVertexItem& item) {
    return surface_at<F>(scene, item.front.prim, item.front.u, item.front.v);
}
/// The vertex that an item of a walk stands for, which lies at `point`.
template <Features F, class Item>
AMBILUX_HD WalkVertex unpack_vertex(const SceneView& scene, const Item& item, const SurfacePoint& point) {
    return {point, make_scattering<F>(scene, point, -item.d), {item.dvcm, item.dvc}, depth_of(item) == 1};
}
template <Features F, class Item>
AMBILUX_HD WalkVertex unpack_vertex(const SceneView& scene, const Item& item) {
    return unpack_vertex<F>(scene, item, surface_of<F>(scene, item));
}

AMBILUX_HD VertexItem pack_vertex(const WalkHit& hit, const WalkVertex& v) {
    return {hit.ray.d, hit.ray.bits, hit.u, hit.v, hit.prim, kNone, hit.ray.throughput, hit.ray.path, v.sums.dvcm, v.sums.dvc, {0, 0}};
}

/// The vertex `y` of a light walk, met at (prim,u,v) by a ray along `d`, after `previous`.
AMBILUX_HD LightVertexItem pack_light_vertex(const WalkVertex& y, uint32_t prim, float u, float v, Vec3f d, Rgb throughput, uint32_t depth, uint32_t previous) {
    const bool in_front = dot(y.point.ng, d) < 0.0f;
    return {{y.point.p, VertexSide::make(depth, in_front ? y.point.ng : -y.point.ng, bsdf_transmits(y.scattering.bsdf.type)), prim, previous, u, v}, d, throughput, y.sums.dvcm, y.sums.dvc};
}

/// False if no light can pass between the vertex `y` of a light walk and `z`, which a walk came to from `z_wi`: may_connect, in doubt true.
AMBILUX_HD bool may_connect(const SceneView& scene, const LightVertexFront& y, const SurfacePoint& z, Vec3f z_wi) {
    const Vec3f w = z.p - y.p;
    return y.side.reaches(w) && may_scatter(scene, z, z_wi, -w);
}

}  // namespace ambilux
