#include "accel/light_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "scene/primitive_bounds.h"
#include "scene/surface.h"

namespace ambilux {
namespace {

/// Directions around `axis`: those of normals within `theta_o`, and light leaves them within `theta_e`. Radians.
struct Cone {
    Vec3f axis = {0, 0, 1};
    float theta_o = -1;  ///< negative: of no light
    float theta_e = 0;
};

float angle_between(Vec3f a, Vec3f b) { return std::atan2(length(cross(a, b)), dot(a, b)); }

/// A cone that holds both (Conty Estevez and Kulla 2018, algorithm 1).
Cone join(Cone a, Cone b) {
    if (a.theta_o < b.theta_o) std::swap(a, b);
    if (b.theta_o < 0) return a;
    const float theta_e = std::max(a.theta_e, b.theta_e);
    if (a.theta_o >= kPi) return {a.axis, kPi, theta_e};
    const float between = angle_between(a.axis, b.axis);
    if (std::min(between + b.theta_o, kPi) <= a.theta_o) return {a.axis, a.theta_o, theta_e};
    const float theta_o = 0.5f * (a.theta_o + between + b.theta_o), turn = theta_o - a.theta_o;
    if (!(theta_o < kPi)) return {a.axis, kPi, theta_e};
    const Vec3f across = b.axis - a.axis * dot(a.axis, b.axis);
    const float l = length(across);
    if (!(l > 1e-4f)) return {a.axis, std::min(between + std::max(a.theta_o, b.theta_o), kPi), theta_e};
    return {normalize(a.axis * std::cos(turn) + across * (std::sin(turn) / l)), theta_o, theta_e};
}

/// Light of one or several leaves.
struct Light {
    Bounds3f bounds;
    Cone cone;
    double energy = 0;

    void add(const Light& other) {
        bounds.extend(other.bounds);
        cone = join(cone, other.cone);
        energy += other.energy;
    }
    Vec3f center() const { return (bounds.lower + bounds.upper) * 0.5f; }
};

/// Integral over the directions of a cone that weighs those beyond theta_o by their cosine (equation 1 there).
double cone_measure(const Cone& c) {
    const double o = std::min(double(c.theta_o), M_PI), w = std::min(o + double(c.theta_e), M_PI);
    return 2 * M_PI * (1 - std::cos(o)) +
           M_PI / 2 * (2 * w * std::sin(o) - std::cos(o - 2 * w) - 2 * o * std::sin(o) + std::cos(o));
}

/// What it costs to have these lights in one node. Lamps in a row or a plane have boxes without a surface: a little of
/// the squared diagonal tells them apart.
double cost(const Light& l) {
    if (!(l.energy > 0)) return 0;
    const double diagonal2 = length_squared(l.bounds.upper - l.bounds.lower);
    return l.energy * cone_measure(l.cone) * (double(l.bounds.half_area()) + 1e-2 * diagonal2);
}

// ---- emitters as lights ----

/// Of the emitting side of a flat primitive, which is the same everywhere on it.
Cone flat_cone(const SceneView& view, uint32_t prim) {
    return {surface_at<kAllFeatures>(view, prim, 0.25f, 0.25f).ng, 0, kPi / 2};
}

/// A primitive of an area emitter. `power`: that it sends.
Light surface_light(const SceneView& view, uint32_t prim, double power) {
    if (view.is_triangle(prim)) return {triangle_bounds(view, prim), flat_cone(view, prim), power / M_PI};
    const Quadric& q = view.quadric(prim);
    switch (q.type) {
        case PrimitiveType::disk: return {quadric_bounds(q), flat_cone(view, prim), power / M_PI};
        case PrimitiveType::cylinder: return {quadric_bounds(q), {{0, 0, 1}, kPi, kPi / 2}, power / (M_PI * M_PI)};
        default: return {quadric_bounds(q), {{0, 0, 1}, kPi, kPi / 2}, power / (4 * M_PI)};
    }
}

/// All that an emitter has in the tree as one light.
Light whole_light(const SceneView& view, const Emitter& e) {
    const double power = e.pick_probability;
    if (is_on_surface(e.type)) {
        const Shape& shape = view.shapes[e.shape];
        Light all;
        for (uint32_t i = 0; i < shape.primitive_count; ++i)
            all.add(surface_light(view, shape.first_primitive + i, power / shape.primitive_count));
        return all;
    }
    const Bounds3f at = {e.position, e.position};
    const auto beam = [&](Vec3f axis, float angle) -> Light {
        const float theta_e = std::min(angle, kPi / 2);
        return {at, {normalize(axis), std::min(angle - theta_e, kPi), theta_e}, power / M_PI};
    };
    // Narrow ones are brighter than a flat lamp of their power, where they shine. Few receivers lie there, and the
    // nodes above do not know which: with that energy they would lead all others here too.
    if (e.type == EmitterType::spot) return beam(e.direction, e.cutoff);
    if (e.type == EmitterType::projector)
        return beam(e.to_world.vector({0, 0, 1}), std::atan(std::hypot(e.cutoff, e.beam_width)));
    return {at, {{0, 0, 1}, kPi, kPi / 2}, power / (4 * M_PI)};
}

// ---- the tree ----

/// A leaf on its way into the tree.
struct Placed {
    Light light;
    uint32_t leaf;
};

constexpr uint32_t kBins = 16;
constexpr uint32_t kChunk = 4096;  ///< leaves that one task looks at
/// Levels of a tree at most: a path is one word.
constexpr uint32_t kMostDepth = 32;

class Builder {
public:
    Builder(std::vector<Placed>& placed, std::vector<LightNode>& nodes, std::vector<LightLeaf>& leaves)
        : placed_(placed), nodes_(nodes), leaves_(leaves) {}

