// What travels through the queues of light tracing and bidirectional path tracing, but for vertices
// (items/vertex_items.h).
#pragma once

#include "items/path_items.h"
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
    float tmax;         ///< first ray of an eye walk: to the far plane
    float dvcm, dvc;    ///< sums of the ray; first ray of a light walk: LightStart::inv_pdf and direction
    uint32_t extra[2];  ///< first ray of an eye walk: start_distance; of a light walk: LightStart::prim and emitter
};

/// Where that ray ended; `prim == kNone`: nowhere.
struct WalkHit {
    static constexpr uint32_t kPairedLanes = 4;

    WalkItem ray;
    float u, v;
    uint32_t prim;
    uint32_t pad;
};

/// Where the ray of a slot ended (stages/stream.h); `prim == kNone`: nowhere.
struct SlotHit {
    float u, v;
    uint32_t prim;
    uint32_t slot;
};

/// An eye vertex and a vertex of a light walk to be connected.
struct PairItem {
    uint32_t vertex;  ///< place of the eye vertex in the queue of its depth
    uint32_t light;   ///< place of the light vertex
    uint32_t path;
    uint32_t next;  ///< what the pairs of the next launch start from (first_pair); kNone: no pairs are left, or another
                    ///< pair has it
};

/// Light for a place on the film, before it is weighted, and the ray that must be free.
struct SplatCandidate {
    Rgb value;
    uint32_t path;
    Vec3f o;
    float tmax;
    Vec3f d;
    uint32_t alpha_seed;
    Vec2f film;    ///< position in pixels of the full film
    float others;  ///< weight = 1 / (1 + others)
    Strategy strategy;
};

/// Light that arrived on the film.
struct SplatItem {
    Rgb value;
    uint32_t path;
    Vec2f film;
    Strategy strategy;
    float others;  ///< what it was weighted by
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
    WalkItem item = {w.o,          path,       w.d,         WalkBits::make(w.depth, w.delta, w.eta_scale),
                     w.throughput, first_tmax, w.sums.dvcm, w.sums.dvc,
                     {0, 0}};
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

}  // namespace ambilux
