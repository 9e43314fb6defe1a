// The scene as kernels see it: plain records in flat arrays, the same on the host and on a device.
#pragma once

#include "core/float32.h"
#include "core/math.h"
#include "models/features.h"
#include "models/sensor_list.h"

namespace ambilux {

// ---- textures ----

enum class TextureType : uint32_t { bitmap, checkerboard };
enum class TexelFormat : uint32_t {
    rgba8,
    rgba32f,
    rgba16f
};  ///< 4, 16 and 8 bytes per texel; rgba16f: finite halves (core/half.h)
enum class WrapMode : uint32_t { repeat, mirror, clamp };
enum class TextureFilter : uint32_t { nearest, bilinear };

/// 2D texture. (s,t) = to_uv (u,v,1); texel row 0, the top row of an image file, lies at t = 0 (as in Mitsuba 3, whose
/// OBJ loader turns v into 1-v for that; ours does so too).
struct Texture {
    TextureType type;
    TexelFormat format;
    WrapMode wrap;
    TextureFilter filter;
    uint32_t width, height;
    uint64_t offset;        ///< first texel, in bytes from SceneView::texels; a multiple of 16
    uint32_t decode_table;  ///< rgba8: 256 floats in SceneView::tables that turn a byte into a linear value
    float to_uv[2][3];
    Rgb color0, color1;  ///< checkerboard: even and odd cells; one period is the unit square, cells are half of it
};

// ---- surfaces ----

/// Vertex of a mesh in two loads of 16 bytes, so that a surface point reads one line of memory per vertex. World space.
struct alignas(32) MeshVertex {
    Vec3f p;
    float u = 0;
    Vec3f n = {0, 0, 0};  ///< unit; arbitrary where the shape lacks normals
    float v = 0;          ///< (u,v): texture coordinates, arbitrary where the shape lacks them

    AMBILUX_HD Vec2f uv() const { return {u, v}; }
};

/// Triangle: three vertices and the shape it belongs to.
struct Triangle {
    uint32_t v0, v1, v2;
    uint32_t shape;
};

/// What of a triangle is the same at all of its points, in one line of a host's cache.
struct alignas(64) Face {
    Vec3f p0, p1, p2;
    Vec3f ng;    ///< as in SurfacePoint
    Vec3f dpdu;  ///< the same; of a triangle without vertex normals the s axis of its frame (SurfacePoint::framed)
    uint32_t shape;
};

/// Analytic shape. Local forms: unit sphere at the origin; unit disk z = 0, normal +z; cylinder x²+y² = 1, 0 <= z <= 1,
/// normal outwards. `to_world` holds scale (radius, length), rotation and translation; scale is uniform for the
/// sphere, uniform in xy for the cylinder. A disk has any affine map. `flip` reverses the normal.
struct Quadric {
    PrimitiveType type;
    uint32_t shape;
    uint32_t flip;
    float radius;  ///< of sphere and cylinder in world units; a bound of a disk's
    Affine to_world, to_local;
};

enum ShapeFlags : uint32_t {
    kShapeHasNormals = 1,  ///< interpolated vertex normals
    kShapeHasUvs = 2,
};

/// What all primitives of one shape share. Primitives of a shape are consecutive.
struct Shape {
    uint32_t material;
    uint32_t emitter;  ///< index of the emitter on it or kNone
    uint32_t flags;    ///< ShapeFlags
    uint32_t first_primitive, primitive_count;
    float area;  ///< world area
};

/// Triangles that are shown in several places, in coordinates of their own, and the box around them.
struct Group {
    uint32_t first_triangle, triangle_count;
    Vec3f lower, upper;
};

/// A group in one place. Its primitives have ids of their own, from first_id on: behind those of all that is stored.
/// The outside of a surface stays outside of a mirror.
struct alignas(16) Instance {
    Affine to_world, to_group;
    uint32_t group;
    uint32_t first_triangle;  ///< of the group
    uint32_t first_id;
    uint32_t mirrored;

    AMBILUX_HD uint32_t triangle_of(uint32_t prim) const { return prim - first_id + first_triangle; }
};

// ---- materials ----

/// A BSDF with its adapters. `front` is used where the ray comes from the side of the shading normal. When `two_sided`,
/// rays from behind use `back` in a flipped frame; otherwise `back` == `front`, unflipped.
struct Material {
    uint32_t front, back;
    uint32_t two_sided;
    ParamFloat opacity;  ///< mask: chance that a ray meets the surface
    /// Blend: places of the materials that it is made of, or kNone. Points are of the second one with a chance of
    /// `second_weight`; `front` and `back` then stand for what the materials can do (transport/blend.h).
    uint32_t first = kNone, second = kNone;
    ParamFloat second_weight = {0, -1};

