// Eye vertices of path in lanes: plain ones are gathered, computed side by side and pushed; others go one by one.
#pragma once

#include "backends/cpu/plain_vertices.h"
#include "queues/counter.h"
#include "stages/eye_vertex.h"

namespace ambilux {

namespace detail {

/// Vertex stages that have lanes.
template <class Stage>
constexpr bool kHasPlainLanes = false;
template <Features F, class EmissionOut, class Out>
constexpr bool
    kHasPlainLanes<EyeVertex<F, UnidirectionalMis, EmissionOut, Clocked<NextEvent<F, UnidirectionalMis, Out>>>> =
        F.has(BsdfType::diffuse) && F.has(EmitterType::area) && F.has(PrimitiveType::triangle);

template <class Stage>
constexpr Features kFeaturesOf = {};
template <Features F, class Mis, class EmissionOut, class AtVertex>
constexpr Features kFeaturesOf<EyeVertex<F, Mis, EmissionOut, AtVertex>> = F;

}  // namespace detail

/// Runs `Stage` for items one after the other.
template <class Stage>
class PlainLanes {
    static constexpr Features F = detail::kFeaturesOf<Stage>;

public:
    explicit PlainLanes(const Stage& stage) : stage_(stage), depth_(stage.wave.state->depth), on_(suits()), sampled_(!all_plain()) {}

    void add(uint32_t i) {
        if (!on_ || !look_up(i)) return stage_(i);
        items_[count_++] = i;
        if (count_ == PlainVertices::kMost) run();
    }
    void run() {
        if (count_ < kFewest) {
            for (uint32_t k = 0; k < count_; ++k) stage_(items_[k]);
        } else {
            const uint32_t padded = (count_ + kWidth - 1) / kWidth * kWidth;
            plain_numbers(stage_.wave, v_, padded);
            if (stage_.rules.next_event) next_event(padded);
            plain_scatter(stage_.rules, v_, padded, smooth_);
            for (uint32_t k = 0; k < count_; ++k) push(k);
        }
        count_ = 0;
        smooth_ = false;
    }

private:
    static constexpr uint32_t kWidth = 16, kFewest = 4;

    bool suits() const {
        const auto& rules = stage_.rules;
        const SceneView& scene = stage_.scene;
        return has_plain_lanes() && scene.faces && !rules.background_only && depth_ < rules.max_depth &&
               depth_ < rules.longest(Side::eye);
    }
    bool all_plain() const {
        const SceneView& scene = stage_.scene;
        if (scene.emitter_count > 16) return false;
        for (uint32_t e = 0; e < scene.emitter_count; ++e)
            if (!plain(scene.emitters[e])) return false;
        return true;
    }
    /// Triangles of one radiance that every ray meets.
    bool plain(const Emitter& e) const {
        const SceneView& scene = stage_.scene;
        if (e.type != EmitterType::area || e.radiance.texture >= 0) return false;
        const Shape& shape = scene.shapes[e.shape];
        return shape.first_primitive < scene.triangle_count && !scene.materials[shape.material].lets_pass();
    }

    bool look_up(uint32_t i) {
        const auto& hits = stage_.hits.items;
        const SceneView& scene = stage_.scene;
        const HitEnd end = hits.template load_last<HitEnd>(i);
        if (end.prim >= scene.triangle_count) return false;
        const Face& face = scene.faces[end.prim];
        const Shape& shape = scene.shapes[face.shape];
        const Material& material = scene.materials[shape.material];
        const BsdfRecord& record = scene.bsdfs[material.front];
        const ParamRgb& reflectance = record.as<Diffuse>().reflectance;
        if (shape.emitter != kNone || material.front != material.back ||
            material.first != kNone || record.type != BsdfType::diffuse || record.coat != kNone ||
            record.map_rules != 0)
            return false;
        const uint32_t k = count_;
        const auto hit = hits.load(i);
        memcpy(&v_.direction[k], &hit.ray.direction, sizeof(Vec4f));
        v_.throughput[k] = {hit.ray.throughput.x, hit.ray.throughput.y, hit.ray.throughput.z, bits_float(hit.ray.path)};
        v_.place[k] = {end.u, end.v, 0.0f, 0.0f};
        Vec4f rows[4];
        memcpy(rows, &face, sizeof(rows));
        for (int row = 0; row < 4; ++row) v_.face[row][k] = rows[row];
        v_.normal[0][k].w = 0.0f;
        if (shape.flags & kShapeHasNormals) look_up_normals(end.prim, k);
        const Rgb value = F.textures && reflectance.texture >= 0
                              ? eval_rgb<F>(scene, reflectance, surface_at<F>(scene, end.prim, end.u, end.v).uv)
                              : reflectance.value;
        v_.reflectance[k] = {value.x, value.y, value.z, material.two_sided ? 1.0f : 0.0f};
        return true;
    }
    void look_up_normals(uint32_t prim, uint32_t k) {
        const SceneView& scene = stage_.scene;
        const Triangle tri = scene.triangles[prim];
        const uint32_t corners[3] = {tri.v0, tri.v1, tri.v2};
        for (int c = 0; c < 3; ++c) {
            const Vec3f n = scene.vertices[corners[c]].n;
            v_.normal[c][k] = {n.x, n.y, n.z, 1.0f};
        }
        smooth_ = true;
    }
    void look_up_light(uint32_t k) {
        const SceneView& scene = stage_.scene;
        const uint32_t emitter = LightsByPower::pick(scene, {}, {v_.u_light[0][k], 0.0f, 0.0f, 0.0f}).emitter;
        const Emitter& e = scene.emitters[emitter];
        const Shape& shape = scene.shapes[e.shape];
        uint32_t prim = shape.first_primitive;
        if (e.area_cdf != kNone)
            prim += sample_cdf(scene.tables + e.area_cdf, shape.primitive_count, v_.u_light[3][k]);
        Vec4f rows[3];
        memcpy(rows, &scene.faces[prim], sizeof(rows));
        for (int row = 0; row < 3; ++row) v_.light[row][k] = rows[row];
        const Rgb radiance = e.radiance.value;
        v_.radiance[k] = {radiance.x, radiance.y, radiance.z, e.pick_probability * area_pdf_position(scene, e, prim)};
    }

