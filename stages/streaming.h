// Stages of streaming bidirectional path tracing (van Antwerpen 2011, "Improving SIMD Efficiency for Parallel Monte
// Carlo Light Transport on the GPU"): of either subpath only the last vertex is in memory, so that memory depends on
// the number of slots alone. An eye subpath waits at each of its vertices while a light subpath, made for this vertex,
// is connected with it vertex by vertex; then it goes on. A slot whose eye subpath has ended starts the next path. The
// first light subpath of a path also meets the camera (t = 1).
#pragma once

#include "stages/connect_vertices.h"
#include "stages/eye_vertex.h"
#include "stages/generate.h"
#include "stages/light_vertex.h"
#include "stages/order_keys.h"

namespace ambilux {

/// Marks the rays of light subpaths in SubpathRay::path.
constexpr uint32_t kLightRay = 0x80000000u;

/// The slots, and what each of them keeps. A slot goes on with whichever path is next when it is done with one, so that
/// all are at work until there are no more.
template <Features F, class Mis>
struct StreamPool {
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<SubpathRay<Mis>> rays;           ///< by slot: of its eye subpath or of the light subpath for it
    LaneArray<ConnectionVertex<Mis>> eye;  ///< by slot: the vertex that the light subpath is for; its path is kNoPath
                                           ///< if it is for the camera only
    LaneArray<SubpathRay<Mis>> pending;    ///< by slot: the ray with which the eye subpath goes on; depth 0: it has
                                           ///< ended
    Lane* samples;                         ///< per path
    uint32_t* next_path;                   ///< of the wave, that no slot has claimed

    /// Random numbers of the light subpath for an eye vertex: another one for each depth.
    AMBILUX_HD NumbersOf<Mis> light_numbers(uint32_t path, const ConnectionVertexFront& vertex) const {
        return {wave.key(path, Stream::light), vertex.bits.depth() - 1};
    }
    /// The hit of a slot's ray, and whose it is.
    AMBILUX_HD HitItem<SubpathRay<Mis>> hit_of(const SlotHit& end) const {
        HitItem<SubpathRay<Mis>> h = {rays.load(end.slot), end.u, end.v, end.prim, 0};
        h.ray.path &= ~kLightRay;
        return h;
    }
    /// Starts `path`, or the next that has a pixel.
    AMBILUX_HD void begin(uint32_t slot, uint32_t path) const {
        const uint32_t paths = wave.tiles * kTilePixels * wave.state->samples;
        for (; path < paths; path = allocate_slot(next_path)) {
            samples[path] = {};
            const PathSlot p = wave.locate(path);
            if (!p.active) continue;
            float tmax;
            const auto first = start_eye_subpath<F>(scene, rules.mis, p.x, p.y, {wave.key(p)}, tmax);
            rays.put(slot, Items::pack(first, Side::eye, path, tmax));
            return;
        }
    }
    /// The light subpath of a slot has ended.
    AMBILUX_HD void advance(uint32_t slot) const {
        const SubpathRay<Mis> next = pending.load(slot);
        if (next.bits.depth() > 0)
            rays.put(slot, next);
        else
            begin(slot, allocate_slot(next_path));
    }
};

template <Features F, class Mis>
struct StreamBegin {
    static constexpr const char* kName = "generate";

    StreamPool<F, Mis> pool;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const { pool.begin(slot, slot); }
};

/// extend of eye rays and light rays together. Every ray has a hit, misses too: their slots have to go on.
template <Features F, class Tracer, class Mis>
struct StreamExtend {
    static constexpr const char* kName = "extend";
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;

    SceneView scene;
    Tracer tracer;
    StreamPool<F, Mis> pool;
    Queue<SlotHit> eye_hits, light_hits;
    StageRecord* record;

    const Queue<SubpathRay<Mis>>& items() const { return pool.rays; }

