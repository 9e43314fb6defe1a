// Surfaces that let a share of the rays pass. One rule for closest and any hit and for every tracer.
#pragma once

#include "core/rng.h"
#include "scene/ray.h"
#include "scene/surface.h"
#include "transport/opacity.h"

namespace ambilux {

/// Texture coordinates at (prim,u,v), without the rest of the surface point.
template <Features F>
AMBILUX_HD Vec2f texture_uv(const SceneView& scene, uint32_t prim, float u, float v) {
    if (scene.is_triangle(prim)) {
        const Triangle tri = scene.triangles[prim];
        if (!(scene.shapes[tri.shape].flags & kShapeHasUvs)) return {u, v};
        return scene.vertices[tri.v0].uv() * (1.0f - u - v) + scene.vertices[tri.v1].uv() * u +
               scene.vertices[tri.v2].uv() * v;
    }
    return surface_at<F>(scene, prim, u, v).uv;
}

/// What decides about a crossing beside the ray: its primitive, but a ray crosses spheres and cylinders twice, and the
/// side where it leaves counts as a primitive of its own, numbered after all others.
template <Features F>
AMBILUX_HD uint32_t opacity_id(const SceneView& scene, const Ray& ray, uint32_t prim, float u, float v) {
    if constexpr (F.has_quadrics()) {
        if (!scene.is_triangle(prim)) {
            const Quadric& q = scene.quadric(prim);
            if (q.type == PrimitiveType::disk) return prim;
            const Vec3f outwards =
                q.type == PrimitiveType::sphere ? octahedral_decode({u, v}) : Vec3f{cosf(u), sinf(u), 0.0f};
            if (dot(outwards, q.to_local.vector(ray.d)) > 0.0f)
                return prim + scene.primitive_count() + (F.instances ? scene.instanced_count : 0u);
        }
    }
    return prim;
}

AMBILUX_HD const Material& material_of(const SceneView& scene, uint32_t prim) {
    return scene.materials[scene.shapes[scene.shape_of(prim)].material];
}

/// True if `ray` meets the surface at (prim,u,v) rather than passing through it: opacity > hash(ray, opacity_id), so
/// the answer does not depend on the order in which a tracer visits primitives. `prim` is stored; its id is that and
/// `id_offset`.
template <Features F>
AMBILUX_HD bool accept_hit(const SceneView& scene, const Ray& ray, uint32_t prim, float u, float v,
                           uint32_t id_offset = 0) {
    if constexpr (!F.opacity) {
        return true;
    } else {
        const Material& material = material_of(scene, prim);
        if (!material.lets_pass()) return true;
        const bool textured = F.textures && material.opacity.texture >= 0;
        const Vec2f uv = textured ? texture_uv<F>(scene, prim, u, v) : Vec2f{0.0f, 0.0f};
        return surface_opacity<F>(scene, material, uv) >
               hash_float(ray.alpha_seed, opacity_id<F>(scene, ray, prim, u, v) + id_offset);
    }
}

}  // namespace ambilux