    void sample_light(uint32_t k) {
        const SceneView& scene = stage_.scene;
        Face face;
        Vec4f rows[3];
        for (int row = 0; row < 3; ++row) rows[row] = v_.face[row][k];
        memcpy(&face, rows, sizeof(rows));
        SurfacePoint point;
        detail::place_on_triangle(point, face.p0, face.p1, face.p2, v_.place[k].x, v_.place[k].y);
        EmitterSample s;
        LightsByPower::Pick pick;
        const Vec4f u = {v_.u_light[0][k], v_.u_light[1][k], v_.u_light[2][k], v_.u_light[3][k]};
        v_.light[1][k].w = 0.0f;
        environment_[k] = false;
        if (!sample_emitter_deferred<F>(scene, stage_.rules.lights, {point.p, face.ng}, u, s, pick)) return;
        environment_[k] = is_environment<F>(scene, s.emitter);
        const Rgb radiance = environment_[k] ? splat(1.0f) : s.radiance;
        v_.light[0][k] = {s.p.x, s.p.y, s.p.z, s.distance};
        v_.light[1][k] = {s.p_error.x, s.p_error.y, s.p_error.z, s.pdf_sa};
        v_.light[2][k] = {s.ng.x, s.ng.y, s.ng.z, s.delta ? 1.0f : 0.0f};
        v_.wi[k] = {s.wi.x, s.wi.y, s.wi.z, 0.0f};
        v_.radiance[k] = {radiance.x, radiance.y, radiance.z, F.opacity ? sample_opacity(scene, s) : 1.0f};
    }

    void next_event(uint32_t padded) {
        const auto& inner = stage_.vertices.inner;
        inner.record->count_items(count_, depth_);
        const FusedClock clock(inner.record);
        for (uint32_t k = 0; k < count_; ++k) sampled_ ? sample_light(k) : look_up_light(k);
        plain_next_event(stage_.rules, v_, padded, smooth_, sampled_);
        if (inner.seeds) plain_seeds(stage_.wave, v_, padded);
        for (uint32_t k = 0; k < count_; ++k) {
            const Vec4f value = v_.value[k], origin = v_.origin[k], direction = v_.to_light[k];
            if (!(origin.w > 0.0f)) continue;
            const CandidateItem c = {{value.x, value.y, value.z},
                                     float_bits(direction.w),
                                     {origin.x, origin.y, origin.z},
                                     sampled_ && environment_[k] ? kTowardsEnvironment : origin.w,
                                     {direction.x, direction.y, direction.z},
                                     inner.seeds ? v_.seed[k] : 0,
                                     {},
                                     value.w,
                                     Strategy::make(1, depth_ + 1)};
            if (is_valid_radiance(c.value, inner.record)) inner.candidates.push(c);
        }
    }
    void push(uint32_t k) {
        if (float_bits(v_.next_origin[k].w) == kNoPath) return;
        const Vec4f rows[3] = {v_.next_origin[k], v_.next_direction[k], v_.next_throughput[k]};
        typename Stage::RayItem ray;
        static_assert(sizeof(ray) == sizeof(rows));
        memcpy(&ray, rows, sizeof(ray));
        if (is_valid_radiance(ray.throughput, stage_.record)) stage_.rays.push(ray);
    }

    const Stage& stage_;
    const uint32_t depth_;
    const bool on_, sampled_;
    uint32_t count_ = 0;
    bool smooth_ = false;
    uint32_t items_[PlainVertices::kMost];
    bool environment_[PlainVertices::kMost];
    PlainVertices v_ = {};
};

}  // namespace ambilux