    /// The node at `node` over leaves [begin, end), `depth` below the root. Its children lie where the place of the
    /// split says, so that no task waits for another.
    Light build(uint32_t node, uint32_t begin, uint32_t end, uint32_t depth, uint32_t path) {
        if (end - begin == 1) {
            const Placed& p = placed_[begin];
            leaves_[p.leaf].path = path;
            write(node, p.light, kLightLeaf | p.leaf);
            return p.light;
        }
        const uint32_t middle = split(begin, end, depth), left = 2 * middle - 1;
        const uint32_t right_path = path | 1u << depth;
        Light children[2];
        const auto child = [&](uint32_t k) {
            children[k] = k == 0 ? build(left, begin, middle, depth + 1, path)
                                 : build(left + 1, middle, end, depth + 1, right_path);
        };
        if (end - begin > kChunk)
            parallel_for(2u, child);
        else
            child(0), child(1);
        children[0].add(children[1]);
        write(node, children[0], left);
        return children[0];
    }

private:
    /// Bounds of centres, and lights by where their centre lies along each axis.
    struct Bins {
        std::array<std::array<Light, kBins>, 3> of;
    };

    void write(uint32_t at, const Light& l, uint32_t next) {
        LightNode& n = nodes_[at];
        n.center = l.center();
        // Rounded up, as are the angles: no light may lie outside.
        const float diagonal = length(l.bounds.upper - l.bounds.lower);
        n.radius = diagonal > 0 ? 0.5f * diagonal * (1.0f + 1e-5f) + 1e-6f * max_component(abs(n.center)) : 0.0f;
        n.axis = l.cone.axis;
        n.energy = float(l.energy);
        const float theta_o = std::min(l.cone.theta_o > 0 ? l.cone.theta_o + 1e-3f : 0.0f, kPi);
        n.cos_o = std::cos(theta_o);
        n.sin_o = theta_o < kPi ? std::sin(theta_o) : 0.0f;
        n.cos_e = std::cos(l.cone.theta_e + 2e-3f);
        n.next = next;
    }
    /// Calls f(first, last, chunk) for parts of [begin, end).
    template <class Function>
    static void for_chunks(uint32_t begin, uint32_t end, Function f) {
        if (end - begin <= kChunk) return f(begin, end, 0u);
        parallel_for((end - begin + kChunk - 1) / kChunk, [&](uint32_t c) {
            const uint32_t first = begin + c * kChunk;
            f(first, std::min(first + kChunk, end), c);
        });
    }
    Bounds3f centers(uint32_t begin, uint32_t end) const {
        std::vector<Bounds3f> parts((end - begin + kChunk - 1) / kChunk);
        for_chunks(begin, end, [&](uint32_t first, uint32_t last, uint32_t c) {
            for (uint32_t i = first; i < last; ++i) parts[c].extend(placed_[i].light.center());
        });
        for (size_t c = 1; c < parts.size(); ++c) parts[0].extend(parts[c]);
        return parts[0];
    }
    static uint32_t bin_of(Vec3f center, const Bounds3f& all, int axis) {
        const float share = (center[axis] - all.lower[axis]) / (all.upper[axis] - all.lower[axis]);
        return std::min(uint32_t(share * float(kBins)), kBins - 1);
    }
    Bins fill_bins(uint32_t begin, uint32_t end, const Bounds3f& all) const {
        std::vector<Bins> parts((end - begin + kChunk - 1) / kChunk);
        for_chunks(begin, end, [&](uint32_t first, uint32_t last, uint32_t c) {
            for (uint32_t i = first; i < last; ++i)
                for (int axis = 0; axis < 3; ++axis)
                    if (all.upper[axis] > all.lower[axis])
                        parts[c].of[size_t(axis)][bin_of(placed_[i].light.center(), all, axis)].add(placed_[i].light);
        });
        for (size_t c = 1; c < parts.size(); ++c)
            for (size_t axis = 0; axis < 3; ++axis)
                for (uint32_t b = 0; b < kBins; ++b) parts[0].of[axis][b].add(parts[c].of[axis][b]);
        return parts[0];
    }
    /// Moves leaves so that those of the left child come first. Returns where the right one begins.
    uint32_t split(uint32_t begin, uint32_t end, uint32_t depth) {
        const uint32_t count = end - begin;
        if (count == 2) return begin + 1;
        const Bounds3f all = centers(begin, end);
        const Vec3f extent = all.upper - all.lower;
        const auto at = [&](uint32_t i) { return placed_.begin() + std::ptrdiff_t(i); };
        int best_axis = -1;
        uint32_t best_bin = 0;
        if (const float longest = max_component(extent); longest > 0) {
            const Bins bins = fill_bins(begin, end, all);
            double least = 0;
            for (int axis = 0; axis < 3; ++axis) {
                if (!(extent[axis] > 0)) continue;
                const auto& of = bins.of[size_t(axis)];
                std::array<double, kBins + 1> behind{};  // of all bins from one on
                Light some;
                uint32_t last = 0;  // that holds a light
                for (uint32_t b = kBins; b-- > 1;) {
                    behind[b] = behind[b + 1];
                    if (!(of[b].energy > 0)) continue;
                    some.add(of[b]), behind[b] = cost(some);
                    last = std::max(last, b);
                }
                some = {};
                for (uint32_t b = 1; b <= last; ++b) {
                    if (!(of[b - 1].energy > 0)) continue;  // no other split than the one before
                    some.add(of[b - 1]);
                    const double c = (cost(some) + behind[b]) * double(longest / extent[axis]);
                    if (best_axis < 0 || c < least) least = c, best_axis = axis, best_bin = b;
                }
            }
        }
        uint32_t middle = begin;
        if (best_axis >= 0)
            middle = uint32_t(
                std::partition(at(begin), at(end),
                               [&](const Placed& p) { return bin_of(p.light.center(), all, best_axis) < best_bin; }) -
                placed_.begin());
        // A path has so many bits: if the larger child could need more, halves will do.
        const uint32_t most = std::max(middle - begin, end - middle);
        if (middle == begin || middle == end || depth + 1 + uint32_t(std::bit_width(most - 1)) > kMostDepth) {
            middle = begin + count / 2;
            int axis = extent.y > extent.x ? 1 : 0;
            if (extent.z > extent[axis]) axis = 2;
            std::nth_element(at(begin), at(middle), at(end), [&](const Placed& a, const Placed& b) {
                const float x = a.light.center()[axis], y = b.light.center()[axis];
                return x < y || (x == y && a.leaf < b.leaf);
            });
        }
        return middle;
    }

