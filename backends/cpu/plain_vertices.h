// Plain vertices of eye subpaths, and connections of plain ends, side by side, for processors with vectors of 16 or 8
// floats: what is computed between what is looked up and what is pushed (plain_lanes.h, connection_lanes.h).
#pragma once

#include "queues/wave.h"
#include "transport/mis/bidirectional.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// What is side by side. Rows of four words, three of them a vector: GCC turns these into vectors of 16 lanes with a
/// shuffle for every two loads.
struct PlainRows {
    static constexpr uint32_t kMost = 64, kWidth = 16;
    template <class T>
    using Row = T[kMost];

    /// A multiple of kWidth.
    static uint32_t padded(uint32_t count) { return (count + kWidth - 1) / kWidth * kWidth; }
};

/// Vertices on diffuse triangles.
struct alignas(64) PlainVertices : PlainRows {
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

/// An eye vertex and a light vertex each, both ConnectionVertex.
struct alignas(64) PlainPairs : PlainRows {
    Row<Vec4f> eye[4], light[4];

    // Computed.
    Row<Vec4f> value;   ///< of the candidate, and its ratio
    Row<Vec4f> origin;  ///< and tmax; below 0 if there is no candidate
    Row<Vec4f> direction;
};

/// False if the compiler or the processor lacks such vectors: all goes one by one.
bool has_plain_lanes();
/// For tests.
inline bool plain_lanes_off = false;

/// Random numbers of the first `count` vertices; here and below padded.
void plain_numbers(const Wave& wave, PlainVertices& v, uint32_t count);
void plain_shadow_seeds(const Wave& wave, PlainVertices& v, uint32_t count);
/// next_event(). `smooth`: some have vertex normals. `sampled`: light is samples, not triangles.
void plain_next_event(const Rules<UnidirectionalMis>& rules, PlainVertices& v, uint32_t count, bool smooth,
                      bool sampled);
/// scatter().
void plain_scatter(const Rules<UnidirectionalMis>& rules, PlainVertices& v, uint32_t count, bool smooth);
/// connection() of pairs, where no strategies are single.
void plain_connections(const Rules<BidirectionalMis>& rules, PlainPairs& pairs, uint32_t count);

}  // namespace ambilux
