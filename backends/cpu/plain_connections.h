// Connections of plain diffuse ends side by side: what a pair computes, between what is looked up for it and what it
// pushes (connection_lanes.h).
#pragma once

#include "queues/wave.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// Pairs of an eye vertex and a light vertex, in rows as those of PlainVertices.
struct alignas(64) PlainPairs {
    static constexpr uint32_t kMost = 64, kWidth = 16;
    static constexpr float kNone = -1.0f;
    template <class T>
    using Row = T[kMost];

    // Looked up. Words of whole numbers are bits of floats.
    Row<Vec4f> eye[5];    ///< place, depth; Scattering::ng, offset; frame.n, two sums with direction and throughput
    Row<Vec4f> light[4];  ///< ConnectionVertex

    // Computed.
    Row<Vec4f> value;      ///< of the candidate, and its ratio
    Row<Vec4f> origin;     ///< and tmax; kNone if there is no candidate
    Row<Vec4f> direction;  ///< and 1 if the search finds the light vertex, or 0
};

/// The test of LightVertexSearch::find() and connection() of the first `count` pairs, a multiple of kWidth, where no
/// strategies are single.
void plain_connections(const Rules<BidirectionalMis>& rules, PlainPairs& pairs, uint32_t count);

}  // namespace ambilux
