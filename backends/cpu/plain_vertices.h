// Plain vertices of eye subpaths, many side by side: on a host whose processor has vectors for it.
#pragma once

#include "queues/wave.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// Vertices on flat diffuse triangles, and triangles of emitters that they sample. A Vec4f is a vector and a word.
struct alignas(64) PlainVertices {
    static constexpr uint32_t kMost = 64;
    template <class T>
    using Row = T[kMost];

    // Looked up.
    Row<Vec4f> direction;    ///< of the ray; SubpathBits
    Row<Vec4f> throughput;   ///< slot
    Row<Vec4f> place;        ///< barycentrics
    Row<Vec4f> face[4];      ///< Face
    Row<Vec4f> normal[3];    ///< of the vertices; in the first one whether there are any
    Row<Vec4f> reflectance;  ///< whether it is two-sided
    /// Corners and normal of a triangle; or place and distance, its error and the density, normal and whether it is a
    /// delta.
    Row<Vec4f> light[3];
    Row<Vec4f> radiance;  ///< density per area with which points of the triangle are sampled; or chance to meet it
    Row<Vec4f> wi;        ///< of samples
    // Computed.
    Row<float> u_light[4], u_scatter[4];
    Row<uint32_t> seed;     ///< of the shadow ray
    Row<Vec4f> value;       ///< ratio
    Row<Vec4f> origin;      ///< tmax; 0 if there is no candidate
    Row<Vec4f> to_light;    ///< slot
    Row<Vec4f> next_origin;      ///< slot, or kNoPath where the subpath ends
    Row<Vec4f> next_direction;   ///< SubpathBits
    Row<Vec4f> next_throughput;  ///< sum
};

/// False if this machine has no vectors for them.
bool has_plain_lanes();

void plain_numbers(const Wave& wave, PlainVertices& v, uint32_t count);
void plain_seeds(const Wave& wave, PlainVertices& v, uint32_t count);
/// `smooth`: some have vertex normals. `sampled`: emitters are, not places on their triangles.
void plain_next_event(const Rules<UnidirectionalMis>& rules, PlainVertices& v, uint32_t count, bool smooth,
                      bool sampled);
void plain_scatter(const Rules<UnidirectionalMis>& rules, PlainVertices& v, uint32_t count, bool smooth);

}  // namespace ambilux
