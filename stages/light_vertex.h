// light_shade and connect_camera: vertices of light subpaths.
#pragma once

#include "stages/stage.h"
#include "stages/subpath_numbers.h"
#include "transport/subpath/camera_connection.h"
#include "transport/subpath/visit.h"

namespace ambilux {

/// t = 1 at a light vertex. `Out` takes splat candidates.
template <Features F, class Mis, class Out>
struct ConnectCamera {
    Out splats;
    StageRecord* record;

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& y, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>& numbers) const {
        const Vec4f u = numbers.lens(path.depth);
        Candidate<Mis> c;
        if (camera_connection<F>(scene, rules, y, path.throughput, path.depth, {u.x, u.y}, c) &&
            is_valid_radiance(c.value, record))
            splats.push(pack_candidate(c, slot, F.opacity ? numbers.shadow_seed(path.depth) : 0));
    }
};

/// The same over vertices that wait in a queue.
template <Features F, class Mis, class Out>
struct ConnectCameraQueue {
    static constexpr const char* kName = "connect_camera";

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<VertexItem<Mis>> vertices;
    ConnectCamera<F, Mis, Out> connect;
    StageRecord* record;

    const Queue<VertexItem<Mis>>& items() const { return vertices; }
    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem<Mis> item = load_vertex<F>(vertices, i);
        const SubpathEnd<Mis> end = unpack_end<F>(scene, item);
        Subpath<Mis> path{};
        path.throughput = end.throughput;
        path.depth = end.depth;
        connect.at(scene, rules, end.vertex, path, item.path, light_numbers(rules.mis, wave, item.path));
    }
};

/// Kept for connections, connected with the camera by `AtVertex`, and left again.
template <Features F, class Mis, class AtVertex>
struct LightVertex {
    static constexpr const char* kName = "light_shade";
    using Items = SubpathItems<Mis>;
    using RayItem = typename Items::Ray;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<HitItem<RayItem>> hits;
    Queue<RayItem> rays;
    LightVertices<Mis> vertices;  ///< all vertices of all light subpaths of the wave
    uint32_t* last_vertex;        ///< per slot: to link the vertices of a subpath; null if nobody asks
    AtVertex camera;
    StageRecord* record;

    const Queue<HitItem<RayItem>>& items() const { return hits; }
    AMBILUX_HD bool skips_misses() const { return true; }

    AMBILUX_HD void operator()(uint32_t i) const {
        RayItem next;
        if (step(hit(i), next)) rays.push(next);
    }
    AMBILUX_HD HitItem<RayItem> hit(uint32_t i) const { return hits.load(i); }

    struct Sink {
        const LightVertex& stage;
        uint32_t slot;

        AMBILUX_HD NumbersOf<Mis> numbers() const { return light_numbers(stage.rules.mis, stage.wave, slot); }
        AMBILUX_HD void add(const Candidate<Mis>&) const {}
        AMBILUX_HD void at(const Vertex<Mis>& y, const Subpath<Mis>& path, const NumbersOf<Mis>& numbers) const {
            const Rules<Mis>& rules = stage.rules;
            if (rules.splat && rules.wants(path.depth + 1, 1))
                stage.camera.at(stage.scene, rules, y, path, slot, numbers);
            if (!rules.connect || path.depth + 2 > rules.max_depth) return;
            const uint32_t link = stage.last_vertex ? stage.last_vertex[slot] : kNone;
            const uint32_t place = push_vertex<F>(stage.vertices, pack_connection_vertex(y, path, link));
            if (stage.last_vertex) stage.last_vertex[slot] = place;
        }
        AMBILUX_HD bool valid(Rgb throughput) const { return is_valid_radiance(throughput, stage.record); }
    };

    /// True if the subpath goes on with the ray `next`.
    AMBILUX_HD bool step(const HitItem<RayItem>& h, RayItem& next) const {
        Subpath<Mis> path = Items::unpack(h.ray);
        if (!visit<F>(scene, rules, Side::light, rules.longest(Side::light), h.hit(), path, Sink{*this, h.ray.path}))
            return false;
        next = Items::pack(path, Side::light, h.ray.path, kInfinity);
        return true;
    }
};

}  // namespace ambilux
