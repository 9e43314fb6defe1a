// Plain vertices of eye subpaths side by side, for processors with vectors of 16 or 8 floats: what a vertex computes,
// between what is looked up for it and what it pushes (plain_lanes.h).
#pragma once

#include "queues/wave.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// Vertices on diffuse triangles. Rows of four words, three of them a vector: GCC turns these into vectors of 16 lanes
/// with a shuffle for every two loads.
struct alignas(64) PlainVertices {
    static constexpr uint32_t kMost = 64, kWidth = 16;
    template <class T>
    using Row = T[kMost];

    // Looked up. Words of whole numbers are bits of floats.
    Row<Vec4f> direction;    ///< of the ray; SubpathBits
    Row<Vec4f> throughput;   ///< and the slot
    Row<Vec4f> place;        ///< barycentrics; 1 where shading normals are made unit once more (perturbed_normal), or 0
    Row<Vec4f> face[4];      ///< Face
    Row<Vec4f> normal[3];    ///< of the vertices; with the first one 1 if there are any, and 0
    Row<Vec4f> reflectance;  ///< and 1 if it is two-sided, or 0
    // Light: a triangle of an emitter, or a sample of any.
    Row<Vec4f> light[3];  ///< corners and normal; or place and distance, its error and the density, normal and delta
    Row<Vec4f> radiance;  ///< and the density per area of the triangle's points; or the chance to meet the sample
    Row<Vec4f> wi;        ///< of samples

    // Computed.
    Row<float> u_light[4], u_scatter[4];
    Row<uint32_t> shadow_seed;
    Row<Vec4f> value;            ///< of the candidate, and its ratio
    Row<Vec4f> origin;           ///< and tmax; 0 if there is no candidate
    Row<Vec4f> to_light;         ///< and the slot
    Row<Vec4f> next_origin;      ///< and the slot, or kNoPath where the subpath ends
    Row<Vec4f> next_direction;   ///< and SubpathBits
    Row<Vec4f> next_throughput;  ///< and the sum
};

/// False if the compiler or the processor lacks such vectors: all goes one by one.
bool has_plain_lanes();
/// For tests.
inline bool plain_lanes_off = false;

/// Random numbers of the first `count` vertices; here and below a multiple of kWidth.
void plain_numbers(const Wave& wave, PlainVertices& v, uint32_t count);
void plain_shadow_seeds(const Wave& wave, PlainVertices& v, uint32_t count);
/// next_event(). `smooth`: some have vertex normals. `sampled`: light is samples, not triangles.
void plain_next_event(const Rules<UnidirectionalMis>& rules, PlainVertices& v, uint32_t count, bool smooth,
                      bool sampled);
/// scatter().
void plain_scatter(const Rules<UnidirectionalMis>& rules, PlainVertices& v, uint32_t count, bool smooth);

}  // namespace ambilux
