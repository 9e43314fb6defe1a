// megakernel: one thread does a slot's light subpath, its eye subpath and all connections, with the functions that the
// stages use. It is a state machine of at most one ray per round, so that lanes of a warp trace together whatever their
// rays are for; lanes whose path has ended begin another (Novak et al. 2010, "Path Regeneration for Interactive Path
// Tracing"). All warps of a block do the same part of a round at a time: a multiprocessor's cache of instructions holds
// a part, not the whole, and warps that were each at another part waited for instructions two thirds of their time
// (docs/lab/2026-11-26-megakernel.md).
#pragma once

#include "core/warp.h"
#include "stages/generate.h"
#include "stages/stage.h"
#include "transport/mis/heuristic.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/visit.h"

namespace ambilux {

/// Where the work of the megakernel is counted: as that of the stages that it stands for.
struct MegakernelRecords {
    StageRecord *light_generate, *light_extend, *light_shade, *connect_camera, *extend, *shade, *connect,
        *connect_vertices, *mis_weight, *occlude;
};

template <Features F, class Tracer, class Mis>
struct Megakernel {
    static constexpr const char* kName = "megakernel";
    static constexpr uint32_t kBeginTogether = 8;  ///< lanes without a path wait for as many before they begin new ones
    static constexpr uint32_t kStepTogether = 256;  ///< threads whose ray has ended wait for as many of their block

    SceneView scene;
    Tracer tracer;
    Wave wave;
    Rules<Mis> rules;
    LightVertices<Mis>
        light_vertices;  ///< memory for the vertices of all light subpaths; used by links, never as a queue
    Queue<SplatItem> splats;
    Lane* samples;
    MegakernelRecords records;
    StageRecord* record;

    /// Does the slots `slot`, `slot + stride` ... below `end`, one after the other.
    AMBILUX_HD void run(uint32_t slot, uint32_t end, uint32_t stride) const {
        const WholeWarp warp;
        const WholeBlock block;
        State s{};
        Counts counts{};
        Hit hit{};
        bool landed = false;  // where the subpath's ray ended is in `hit`
        for (;;) {
            const bool idle = !s.active && slot < end;
            const uint32_t waiting = warp.count(idle), working = warp.count(s.active);
            if (block.count(idle || s.active) == 0) break;
            if (idle && (working == 0 || waiting >= kBeginTogether)) {
                begin(s, slot);
                slot += stride;
            }

            const bool tested = s.testing, extended = !tested && s.going && !landed && !connecting(s);
            Hit nearest = {0.0f, 0.0f, 0.0f, kNone};
            const bool blocked = (tested || extended) && trace(s, nearest, counts);
            if (tested) {
                s.testing = false;
                if (!blocked) arrive(s);
            }
            if (extended) {
                landed = true;
                hit = nearest;
                if (!blocked) hit.prim = kNone;
            }

            const uint32_t steps = block.count(landed), others = block.count(s.active && !landed);
            if (landed && (steps >= kStepTogether || others == 0)) {
                landed = false;
                step(s, hit);
            }

            block.meet();
            if (!s.testing && connecting(s)) connect(s);

            block.meet();
            if (s.active && !s.testing && !s.going && !landed && !connecting(s)) {
                if (s.side == Side::light)
                    begin_eye(s);
                else
                    finish(s);
            }
        }
        add_count(&records.light_extend->items, counts.light_rays);
        add_count(&records.extend->items, counts.eye_rays);
        add_count(&records.occlude->items, counts.shadow_rays);
    }

private:
    /// The vertex of the eye subpath that is being connected. Its surface is looked up for every pair: a thread has no
    /// registers for it.
    struct WaitingVertex {
        Vec3f d;  ///< of the ray that met it
        uint32_t depth;
        float u, v;
        uint32_t prim;
        uint32_t next;  ///< the light vertex to connect next
        Rgb throughput;
        typename Mis::Sums sums;
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

    AMBILUX_HD NumbersOf<Mis> numbers(const State& s) const {
        return {wave.key(s.slot, s.side == Side::light ? Stream::light : Stream::eye)};
    }
    /// A vertex past the capacity was not kept: the wave will be done again.
    AMBILUX_HD bool connecting(const State& s) const { return s.vertex.next < light_vertices.capacity(); }

    AMBILUX_HD void begin(State& s, uint32_t slot) const {
        samples[slot] = {};
        s.active = wave.locate(slot).active;
        if (!s.active) return;
        s.side = Side::light;
        s.slot = slot;
        s.last = s.vertex.next = kNone;
        if (rules.splat || rules.connect) begin_light(s);
    }

    struct LightStart {
        const Megakernel& kernel;
        State& s;
        const NumbersOf<Mis>& numbers;

