#include "integrators/bdpt/learned/cells.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/parallel.h"
#include "integrators/feature_levels.h"
#include "stages/generate.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/visit.h"

namespace ambilux {
namespace {

using Mis = BidirectionalMis;
constexpr uint32_t kSubpaths = 8192;  ///< from the camera, and as many from emitters

/// Keeps the vertices where connections may start.
struct KeepEnds {
    std::vector<SubpathEnd<Mis>>& ends;
    uint32_t max_depth;
    const Draws& subpath_draws;

    Draws draws() const { return subpath_draws; }
    void add(const Candidate<Mis>&) const {}
    void at(const Vertex<Mis>& v, const Subpath<Mis>& path, const Draws&) const {
        if (path.depth + 2 <= max_depth) ends.push_back({v, path.throughput, path.depth});
    }
    bool valid(Rgb) const { return true; }
};

/// Keys of light subpaths come after those of eye subpaths.
template <Features F>
bool start(const SceneView& scene, const Mis& mis, Side side, const Draws& draws, Subpath<Mis>& path) {
    if (side == Side::light) {
        EmissionSample e;
        if (!sample_start<F>(scene, draws, e)) return false;
        path = start_light(mis, e);
        return true;
    }
    const Vec4f u = draws.camera(), pixel = draws.block(0x8000);
    const Sensor& s = scene.sensor;
    const Vec2f at = {float(s.crop_x) + pixel.x * float(s.crop_width),
                      float(s.crop_y) + pixel.y * float(s.crop_height)};
    path = start_eye(scene, mis, sample_camera_ray(s, at, {u.z, u.w}));
    return true;
}

template <Features F>
std::vector<SubpathEnd<Mis>> trace(const SceneView& scene, const HostTracer& tracer, const Rules<Mis>& rules,
                                   uint64_t seed, Side side) {
    std::vector<std::vector<SubpathEnd<Mis>>> ends(kSubpaths);
    parallel_for(
        kSubpaths,
        [&](uint32_t i) {
            const Draws draws = {{seed, side == Side::light ? i : kSubpaths + i, 0, Stream::pilot}};
            Subpath<Mis> path;
            if (!start<F>(scene, rules.mis, side, draws, path)) return;
            Hit hit;
            do {
                const Ray ray = {path.origin, kInfinity, path.direction, draws.opacity_seed(path.depth)};
                tracer.closest<F>(scene, ray, hit);
            } while (visit<F>(scene, rules, side, rules.longest(side), hit, path,
                              KeepEnds{ends[i], rules.max_depth, draws}));
        },
        64u);
    std::vector<SubpathEnd<Mis>> all;
    for (const auto& of_subpath : ends) all.insert(all.end(), of_subpath.begin(), of_subpath.end());
    return all;
}

PilotPoint point_of(const SubpathEnd<Mis>& e) {
    const Scattering& s = e.vertex.scattering;
    const Vec3f p = e.vertex.point.p, n = dot(s.ng, s.wi_world) < 0.0f ? -s.ng : s.ng;
    return {{p.x, p.y, p.z, n.x, n.y, n.z}};
}
std::vector<PilotPoint> points_of(const std::vector<SubpathEnd<Mis>>& ends) {
    std::vector<PilotPoint> points;
    for (const SubpathEnd<Mis>& e : ends) points.push_back(point_of(e));
    return points;
}

/// The axis along which the points lie furthest apart. Opposite normals are as far apart as half the scene.
uint32_t widest(const PilotPoint* begin, const PilotPoint* end, float size) {
    std::array<double, 6> sum{}, squares{};
    for (const PilotPoint* p = begin; p != end; ++p)
        for (int k = 0; k < 6; ++k) sum[k] += p->x[k], squares[k] += double(p->x[k]) * p->x[k];
    const double n = double(end - begin), normal = 0.25 * size;
    uint32_t best = 0;
    double most = -1;
    for (uint32_t k = 0; k < 6; ++k) {
        const double spread = (squares[k] - sum[k] * sum[k] / n) * (k < 3 ? 1.0 : normal * normal);
        if (spread > most) best = k, most = spread;
    }
    return best;
}

void split(std::vector<DrawSplit>& splits, uint32_t at, PilotPoint* begin, PilotPoint* end, float size) {
    if (at >= splits.size()) return;
    if (begin == end) splits[at] = {0.0f, 0};
    PilotPoint* middle = begin + (end - begin) / 2;
    if (begin != end) {
        const uint32_t axis = widest(begin, end, size);
        std::nth_element(begin, middle, end,
                         [axis](const PilotPoint& a, const PilotPoint& b) { return a.x[axis] < b.x[axis]; });
        const float upper = middle->x[axis],
                    lower = middle == begin
                                ? upper
                                : std::max_element(begin, middle, [axis](const PilotPoint& a, const PilotPoint& b) {
                                      return a.x[axis] < b.x[axis];
                                  })->x[axis];
        const float between = lower + (upper - lower) * 0.5f;
        splits[at] = {between > lower ? between : upper, axis};
    }
    split(splits, 2 * at, begin, middle, size);
    split(splits, 2 * at + 1, middle, end, size);
}

/// Connects each eye vertex with one light vertex, of which all are equally likely, and sets unit and gain.
template <Features F>
void measure_pairs(const SceneView& scene, const HostTracer& tracer, const Rules<Mis>& rules,
                   const std::vector<SubpathEnd<Mis>>& eyes, const std::vector<SubpathEnd<Mis>>& lights,
                   DrawCells& found) {
    if (eyes.empty() || lights.empty()) return;
    const auto partner = [&](size_t i) { return i * 7919 % lights.size(); };
    std::vector<float> scores(eyes.size());
    parallel_for(
        eyes.size(),
        [&](size_t i) {
            Candidate<Mis> c;
            if (!connection<F>(rules, eyes[i], lights[partner(i)], c)) return;
            const float score = luminance(c.value) * mis_weight(c.ratio) / luminance(eyes[i].throughput);
            if (!std::isfinite(score) || tracer.occluded<F>(scene, {c.origin, c.tmax, c.direction, uint32_t(i)}))
                return;
            scores[i] = score;
        },
        size_t(64));
    double sum = 0;
    for (const float s : scores) sum += s;
    const double mean = sum / double(eyes.size()) * found.mean_light_vertices;
    if (mean > 1e-15 && mean < 1e15) found.unit = float(mean * mean);

    // Upper levels of the same trees, so that an entry has some pairs.
    const uint32_t cell_levels = 6, cluster_levels = 4, clusters = 1u << cluster_levels;
    const DrawTree cell_tree = {found.cells.data(), cell_levels},
                   cluster_tree = {found.clusters.data(), cluster_levels};
    struct Entry {
        double pairs = 0, squares = 0;
    };
    std::vector<Entry> table(size_t(clusters) << cell_levels);
    const auto leaf = [](const DrawTree& tree, const SubpathEnd<Mis>& e) {
        const PilotPoint x = point_of(e);
        return tree.leaf({x.x[0], x.x[1], x.x[2]}, {x.x[3], x.x[4], x.x[5]});
    };
    for (size_t i = 0; i < eyes.size(); ++i) {
        Entry& e = table[size_t(leaf(cell_tree, eyes[i])) * clusters + leaf(cluster_tree, lights[partner(i)])];
        ++e.pairs;
        e.squares += double(scores[i]) * scores[i];
    }
    double uniform = 0, learned = 0;
    for (size_t row = 0; row < table.size(); row += clusters) {
        double pairs = 0, squares = 0, roots = 0;
        for (uint32_t k = 0; k < clusters; ++k) {
            pairs += table[row + k].pairs;
            squares += table[row + k].squares;
            roots += std::sqrt(table[row + k].squares * table[row + k].pairs);
        }
        if (pairs > 0) uniform += squares, learned += roots * roots / pairs;
    }
    if (learned > 0) found.gain = float(uniform / learned);
}

}  // namespace

std::vector<DrawSplit> split_points(std::vector<PilotPoint> points, uint32_t levels) {
    std::vector<DrawSplit> splits(size_t(1) << levels);
    float size = 0;
    for (int k = 0; k < 3 && !points.empty(); ++k) {
        const auto [low, high] = std::minmax_element(
            points.begin(), points.end(), [k](const PilotPoint& a, const PilotPoint& b) { return a.x[k] < b.x[k]; });
        size = std::max(size, high->x[k] - low->x[k]);
    }
    split(splits, 1, points.data(), points.data() + points.size(), size);
    return splits;
}

template <Features F>
DrawCells find_draw_cells(const SceneView& scene, const HostTracer& tracer, const Rules<Mis>& rules, uint64_t seed,
                          uint32_t cell_levels, uint32_t cluster_levels) {
    const auto lights = trace<F>(scene, tracer, rules, seed, Side::light),
               eyes = trace<F>(scene, tracer, rules, seed, Side::eye);
    DrawCells found;
    found.mean_light_vertices = double(lights.size()) / kSubpaths;
    found.cells = split_points(points_of(eyes), cell_levels);
    found.clusters = split_points(points_of(lights), cluster_levels);
    measure_pairs<F>(scene, tracer, rules, eyes, lights, found);
    return found;
}

#define AMBILUX_LEVEL(F)                                                                                              \
    template DrawCells find_draw_cells<F>(const SceneView&, const HostTracer&, const Rules<Mis>&, uint64_t, uint32_t, \
                                          uint32_t);
AMBILUX_LEVEL(kDiffuseFeatures)
AMBILUX_LEVEL(kFlatFeatures)
AMBILUX_LEVEL(kAllFeatures)
#undef AMBILUX_LEVEL

}  // namespace ambilux
