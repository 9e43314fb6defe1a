// Eye vertices of path in lanes: plain ones are gathered, computed side by side and pushed; others go one by one.
#pragma once

#include "backends/cpu/connection_lanes.h"
#include "backends/cpu/executor.h"
#include "backends/cpu/plain_vertices.h"
#include "queues/counter.h"
#include "stages/eye_vertex.h"

namespace ambilux {

template <class Stage>
class PlainLanes;

/// Vertex stages that have lanes, and their features.
template <class Stage>
struct PlainLanesOf : NoLanes<Stage> {};
template <Features F, class EmissionOut, class Out>
struct PlainLanesOf<EyeVertex<F, UnidirectionalMis, EmissionOut, Clocked<NextEvent<F, UnidirectionalMis, Out>>>> {
    static constexpr bool kHas = F.has(BsdfType::diffuse) && F.has(PrimitiveType::triangle);
    static constexpr Features kFeatures = F;
    using Lanes =
        PlainLanes<EyeVertex<F, UnidirectionalMis, EmissionOut, Clocked<NextEvent<F, UnidirectionalMis, Out>>>>;
};
template <Features F, class EmissionOut, class Out>
struct PlainLanesOf<
    EyeVertex<F, BidirectionalMis, EmissionOut, NextEventAndConnections<F, Out, LightVertexSource<BidirectionalMis>>>> {
    static constexpr bool kHas = F.has(BsdfType::diffuse);
    using Lanes = ConnectionLanes<F, EmissionOut, Out>;
};

/// Runs `Stage` for items one after the other: add() them, and then run().
template <class Stage>
class PlainLanes {
    static constexpr Features F = PlainLanesOf<Stage>::kFeatures;

public:
    explicit PlainLanes(const Stage& stage) : stage_(stage), depth_(stage.wave.state->depth) {
        const auto& rules = stage.rules;
        on_ = has_plain_lanes() && stage.scene.faces && !rules.background_only && depth_ < rules.max_depth &&
              depth_ < rules.longest(Side::eye) && look_at_emitters();
    }

    void add(uint32_t i) {
        if (!on_ || !look_up(i)) return stage_(i);
        items_[count_++] = i;
        if (count_ == PlainVertices::kMost) run();
    }
    void run() {
        if (count_ < kFewest) {
            for (uint32_t k = 0; k < count_; ++k) stage_(items_[k]);
        } else {
            const uint32_t padded = v_.padded(count_);
            plain_numbers(stage_.wave, v_, padded);
            if (stage_.rules.next_event) next_event(padded);
            plain_scatter(stage_.rules, v_, padded, smooth_);
            for (uint32_t k = 0; k < count_; ++k) push_next(k);
        }
        count_ = 0;
        smooth_ = false;
    }

private:
    static constexpr uint32_t kFewest = 4;         ///< vertices that are worth a vector
    static constexpr uint32_t kMostEmitters = 64;  ///< that every launch looks at

    /// False if there are too many, or such as rays meet at random.
    bool look_at_emitters() {
        const SceneView& scene = stage_.scene;
        if (scene.emitter_count > kMostEmitters) return false;
        sampled_ = false;
        for (uint32_t i = 0; i < scene.emitter_count; ++i) {
            const Emitter& e = scene.emitters[i];
            sampled_ |= e.type != EmitterType::area || e.radiance.texture >= 0;
            if (e.type != EmitterType::area) continue;
            const Shape& shape = scene.shapes[e.shape];
            sampled_ |= !scene.is_triangle(shape.first_primitive);
            if (scene.materials[shape.material].lets_pass()) return false;
        }
        return true;
    }

    /// False if the vertex is not plain: a diffuse triangle that emits nothing, the same from both sides.
    bool look_up(uint32_t i) {
        const SceneView& scene = stage_.scene;
        const HitEnd end = stage_.hits.items.template load_last<HitEnd>(i);
        if (end.prim >= scene.triangle_count) return false;
        const Face& face = scene.faces[end.prim];
        const Shape& shape = scene.shapes[face.shape];
        const Material& material = scene.materials[shape.material];
        const BsdfRecord& record = scene.bsdfs[material.front];
        if (shape.emitter != kNone || material.front != material.back || material.first != kNone ||
            record.type != BsdfType::diffuse || record.coat != kNone || record.map_rules)
            return false;
        const uint32_t k = count_;
        const auto ray = stage_.hits.load(i).ray;
        const Rgb r = reflectance(record.as<Diffuse>().reflectance, end);
        Vec4f rows[4];
        memcpy(rows, &face, sizeof(rows));
        for (int row = 0; row < 4; ++row) v_.face[row][k] = rows[row];
        v_.direction[k] = {ray.direction.x, ray.direction.y, ray.direction.z, bits_float(ray.bits.bits)};
        v_.throughput[k] = {ray.throughput.x, ray.throughput.y, ray.throughput.z, bits_float(ray.path)};
        v_.place[k] = {end.u, end.v, float(F.bumps), 0.0f};
        v_.reflectance[k] = {r.x, r.y, r.z, float(material.two_sided)};
        v_.normal[0][k].w = 0.0f;
        if (shape.flags & kShapeHasNormals) look_up_normals(end.prim);
        return true;
    }
    Rgb reflectance(const ParamRgb& parameter, [[maybe_unused]] const HitEnd& end) const {
        if constexpr (F.textures)
            if (parameter.texture >= 0)
                return eval_rgb<F>(stage_.scene, parameter,
                                   detail::face_surface_at(stage_.scene, end.prim, end.u, end.v).uv);
        return parameter.value;
    }
    void look_up_normals(uint32_t prim) {
        const Triangle tri = stage_.scene.triangles[prim];
        const uint32_t corners[3] = {tri.v0, tri.v1, tri.v2};
        for (int c = 0; c < 3; ++c) {
            const Vec3f n = stage_.scene.vertices[corners[c]].n;
            v_.normal[c][count_] = {n.x, n.y, n.z, 1.0f};
        }
        smooth_ = true;
    }

