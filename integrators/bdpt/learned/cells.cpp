#include "integrators/bdpt/learned/cells.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/parallel.h"
#include "integrators/feature_levels.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/start.h"
#include "transport/subpath/trace.h"

namespace ambilux {
namespace {

using Mis = BidirectionalMis;
constexpr uint32_t kSubpaths = 8192;  ///< from the camera, and as many from emitters
constexpr uint32_t kWhole = 512;      ///< whose ends are kept whole

PilotPoint point_of(const SubpathEnd<Mis>& e) {
    const Scattering& s = e.vertex.scattering;
    const Vec3f p = e.vertex.point.p, n = dot(s.ng, s.wi_world) < 0.0f ? -s.ng : s.ng;
    return {{p.x, p.y, p.z, n.x, n.y, n.z}};
}

/// Vertices where connections may start.
struct Ends {
    std::vector<PilotPoint> points;
    std::vector<SubpathEnd<Mis>> whole;

    void append(const Ends& other) {
        points.insert(points.end(), other.points.begin(), other.points.end());
        whole.insert(whole.end(), other.whole.begin(), other.whole.end());
    }
};

struct KeepEnds {
    Ends& ends;
    bool whole;
    uint32_t max_depth;
    const RandomNumbers& subpath_numbers;

    RandomNumbers numbers() const { return subpath_numbers; }
    void add(const Candidate<Mis>&) const {}
    void at(const Vertex<Mis>& v, const Subpath<Mis>& path, const RandomNumbers&) const {
        if (path.depth + 2 > max_depth) return;
        const SubpathEnd<Mis> end = {v, path.throughput, path.depth};
        ends.points.push_back(point_of(end));
        if (whole) ends.whole.push_back(end);
    }
    bool valid(Rgb) const { return true; }
};

/// Keys of light subpaths come after those of eye subpaths.
template <Features F>
bool start(const SceneView& scene, const Rules<Mis>& rules, Side side, const KeepEnds& sink, Subpath<Mis>& path) {
    const RandomNumbers numbers = sink.numbers();
    EmissionSample e;
    if (side == Side::light) return start_light_subpath<F>(scene, rules, numbers, sink, e, path);
    const Vec4f u = numbers.camera(), pixel = numbers.block(0x8000);
    const Sensor& s = scene.sensor;
    const Vec2f at = {float(s.crop_x) + pixel.x * float(s.crop_width),
                      float(s.crop_y) + pixel.y * float(s.crop_height)};
    path = start_eye<F>(scene, rules.mis, sample_camera_ray<F>(s, at, {u.z, u.w}));
    return true;
}

template <Features F>
Ends trace(const SceneView& scene, const HostTracer& tracer, const Rules<Mis>& rules, uint64_t seed, Side side) {
    std::vector<Ends> ends(kSubpaths);
    parallel_for(
        kSubpaths,
        [&](uint32_t i) {
            const RandomNumbers numbers = {{seed, side == Side::light ? i : kSubpaths + i, 0, Stream::pilot}};
            const KeepEnds sink = {ends[i], i < kWhole, rules.max_depth, numbers};
            Subpath<Mis> first;
            if (!start<F>(scene, rules, side, sink, first)) return;
            trace_subpath<F>(
                scene, rules, side, rules.longest(side), first, kInfinity,
                [&](const auto& path, float tmax) { return end_of_ray<F>(scene, tracer, path, tmax, numbers); }, sink);
        },
        64u);
    Ends all;
    for (const Ends& of_subpath : ends) all.append(of_subpath);
    return all;
}

/// The axis along which the points lie furthest apart. Opposite normals are as far apart as half the scene.
uint32_t widest(const PilotPoint* begin, const PilotPoint* end, float size) {
    std::array<double, 6> sum{}, squares{};
    for (const PilotPoint* p = begin; p != end; ++p)
        for (size_t k = 0; k < sum.size(); ++k) sum[k] += p->x[k], squares[k] += double(p->x[k]) * p->x[k];
    const double n = double(end - begin), normal = 0.25 * size;
    uint32_t best = 0;
    double most = -1;
    for (uint32_t k = 0; k < sum.size(); ++k) {
        const double spread = (squares[k] - sum[k] * sum[k] / n) * (k < 3 ? 1.0 : normal * normal);
        if (spread > most) best = k, most = spread;
    }
    return best;
}

/// Half of the points on either side, but for those with the coordinate of the one in the middle: they stay together.
void split(std::vector<DrawSplit>& splits, uint32_t at, PilotPoint* begin, PilotPoint* end, float size) {
    if (at >= splits.size()) return;
    PilotPoint* middle = begin;
    splits[at] = {0.0f, 0};
    if (begin != end) {
        const uint32_t axis = widest(begin, end, size);
        const auto below = [axis](const PilotPoint& a, const PilotPoint& b) { return a.x[axis] < b.x[axis]; };
        PilotPoint* half = begin + (end - begin) / 2;
        std::nth_element(begin, half, end, below);
        float value = half->x[axis];
        if (value == std::min_element(begin, end, below)->x[axis])
            for (const PilotPoint* p = half; p != end; ++p)
                if (p->x[axis] > half->x[axis] && (value == half->x[axis] || p->x[axis] < value)) value = p->x[axis];
        splits[at] = {value, axis};
        middle = std::partition(begin, end, [&](const PilotPoint& p) { return p.x[axis] < value; });
    }
    split(splits, 2 * at, begin, middle, size);
    split(splits, 2 * at + 1, middle, end, size);
}

/// What connections bring to an eye vertex from all vertices of a light subpath, whether something blocks them or not.
template <Features F>
double mean_score(const Rules<Mis>& rules, const std::vector<SubpathEnd<Mis>>& eyes,
                  const std::vector<SubpathEnd<Mis>>& lights) {
    double sum = 0;
    for (size_t i = 0; i < eyes.size() && !lights.empty(); ++i) {
        Candidate<Mis> c;
        if (!connection<F>(rules, eyes[i], lights[i * 7919 % lights.size()], c)) continue;
        const float score = luminance(c.value) * mis_weight(c.ratio) / luminance(eyes[i].throughput);
        if (std::isfinite(score)) sum += score;
    }
    return sum / double(std::max<size_t>(eyes.size(), 1)) * double(lights.size()) / kWhole;
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
    Ends lights = trace<F>(scene, tracer, rules, seed, Side::light),
         eyes = trace<F>(scene, tracer, rules, seed, Side::eye);
    DrawCells found;
    found.mean_light_vertices = double(lights.points.size()) / kSubpaths;
    found.cells = split_points(std::move(eyes.points), cell_levels);
    found.clusters = split_points(std::move(lights.points), cluster_levels);
    const double mean = mean_score<F>(rules, eyes.whole, lights.whole);
    if (mean > 1e-15 && mean < 1e15) found.unit = float(mean * mean);
    return found;
}

#define AMBILUX_LEVEL(F)                                                                                              \
    template DrawCells find_draw_cells<F>(const SceneView&, const HostTracer&, const Rules<Mis>&, uint64_t, uint32_t, \
                                          uint32_t);
AMBILUX_LEVEL(kDiffuseFeatures)
AMBILUX_LEVEL(kUntexturedFeatures)
AMBILUX_LEVEL(kTriangleFeatures)
AMBILUX_LEVEL(kFlatFeatures)
AMBILUX_LEVEL(kAllFeatures)
#undef AMBILUX_LEVEL

}  // namespace ambilux