    /// False if every ray meets it.
    AMBILUX_HD bool lets_pass() const { return opacity.texture >= 0 || !(opacity.value >= 1.0f); }
    /// True if no ray meets it.
    bool unseen() const { return opacity.texture < 0 && !(opacity.value > 0.0f); }
};

// ---- emitters ----

/// Bucket of the alias table of one row of an environment map, with the densities of both its cells, so that a single
/// load serves sampling and density.
struct alignas(16) EnvironmentCell {
    uint32_t threshold, alias;  ///< as in AliasBucket; the alias is a column
    float32 pdf, alias_pdf;     ///< of the bucket's own cell and of the alias, per unit square of (u,v), the row's
                                ///< probability included
};

/// Emitter. `radiance` holds, in this order of types: radiance, intensity (W/sr), intensity, perpendicular irradiance,
/// radiance, radiance scale, intensity along the axis, power, power per area,
/// radiance.
struct Emitter {
    EmitterType type;
    uint32_t shape;     ///< area, directional_area, hidden_area: its shape
    uint32_t area_cdf;  ///< area over triangles: primitive_count+1 floats in tables, and then the density per area on
                        ///< each; kNone for a single primitive
    float pick_probability;      ///< chance that light sampling picks this emitter
    ParamRgb radiance;           ///< area: textured by surface uv; spot, projector: textured by projection
    Affine to_world, to_local;   ///< spot, projector: +z is the axis; envmap: rotation; point, directional: unused
    Vec3f position;              ///< point, spot, projector, collimated
    Vec3f direction;             ///< directional, collimated: direction in which light travels; spot: axis. Unit
    float one_minus_cos_cutoff;  ///< spot: of the angle where it ends; a cosine would lose the digits of narrow ones
    float cutoff, beam_width;    ///< spot: angles to the axis in radians
                                 ///< projector: tangents of half the field of view along x and y
    // envmap: latitude-longitude image (texture `radiance.texture` of float texels, row 0 is the top, direction +y);
    // its density lies in SceneView::environment_rows and environment_cells
};

// ---- sensor ----

enum class FilterType : uint32_t { box, tent, gaussian };
/// Entries of the inverse cumulative table of a Gaussian reconstruction filter minus one, and of its guide.
constexpr uint32_t kFilterTableSize = 1024;

/// Sensor and film. Film positions are in pixels of the full film, origin at the top left; the image holds the crop.
struct Sensor {
    SensorType type;
    Affine to_world;     ///< camera space: +z is the view direction, +y up, +x LEFT in the image (Mitsuba)
    Vec2f tan_half_fov;  ///< perspective, thin lens: tangent of half the field of view along x and y of the full film
                         ///< orthographic: half of the film's extent in camera units; spherical: 0
    Vec2f principal_offset;                 ///< shift of the principal point as a fraction of the film size
    float near_clip, far_clip;              ///< along the view axis, scene units; spherical: 0 and infinite
    float aperture_radius, focus_distance;  ///< thin lens
    uint32_t film_width, film_height;
    uint32_t crop_x, crop_y, crop_width, crop_height;
    FilterType filter;
    float filter_radius;    ///< pixels
    uint32_t filter_table;  ///< gaussian, in tables: kFilterTableSize+1 offsets in pixels at equal steps of
                            ///< probability, and what finds one of them (transport/sensor/filter.h)
};

/// Materials that hits are told apart by when they are sorted.
constexpr uint32_t kMostSortKeys = 0xfffe;

struct AliasBucket;
struct LightTreeView;

/// Everything a kernel may read. Pointers are host or device memory, as a whole.
struct SceneView {
    const MeshVertex* vertices;
    const Triangle* triangles;
    const Quadric* quadrics;
    const Shape* shapes;
    const Material* materials;
    const BsdfRecord* bsdfs;
    const Texture* textures;
    const uint8_t* texels;
    const uint16_t* sort_keys;  ///< per primitive: its material, kMostSortKeys - 1 at most
    const Emitter* emitters;
    const float32* emitter_cdf;  ///< emitter_count+1 floats: cumulative pick_probability
    const float32* tables;
    // Of an environment map, a piecewise-constant density over width by height cells (transport/emitter/envmap.h):
    const AliasBucket* environment_rows;       ///< alias table of the rows: height buckets
    const EnvironmentCell* environment_cells;  ///< alias table of the cells of each row: height rows of width
    const Face* faces =
        nullptr;  ///< per triangle, on a host that renders; null: made of its vertices wherever asked for
    uint32_t vertex_count, triangle_count, quadric_count, shape_count, material_count, bsdf_count, texture_count,
        emitter_count;
    uint32_t environment;  ///< index of the constant or envmap emitter, or kNone
    Vec3f bounds_center;   ///< bounding sphere of all surfaces (and of the camera position)
    float bounds_radius;
    Sensor sensor;
    // Features::instances only. Triangles of groups lie behind all others.
    const Group* groups;
    const Instance* instances;  ///< first_id ascends
    uint32_t group_count, instance_count;
    uint32_t instanced_count;         ///< primitives of all instances
    const LightTreeView* light_tree;  ///< null: lights are picked by power (scene/light_tree.h)

    /// Primitive ids: 0..triangle_count-1 are triangles, then the quadrics, then those of instances.
    AMBILUX_HD uint32_t primitive_count() const { return triangle_count + quadric_count; }
    AMBILUX_HD bool is_triangle(uint32_t prim) const { return prim < triangle_count; }
    AMBILUX_HD const Quadric& quadric(uint32_t prim) const { return quadrics[prim - triangle_count]; }
    AMBILUX_HD bool is_instanced(uint32_t prim) const { return prim >= primitive_count(); }
    /// Triangles that belong to no group.
    AMBILUX_HD uint32_t ungrouped_count() const { return group_count ? groups[0].first_triangle : triangle_count; }
    /// The instance that primitive `prim` belongs to.
    AMBILUX_HD const Instance& instance_of(uint32_t prim) const {
        uint32_t first = 0, last = instance_count - 1;
        while (first < last) {
            const uint32_t middle = first + (last - first + 1) / 2;
            if (instances[middle].first_id <= prim)
                first = middle;
            else
                last = middle - 1;
        }
        return instances[first];
    }
    /// What is stored of primitive `prim`.
    AMBILUX_HD uint32_t stored(uint32_t prim) const {
        return is_instanced(prim) ? instance_of(prim).triangle_of(prim) : prim;
    }
    AMBILUX_HD uint32_t shape_of(uint32_t prim) const {
        return is_triangle(prim) ? triangles[prim].shape : quadric(prim).shape;
    }
};

}  // namespace ambilux