    Vec4f light_numbers(uint32_t k) const {
        return {v_.u_light[0][k], v_.u_light[1][k], v_.u_light[2][k], v_.u_light[3][k]};
    }
    void look_up_light(uint32_t k) {
        const SceneView& scene = stage_.scene;
        const Vec4f u = light_numbers(k);
        const Emitter& e = scene.emitters[LightsByPower::pick(scene, {}, u).emitter];
        const uint32_t prim = area_pick_primitive(scene, e, u.w);
        Vec4f rows[3];
        memcpy(rows, &scene.faces[prim], sizeof(rows));
        for (int row = 0; row < 3; ++row) v_.light[row][k] = rows[row];
        const Rgb radiance = e.radiance.value;
        v_.radiance[k] = {radiance.x, radiance.y, radiance.z, e.pick_probability * area_pdf_position(scene, e, prim)};
    }
    /// Without an environment's radiance, which is looked up when the way is free.
    void sample_light(uint32_t k) {
        const SceneView& scene = stage_.scene;
        const Vec4f rows[4] = {v_.face[0][k], v_.face[1][k], v_.face[2][k], v_.face[3][k]};
        Face face;
        memcpy(&face, rows, sizeof(face));
        SurfacePoint point;
        detail::place_on_triangle(point, face.p0, face.p1, face.p2, v_.place[k].x, v_.place[k].y);
        EmitterSample s;
        LightsByPower::Pick pick;
        v_.light[1][k].w = 0.0f;
        if (!sample_emitter_deferred<F>(scene, stage_.rules.lights, {point.p, face.ng}, light_numbers(k), s, pick))
            return;
        environment_[k] = is_environment<F>(scene, s.emitter);
        const Rgb radiance = environment_[k] ? splat(1.0f) : s.radiance;
        v_.light[0][k] = {s.p.x, s.p.y, s.p.z, s.distance};
        v_.light[1][k] = {s.p_error.x, s.p_error.y, s.p_error.z, s.pdf_sa};
        v_.light[2][k] = {s.ng.x, s.ng.y, s.ng.z, float(s.delta)};
        v_.wi[k] = {s.wi.x, s.wi.y, s.wi.z, 0.0f};
        v_.radiance[k] = {radiance.x, radiance.y, radiance.z, 0.0f};
    }

    void next_event(uint32_t padded) {
        const auto& connect = stage_.vertices.inner;
        connect.record->count_items(count_, depth_);
        const FusedClock clock(connect.record);
        for (uint32_t k = 0; k < count_; ++k) sampled_ ? sample_light(k) : look_up_light(k);
        plain_next_event(stage_.rules, v_, padded, smooth_, sampled_);
        if (connect.seeds) plain_shadow_seeds(stage_.wave, v_, padded);
        for (uint32_t k = 0; k < count_; ++k)
            if (v_.origin[k].w > 0.0f) push_candidate(k, connect.seeds ? v_.shadow_seed[k] : 0);
    }
    void push_candidate(uint32_t k, uint32_t seed) const {
        const auto& connect = stage_.vertices.inner;
        const Vec4f value = v_.value[k], origin = v_.origin[k], direction = v_.to_light[k];
        CandidateItem c = {};
        c.value = {value.x, value.y, value.z};
        c.path = float_bits(direction.w);
        c.origin = {origin.x, origin.y, origin.z};
        c.tmax = sampled_ && environment_[k] ? kTowardsEnvironment : origin.w;
        c.direction = {direction.x, direction.y, direction.z};
        c.opacity_seed = seed;
        c.ratio = value.w;
        c.strategy = Strategy::make(1, depth_ + 1);
        if (is_valid_radiance(c.value, connect.record)) connect.candidates.push(c);
    }
    void push_next(uint32_t k) const {
        const Vec4f rows[3] = {v_.next_origin[k], v_.next_direction[k], v_.next_throughput[k]};
        if (float_bits(rows[0].w) == kNoPath) return;
        typename Stage::RayItem ray;
        static_assert(sizeof(ray) == sizeof(rows));
        memcpy(&ray, rows, sizeof(ray));
        if (is_valid_radiance(ray.throughput, stage_.record)) stage_.rays.push(ray);
    }

    const Stage& stage_;
    const uint32_t depth_;
    bool on_, sampled_ = false, smooth_ = false;
    uint32_t count_ = 0;
    uint32_t items_[PlainVertices::kMost];
    bool environment_[PlainVertices::kMost];
    PlainVertices v_ = {};
};
using CpuLanesExecutor = CpuExecutorWith<PlainLanesOf>;

}  // namespace ambilux
