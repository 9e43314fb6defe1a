// The cells of learned draws: a pilot traces subpaths, and trees split where their vertices lie.
#pragma once

#include <vector>

#include "accel/host_tracer.h"
#include "integrators/bdpt/learned/draw_tree.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// A vertex of the pilot.
struct PilotPoint {
    float x[6];  ///< position, and the normal on the side of its subpath
};

/// Splits of a tree of `levels` levels whose leaves hold as many of `points` each; DrawTree.
std::vector<DrawSplit> split_points(std::vector<PilotPoint> points, uint32_t levels);

/// What the pilot has found.
struct DrawCells {
    std::vector<DrawSplit> cells, clusters;  ///< DrawTree
    double mean_light_vertices = 0;          ///< of a light subpath that connections may use
    float unit = 1.0f;                       ///< of scores: what connections bring, squared
};

/// Its subpaths belong to no image (integrators/bdpt/shared/pilot.h).
template <Features F>
DrawCells find_draw_cells(const SceneView& scene, const HostTracer& tracer, const Rules<BidirectionalMis>& rules,
                          uint64_t seed, uint32_t cell_levels, uint32_t cluster_levels);

}  // namespace ambilux
