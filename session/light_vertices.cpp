#include "session/light_vertices.h"

#include "core/error.h"
#include "core/parallel.h"

namespace ambilux {
namespace {

void append(const ReplaySubpath& subpath, const std::array<double, 3>& origin, LightVertices& to) {
    for (const ReplayVertex& v : subpath.vertices) {
        if (v.miss) continue;
        to.positions.push_back({origin[0] + double(v.p.x), origin[1] + double(v.p.y), origin[2] + double(v.p.z)});
        to.normals.push_back(v.ns);
        to.directions.push_back(v.direction);
        to.throughputs.push_back(v.throughput);
        to.depths.push_back(v.depth);
        to.subpaths.push_back(subpath.number);
        to.shapes.push_back(v.shape);
        to.connectible.push_back(v.smooth);
    }
}

}  // namespace

LightVertices light_vertices(const Replay& replay, const Scene& scene, uint32_t sample) {
    std::vector<ReplaySubpath> subpaths(replay.light_subpaths());
    if (subpaths.empty())
        throw Error(ExitCode::usage, "light vertices: no strategy of this render needs light subpaths");
    const auto trace = [&](uint32_t number) {
        std::vector<ReplayCandidate> splats;
        if (replay.has_light_subpath(number)) subpaths[number] = replay.light_subpath(number, sample, true, splats);
    };
    parallel_for(uint32_t(subpaths.size()), trace, 64u);
    LightVertices all;
    for (uint32_t number = 0; number < subpaths.size(); ++number) {
        all.subpath_count += replay.has_light_subpath(number);
        append(subpaths[number], scene.origin, all);
    }
    return all;
}

}  // namespace ambilux
