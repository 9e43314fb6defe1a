// megakernel: one thread does a slot's light subpath, its eye subpath and all connections, with the functions that the
// stages use. It is a state machine that asks for one ray at a time, whatever the ray is for; a thread whose path has
// ended begins another (Novak et al. 2010, "Path Regeneration for Interactive Path Tracing"). Who traces the rays, and
// which lanes of a warp go on together, is the backend's matter: run() on a host, a persistent traversal on a device
// (backends/cuda/megakernel_loop.cuh).
#pragma once

#include "stages/generate.h"
#include "stages/stage.h"
#include "transport/mis/heuristic.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/visit.h"

namespace ambilux {

/// Where the work of the megakernel is counted: as that of the stages that it stands for.
struct MegakernelRecords {
    StageRecord *light_generate, *light_extend, *light_shade, *connect_camera, *extend, *shade, *connect,
        *connect_vertices, *mis_weight, *occlude;
};

template <Features F, class Tracer>
struct Megakernel {
    static constexpr const char* kName = "megakernel";
    static constexpr Features kFeatures = F;
    using Mis = BidirectionalMis;

    SceneView scene;
    Tracer tracer;
    Wave wave;
    Rules<Mis> rules;
    LightVertices light_vertices;  ///< memory for the vertices of all light subpaths; used by links, never as a queue
    Queue<SplatItem> splats;
    Lane* samples;
    MegakernelRecords records;
    StageRecord* record;

    /// The vertex of the eye subpath that is being connected, as it is: textures are not looked up for every pair.
    struct WaitingVertex {
        VertexItem item;
        uint32_t next;  ///< the light vertex to connect next
    };

    /// What a thread works on. Its next ray is the shadow ray if there is one, else, when the vertex has no connections
    /// left, that of the subpath.
    struct State {
        bool active;
        bool going;    ///< the subpath goes on
        bool testing;  ///< there is a shadow ray
        Side side;
        uint32_t slot;
        uint32_t last;  ///< vertex of the light subpath
        Subpath<Mis> path;
        float tmax;  ///< of the subpath's ray
        WaitingVertex vertex;
        Ray shadow;
        Rgb value;   ///< arrives if the shadow ray is free:
        Vec2f film;  ///< there, from a light subpath
        Rgb sum;     ///< of the eye subpath
    };

    struct Counts {
        uint32_t light_rays, eye_rays, shadow_rays;
    };

    /// What a thread with a path does next.
    enum class Want : uint32_t { ray, connection, turn };

    /// Does the slots `slot`, `slot + stride` ... below `end`, one after the other.
    AMBILUX_HD void run(uint32_t slot, uint32_t end, uint32_t stride) const {
        State s{};
        Counts counts{};
        while (s.active || slot < end) {
            if (!s.active) {
                begin(s, slot);
                slot += stride;
            } else if (const Want want = wants(s); want == Want::ray) {
                Ray ray;
                Hit hit = {0.0f, 0.0f, 0.0f, kNone};
                bool met = s.testing;
                if (next_ray(s, ray, counts)) met = tracer.template trace<F>(scene, ray, s.testing, hit);
                answer(s, met, hit);
            } else if (want == Want::connection) {
                connect(s);
            } else {
                turn(s);
            }
        }
        add(counts);
    }

    AMBILUX_HD void add(const Counts& counts) const {
        add_count(&records.light_extend->items, counts.light_rays);
        add_count(&records.extend->items, counts.eye_rays);
        add_count(&records.occlude->items, counts.shadow_rays);
    }

    AMBILUX_HD Want wants(const State& s) const {
        if (s.testing) return Want::ray;
        if (connecting(s)) return Want::connection;
        return s.going ? Want::ray : Want::turn;
    }
    /// The ray that is wanted. False if it cannot be traced: it counts as blocked, or as a miss.
    AMBILUX_HD bool next_ray(const State& s, Ray& ray, Counts& counts) const {
        ++(s.testing ? counts.shadow_rays : s.side == Side::light ? counts.light_rays : counts.eye_rays);
        ray = s.shadow;
        if (!s.testing) {
            ray = {s.path.origin, s.tmax, s.path.direction, 0};
            if constexpr (F.opacity) ray.alpha_seed = draws(s).opacity_seed(s.path.depth);
        }
        StageRecord* const tracing = s.testing               ? records.occlude
                                     : s.side == Side::light ? records.light_extend
                                                             : records.extend;
        return is_valid_ray(ray.o, ray.d, tracing);
    }
    /// Of the ray that was wanted: whether it met anything, and what, if it is not a shadow ray.
    AMBILUX_HD void answer(State& s, bool met, Hit hit) const {
        if (s.testing) {
            s.testing = false;
            if (!met) arrive(s);
            return;
        }
        if (!met) hit.prim = kNone;
        step(s, hit);
    }
    /// A subpath has ended: the eye subpath begins, or the sample is complete.
    AMBILUX_HD void turn(State& s) const {
        if (s.side == Side::light)
            begin_eye(s);
        else
            finish(s);
    }

    AMBILUX_HD void begin(State& s, uint32_t slot) const {
        samples[slot] = {};
        s.active = wave.locate(slot).active;
        if (!s.active) return;
        s.side = Side::light;
        s.slot = slot;
        s.last = s.vertex.next = kNone;
        if (rules.splat || rules.connect) begin_light(s);
    }