    AMBILUX_HD bool fetch(uint32_t slot, Ray& ray) const {
        const SubpathRay<Mis> item = pool.rays.load(slot);
        ray = {item.origin, StreamPool<F, Mis>::Items::tmax(item), item.direction, 0};
        if constexpr (F.opacity) {
            const uint32_t path = item.path & ~kLightRay;
            const NumbersOf<Mis> numbers = item.path & kLightRay ? pool.light_numbers(path, pool.eye.load_front(slot))
                                                                 : NumbersOf<Mis>{pool.wave.key(path)};
            ray.alpha_seed = numbers.opacity_seed(item.bits.depth());
        }
        if (is_valid_ray(item.origin, item.direction, record)) return true;
        finish(slot, {ray.tmax, 0.0f, 0.0f, kNone});
        return false;
    }
    AMBILUX_HD void finish(uint32_t slot, const Hit& hit) const {
        // Not one push to either of two queues: lanes that push together share a counter (allocate_slot).
        if (pool.rays.load(slot).path & kLightRay)
            light_hits.push({hit.u, hit.v, hit.prim, slot});
        else
            eye_hits.push({hit.u, hit.v, hit.prim, slot});
    }
    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (!fetch(slot, ray)) return;
        Hit hit;
        tracer.template closest<F>(scene, ray, hit);
        finish(slot, hit);
    }
};

/// A slot whose eye subpath has come to a vertex or to its end.
struct TurnItem {
    uint32_t path;
    uint32_t slot;
    uint32_t light_subpath;  ///< 1: a light subpath is wanted before the eye subpath goes on
    uint32_t pad;
};

/// An eye vertex waits: for connect_emitter in a queue, for its light subpath at its slot.
template <Features F, class Mis, class EmissionOut>
struct StreamEyeVertex {
    static constexpr const char* kName = "shade";

    StreamPool<F, Mis> pool;
    Queue<SlotHit> hits;
    EmissionOut emission;
    Queue<VertexItem<Mis>> vertices;
    Queue<TurnItem> turns;
    StageRecord* record;

    const Queue<SlotHit>& items() const { return hits; }

    struct Sink {
        const StreamEyeVertex& stage;
        uint32_t path;
        ConnectionVertex<Mis>& waiting;
        bool& connects;

        AMBILUX_HD NumbersOf<Mis> numbers() const { return {stage.pool.wave.key(path)}; }
        AMBILUX_HD void add(const Candidate<Mis>& c) const {
            if (is_valid_radiance(c.value, stage.record))
                stage.emission.push(EmissionItem{c.value, path, c.ratio, c.strategy, {}});
        }
        AMBILUX_HD void at(const Vertex<Mis>& z, const Subpath<Mis>& s, const NumbersOf<Mis>&) const {
            const Rules<Mis>& rules = stage.pool.rules;
            if (rules.next_event) push_vertex<F>(stage.vertices, pack_vertex(z, s, path));
            connects = rules.connect && s.depth + 2 <= rules.max_depth;
            if (connects) waiting = pack_connection_vertex(z, s, path);
        }
        AMBILUX_HD bool valid(Rgb throughput) const { return is_valid_radiance(throughput, stage.record); }
    };

    AMBILUX_HD void operator()(uint32_t i) const {
        const SlotHit end = hits.load(i);
        const HitItem<SubpathRay<Mis>> h = pool.hit_of(end);
        const Rules<Mis>& rules = pool.rules;
        const uint32_t depth = h.ray.bits.depth();
        ConnectionVertex<Mis> vertex = {};
        vertex.front.bits = {depth};
        vertex.front.link = kNoPath;
        bool connects = false;
        Subpath<Mis> path = StreamPool<F, Mis>::Items::unpack(h.ray);
        SubpathRay<Mis> next = {};  // depth 0
        if (visit<F>(pool.scene, rules, Side::eye, rules.longest(Side::eye), h.hit(), path,
                     Sink{*this, h.ray.path, vertex, connects}))
            next = StreamPool<F, Mis>::Items::pack(path, Side::eye, h.ray.path, kInfinity);
        pool.pending.store(end.slot, next);
        pool.eye.store(end.slot, vertex, lanes_of<F>(vertex));
        turns.push({h.ray.path, end.slot, connects || (rules.splat && depth == 1) ? 1u : 0u, 0});
    }
};

/// light_generate: starts the light subpath for an eye vertex, or lets the eye subpath go on at once.
template <Features F, class Mis, class Splats>
struct StreamTurn {
    static constexpr const char* kName = "light_generate";

    StreamPool<F, Mis> pool;
    Queue<TurnItem> turns;
    Splats splats;
    StageRecord* record;

    const Queue<TurnItem>& items() const { return turns; }

    AMBILUX_HD void operator()(uint32_t i) const {
        const TurnItem turn = turns.load(i);
        Subpath<Mis> path;
        if (turn.light_subpath && start(turn, path))
            pool.rays.put(turn.slot,
                          StreamPool<F, Mis>::Items::pack(path, Side::light, turn.path | kLightRay, kInfinity));
        else
            pool.advance(turn.slot);
    }

private:
    AMBILUX_HD bool start(const TurnItem& turn, Subpath<Mis>& path) const {
        const NumbersOf<Mis> numbers = pool.light_numbers(turn.path, pool.eye.load_front(turn.slot));
        EmissionSample e;
        return start_light_subpath<F>(pool.scene, pool.rules, numbers,
                                      LightStartSink<F, Mis, Splats>{splats, turn.path, numbers, record}, e, path);
    }
};