        AMBILUX_HD bool valid(Rgb flux) const { return is_valid_radiance(flux, kernel.records.light_generate); }
        AMBILUX_HD void add(const Candidate<Mis>& c) const {
            kernel.test(s, c, numbers, 0, kernel.records.light_generate);
        }
    };

    AMBILUX_HD void begin_light(State& s) const {
        const NumbersOf<Mis> d = numbers(s);
        EmissionSample e;
        s.tmax = kInfinity;
        s.going = start_light_subpath<F>(scene, rules, d, LightStart{*this, s, d}, e, s.path);
    }

    AMBILUX_HD void begin_eye(State& s) const {
        s.side = Side::eye;
        const PathSlot p = wave.locate(s.slot);
        s.path = start_eye_subpath<F>(scene, rules.mis, p.x, p.y, numbers(s), s.tmax);
        s.going = true;
        s.sum = {0.0f, 0.0f, 0.0f};
    }

    AMBILUX_HD void finish(State& s) const {
        set_start(samples[s.slot], s.sum);
        s.active = false;
    }

    AMBILUX_HD bool trace(const State& s, Hit& hit, Counts& counts) const {
        ++(s.testing ? counts.shadow_rays : s.side == Side::light ? counts.light_rays : counts.eye_rays);
        Ray ray = s.shadow;
        if (!s.testing) {
            ray = {s.path.origin, s.tmax, s.path.direction, 0};
            if constexpr (F.opacity) ray.alpha_seed = numbers(s).opacity_seed(s.path.depth);
        }
        StageRecord* const tracing = s.testing               ? records.occlude
                                     : s.side == Side::light ? records.light_extend
                                                             : records.extend;
        if (!is_valid_ray(ray.o, ray.d, tracing)) return s.testing;  // its light does not arrive
        return tracer.template trace<F>(scene, ray, s.testing, hit);
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
    AMBILUX_HD void test(State& s, const Candidate<Mis>& c, const NumbersOf<Mis>& d, uint32_t which,
                         StageRecord* maker) const {
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
        const Hit& hit;

        AMBILUX_HD NumbersOf<Mis> numbers() const { return kernel.numbers(s); }
        AMBILUX_HD void add(const Candidate<Mis>& c) const {
            if (!is_valid_radiance(c.value, kernel.records.shade)) return;
            const Rgb weighted = c.value * mis_weight(c.ratio);
            if (is_valid_radiance(weighted, kernel.records.mis_weight)) s.sum += weighted;
        }
        AMBILUX_HD void at(const Vertex<Mis>& x, const Subpath<Mis>& path, const NumbersOf<Mis>& numbers) const {
            kernel.connect_end(s, x, path, hit, numbers);
        }
        AMBILUX_HD bool valid(Rgb throughput) const {
            return is_valid_radiance(throughput,
                                     s.side == Side::light ? kernel.records.light_shade : kernel.records.shade);
        }
    };

    /// Where the ray of the subpath ended. Both sides go through the same code as far as they can.
    AMBILUX_HD void step(State& s, const Hit& hit) const {
        s.tmax = kInfinity;
        s.going = visit<F>(scene, rules, s.side, rules.longest(s.side), hit, s.path, Sink{*this, s, hit});
    }

    /// A vertex and the camera or an emitter; and it is kept, or waits, for connections.
    AMBILUX_HD void connect_end(State& s, const Vertex<Mis>& x, const Subpath<Mis>& path, const Hit& hit,
                                const NumbersOf<Mis>& d) const {
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
            s.vertex = {path.direction, path.depth, hit.u, hit.v, hit.prim, s.last, path.throughput, x.sums};
    }

    /// The eye vertex and the next vertex of the light subpath that is not too far from the light.
    AMBILUX_HD void connect(State& s) const {
        WaitingVertex& z = s.vertex;
        uint32_t place, light_depth;
        do {
            if (!connecting(s)) return;
            place = z.next;
            const ConnectionVertexFront front = light_vertices.items.load_front(place);
            light_depth = front.bits.depth();
            z.next = front.link;
        } while (z.depth + light_depth + 1 > rules.max_depth);
        const SurfacePoint point = surface_at<F>(scene, z.prim, z.u, z.v);
        const SubpathEnd<Mis> eye = {vertex_with<F, Mis>(scene, z.d, z.depth, point, z.sums), z.throughput, z.depth};
        Candidate<Mis> c;
        if (connection<F>(rules, eye, unpack_end<F>(scene, load_vertex<F>(light_vertices, place)), c))
            test(s, c, numbers(s), connection_ray(z.depth, light_depth), records.connect_vertices);
    }
};

}  // namespace ambilux