    /// The eye vertex and the next vertex of the light subpath that is not too far from the light.
    AMBILUX_HD void connect(State& s) const {
        const uint32_t depth = s.vertex.item.bits().depth();
        uint32_t place, light_depth;
        do {
            if (!connecting(s)) return;
            place = s.vertex.next;
            const ConnectionVertexFront front = light_vertices.items.load_front(place);
            light_depth = front.bits.depth();
            s.vertex.next = front.link;
        } while (depth + light_depth + 1 > rules.max_depth);
        const BidirectionalEnd eye = unpack_end<F, Mis>(scene, s.vertex.item);
        Candidate<Mis> c;
        if (connection<F>(rules, eye, unpack_end<F>(scene, load_vertex<F>(light_vertices, place)), c))
            test(s, c, draws(s), connection_ray(depth, light_depth), records.connect_vertices);
    }

private:
    AMBILUX_HD Draws draws(const State& s) const {
        return {wave.key(s.slot, s.side == Side::light ? Stream::light : Stream::eye)};
    }
    /// A vertex past the capacity was not kept: the wave will be done again.
    AMBILUX_HD bool connecting(const State& s) const { return s.vertex.next < light_vertices.capacity(); }

    AMBILUX_HD void begin_light(State& s) const {
        const Draws d = draws(s);
        EmissionSample e;
        if (!sample_start<F>(scene, d, e)) return;
        s.path = start_light(rules.mis, e);
        s.tmax = kInfinity;
        if (!is_valid_radiance(s.path.throughput, records.light_generate)) return;
        const Vec4f u = d.emission_direction();
        Candidate<Mis> c;
        if (visible_emitter(scene, rules, e, {u.z, u.w}, c)) test(s, c, d, 0, records.light_generate);
        s.going = rules.max_depth >= 2;
    }

    AMBILUX_HD void begin_eye(State& s) const {
        s.side = Side::eye;
        const CameraSample camera = camera_sample(scene, wave.locate(s.slot), draws(s));
        s.path = start_eye(scene, rules.mis, camera);
        s.tmax = camera.tmax;
        s.going = true;
        s.sum = {0.0f, 0.0f, 0.0f};
    }

    AMBILUX_HD void finish(State& s) const {
        set_start(samples[s.slot], s.sum);
        s.active = false;
    }

    AMBILUX_HD void arrive(State& s) const {
        if (s.side == Side::eye) {
            s.sum += s.value;
        } else {
            const SplatItem item = {s.value, s.slot, s.film, Strategy::make(0, 0), 0.0f};
            splats.push(item);
        }
    }

    /// The candidate, weighted, asks for a shadow ray.
    AMBILUX_HD void test(State& s, const Candidate<Mis>& c, const Draws& d, uint32_t which, StageRecord* maker) const {
        if (!is_valid_radiance(c.value, maker)) return;
        s.value = c.value * mis_weight(c.ratio);
        if (!is_valid_radiance(s.value, records.mis_weight) || is_zero(s.value)) return;
        s.film = c.film;
        s.shadow = {c.origin, c.tmax, c.direction, F.opacity ? d.shadow_seed(which) : 0};
        s.testing = true;
    }

    struct Sink {
        const Megakernel& kernel;
        State& s;

        AMBILUX_HD Draws draws() const { return kernel.draws(s); }
        AMBILUX_HD void add(const Candidate<Mis>& c) const {
            if (!is_valid_radiance(c.value, kernel.records.shade)) return;
            const Rgb weighted = c.value * mis_weight(c.ratio);
            if (is_valid_radiance(weighted, kernel.records.mis_weight)) s.sum += weighted;
        }
        AMBILUX_HD void at(const BidirectionalVertex& x, const Subpath<Mis>& path, const Draws& draws) const {
            kernel.connect_end(s, x, path, draws);
        }
        AMBILUX_HD bool valid(Rgb throughput) const {
            return is_valid_radiance(throughput,
                                     s.side == Side::light ? kernel.records.light_shade : kernel.records.shade);
        }
    };

    /// Where the ray of the subpath ended. Both sides go through the same code as far as they can.
    AMBILUX_HD void step(State& s, const Hit& hit) const {
        s.tmax = kInfinity;
        s.going = visit<F>(scene, rules, s.side, rules.longest(s.side), hit, s.path, Sink{*this, s});
    }

    /// A vertex and the camera or an emitter; and it is kept, or waits, for connections.
    AMBILUX_HD void connect_end(State& s, const BidirectionalVertex& x, const Subpath<Mis>& path,
                                const Draws& d) const {
        const bool light = s.side == Side::light;
        Candidate<Mis> c;
        c.environment = false;
        const Vec4f u = light ? d.lens(path.depth) : d.next_event(path.depth);
        const bool made = light ? camera_connection<F>(scene, rules, x, path.throughput, path.depth, {u.x, u.y}, c)
                                : next_event<F>(scene, rules, x, path.throughput, path.depth, u, c);
        if (made) {
            if (c.environment) c.value *= environment_radiance<F>(scene, c.direction);
            test(s, c, d, path.depth, light ? records.connect_camera : records.connect);
        }
        if (!rules.connect || path.depth + 2 > rules.max_depth) return;
        if (light)
            s.last = push_vertex<F>(light_vertices, pack_connection_vertex(x, path, s.last));
        else
            s.vertex = {pack_vertex(x, path, s.slot), s.last};
    }
};

}  // namespace ambilux