/// light_shade: a light vertex, for the camera and for the eye vertex that waits.
template <Features F, class Mis>
struct StreamLightVertex {
    static constexpr const char* kName = "light_shade";

    StreamPool<F, Mis> pool;
    Queue<SlotHit> hits;
    Queue<VertexItem<Mis>> camera_vertices;
    Queue<ConnectionVertex<Mis>> pairs;  ///< light vertices, whose `link` is the slot of the eye vertex
    StageRecord* record;

    const Queue<SlotHit>& items() const { return hits; }

    struct Sink {
        const StreamLightVertex& stage;
        const ConnectionVertexFront& eye;
        const NumbersOf<Mis>& subpath_numbers;
        bool splat;
        uint32_t slot, path;

        AMBILUX_HD NumbersOf<Mis> numbers() const { return subpath_numbers; }
        AMBILUX_HD void add(const Candidate<Mis>&) const {}
        AMBILUX_HD void at(const Vertex<Mis>& y, const Subpath<Mis>& s, const NumbersOf<Mis>&) const {
            if (splat && stage.pool.rules.wants(s.depth + 1, 1))
                push_vertex<F>(stage.camera_vertices, pack_vertex(y, s, path));
            if (eye.link != kNoPath && s.depth + eye.bits.depth() + 1 <= stage.pool.rules.max_depth &&
                may_connect(eye, y))
                push_vertex<F>(stage.pairs, pack_connection_vertex(y, s, slot));
        }
        AMBILUX_HD bool valid(Rgb throughput) const { return is_valid_radiance(throughput, stage.record); }
    };

    AMBILUX_HD void operator()(uint32_t i) const {
        const SlotHit end = hits.load(i);
        if (end.prim == kNone) return pool.advance(end.slot);
        const HitItem<SubpathRay<Mis>> h = pool.hit_of(end);
        const Rules<Mis>& rules = pool.rules;
        const ConnectionVertexFront eye = pool.eye.load_front(end.slot);
        const NumbersOf<Mis> numbers = pool.light_numbers(h.ray.path, eye);
        const bool splat = rules.splat && numbers.number == 0;
        // A path has one segment more than its light subpath, and those of the eye subpath if there is one.
        const uint32_t longest = splat ? rules.max_depth - 1 : rules.max_depth - 1 - eye.bits.depth();
        Subpath<Mis> path = StreamPool<F, Mis>::Items::unpack(h.ray);
        if (!visit<F>(pool.scene, rules, Side::light, longest, h.hit(), path,
                      Sink{*this, eye, numbers, splat, end.slot, h.ray.path}))
            return pool.advance(end.slot);
        pool.rays.put(end.slot, StreamPool<F, Mis>::Items::pack(path, Side::light, h.ray.path | kLightRay, kInfinity));
    }
};

/// connect_vertices: a light vertex and the eye vertex that waits for it. `Out` takes candidates.
template <Features F, class Mis, class Out>
struct StreamConnect {
    static constexpr const char* kName = "connect_vertices";
    using Item = ConnectionVertex<Mis>;

    StreamPool<F, Mis> pool;
    Queue<ConnectionVertex<Mis>> pairs;
    LightVertexSource<Mis> source;
    Out candidates;
    StageRecord* record;
    bool seeds;

    const Queue<ConnectionVertex<Mis>>& items() const { return pairs; }

    AMBILUX_HD void operator()(uint32_t i) const {
        const Item light = load_vertex<F>(pairs, i);
        const uint32_t slot = light.front.link;
        Item eye = pool.eye.load(slot, Item::kDiffuseLanes);
        if constexpr (Item::template lanes<F>() > Item::kDiffuseLanes)
            if (!eye.bits().template diffuse<F>())
                pool.eye.load_more(slot, eye, Item::kDiffuseLanes, Item::template lanes<F>());
        push_connection<F>(pool.scene, pool.rules, source, *pool.wave.state, NumbersOf<Mis>{pool.wave.key(eye.path())},
                           unpack_end<F>(pool.scene, eye), eye.path(), light, kNone, seeds, candidates, record);
    }
};

}  // namespace ambilux