    std::vector<Placed>& placed_;
    std::vector<LightNode>& nodes_;
    std::vector<LightLeaf>& leaves_;
};

}  // namespace

LightTree::LightTree(const Scene& scene) : view_{} {
    const uint64_t count = light_leaf_count(scene);
    if (count >= kLightLeaf)
        throw input_error(scene.path, 0,
                          std::to_string(count) + " lights; a tree tells " + std::to_string(kLightLeaf - 1) + " apart");
    const SceneView scene_view = scene.view();
    double in_tree = 0, at_infinity = 0;
    first_leaf_.assign(scene.emitters.size(), kNone);
    for (uint32_t i = 0, next = 0; i < first_leaf_.size(); ++i) {
        const Emitter& e = scene.emitters[i];
        if (!(e.pick_probability > 0)) continue;
        if (is_infinite(e.type)) {
            first_leaf_[i] = kLightBeside;
            beside_.push_back(i);
            at_infinity += e.pick_probability;
        } else if (is_in_light_tree(e)) {
            first_leaf_[i] = next;
            next += has_light_leaf_per_triangle(e) ? scene.shapes[e.shape].primitive_count : 1;
            in_tree += e.pick_probability;
        }
    }
    const double reached = in_tree + at_infinity, by_tree = 1 - double(kPowerShare);
    leaves_.resize(size_t(count));
    nodes_.resize(count ? 2 * size_t(count) - 1 : 0);
    std::vector<Placed> placed(leaves_.size());
    parallel_for(
        uint32_t(first_leaf_.size()),
        [&](uint32_t i) {
            const uint32_t first = first_leaf_[i];
            if (first >= kLightBeside) return;
            const Emitter& e = scene.emitters[i];
            const double p = e.pick_probability, scale = by_tree * in_tree / reached;
            if (!has_light_leaf_per_triangle(e)) {
                leaves_[first] = {i, 0, float(scale / p), -1.0f};
                placed[first] = {whole_light(scene_view, e), first};
                return;
            }
            const Shape& shape = scene.shapes[e.shape];
            const float* cdf = scene.tables.data() + e.area_cdf;
            parallel_for(
                shape.primitive_count,
                [&](uint32_t k) {
                    const double share = double(cdf[k + 1]) - double(cdf[k]);
                    leaves_[first + k] = {i, 0, float(scale / (p * share)), cdf[k]};
                    placed[first + k] = {surface_light(scene_view, shape.first_primitive + k, p * share), first + k};
                },
                256u);
        },
        256u);
    if (count) Builder(placed, nodes_, leaves_).build(0, 0, uint32_t(count), 0, 0);
    view_ = {nodes_.data(),
             leaves_.data(),
             first_leaf_.data(),
             beside_.data(),
             uint32_t(beside_.size()),
             float(reached),
             float(in_tree),
             kPowerShare + float(reached > 0 ? by_tree / reached : 0)};
}

uint64_t LightTree::memory_bytes() const {
    return nodes_.size() * sizeof(LightNode) + leaves_.size() * sizeof(LightLeaf) +
           (first_leaf_.size() + beside_.size()) * sizeof(uint32_t) + sizeof(LightTreeView);
}

}  // namespace ambilux
