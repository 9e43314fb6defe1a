#include "backends/fast_build.h"

#include <fmt/format.h>

#include <unordered_map>

#include "accel/bvh2.h"
#include "core/error.h"

namespace ambilux {
namespace {

/// Bytes of the largest of several uses of one place, and the place.
class Shared {
public:
    /// `place`: takes a layout.
    template <class Place>
    Shared& use(Place&& place) {
        Layout dry;
        place(dry);
        bytes_ = std::max(bytes_, dry.bytes());
        return *this;
    }
    uint64_t bytes() const { return bytes_; }

private:
    uint64_t bytes_ = 0;
};

}  // namespace

FastBuildMemory FastBuildMemory::lay_out(Layout& layout, uint32_t primitives, const PrimitiveBytes& bytes) {
    FastBuildMemory m{};
    const uint32_t n = primitives;
    m.nodes = layout.allocate<fast::Node>(2 * uint64_t(n));
    for (int i = 0; i < 3; ++i) m.boxes[i] = layout.allocate<Bounds3f>(kBoxes[i]);
    m.scan = ScanMemory::lay_out(layout, n + 1, bytes);
    const auto plans = [&](Layout& l) { m.plans = l.allocate<collapse::Plan>(n); };
    const auto parts = [&](Layout& l) { m.references = l.allocate<fast::Reference>(n); };
    const auto count = [&](Layout& l) { m.counts = l.allocate<uint32_t>(uint64_t(n) + 1); };
    const auto sort = [&](Layout& l) { m.sort = SortMemory<uint64_t>::lay_out(l, n, bytes); };
    const auto join = [&](Layout& l) {
        for (uint32_t** list : {&m.clusters[0], &m.clusters[1], &m.partner, &m.stays})
            *list = l.allocate<uint32_t>(uint64_t(n) + 1);
    };
    const auto top = [&](Layout& l) {
        l.allocate<uint32_t>(uint64_t(n) + 1);  // clusters
        m.top_nodes = l.allocate<fast::Node>(std::min(n, kTopClusters));
        m.top_plans = l.allocate<collapse::Plan>(std::min(n, kTopClusters));
    };
    const auto widen = [&](Layout& l) {
        for (uint32_t** list : {&m.wide.binary, &m.wide.first_child, &m.wide.first_primitive, &m.inner, &m.primitives})
            *list = l.allocate<uint32_t>(uint64_t(n) + 1);
    };
    const auto share = [&](auto&... uses) {
        Shared shared;
        (shared.use(uses), ...);
        std::byte* const place = layout.allocate<std::byte>(shared.bytes());
        const auto put = [&](auto& use) {
            Layout l = place ? Layout(Layout(), place) : Layout();
            use(l);
        };
        (put(uses), ...);
    };
    share(plans, parts);
    share(count, sort, join, top, widen);
    return m;
}

void improve(FastTop& top) {
    const uint32_t count = uint32_t(top.clusters.size());
    // Clusters become leaves 0, 1, ..., nodes above them follow.
    std::unordered_map<uint32_t, uint32_t> place;
    Bvh2 bvh;
    for (uint32_t i = 0; i < count; ++i) {
        place[top.clusters[i]] = i;
        bvh.nodes.push_back({top.nodes[i].bounds, kNone, kNone, i});
    }
    const auto placed = [&](uint32_t node) { return node >= top.first ? node - top.first + count : place.at(node); };
    for (const fast::Node& n : top.joins) bvh.nodes.push_back({n.bounds, placed(n.left), placed(n.right), kNone});
    bvh.root = uint32_t(bvh.nodes.size() - 1);
    const Bvh2 before = bvh;
    optimise_bvh2(bvh, kReinsertionPasses);
    if (bvh2_depth(bvh) > kMostBvh2Depth) bvh = before;
    // Children before parents: the way from the root, backwards.
    std::vector<uint32_t> order = {bvh.root}, moved(bvh.nodes.size());
    for (size_t i = 0; i < order.size(); ++i)
        for (const uint32_t child : {bvh.nodes[order[i]].left, bvh.nodes[order[i]].right})
            if (!bvh.nodes[child].is_leaf()) order.push_back(child);
    std::reverse(order.begin(), order.end());
    std::vector<collapse::Plan> plans;
    const auto plan = [&](uint32_t node) {
        return bvh.nodes[node].is_leaf() ? top.plans[node] : plans[moved[node] - top.first];
    };
    const auto name = [&](uint32_t node) { return bvh.nodes[node].is_leaf() ? top.clusters[node] : moved[node]; };
    top.joins.clear();
    for (const uint32_t i : order) {
        const Bvh2Node& n = bvh.nodes[i];
        moved[i] = top.first + uint32_t(plans.size());
        top.joins.push_back({n.bounds, name(n.left), name(n.right)});
        plans.push_back(collapse::inner_plan(plan(n.left), plan(n.right), n.bounds.half_area()));
    }
    top.plans = std::move(plans);
}

uint64_t fast_build_peak_bytes(uint32_t primitives, const PrimitiveBytes& bytes) {
    Layout dry;
    FastBuildMemory::lay_out(dry, primitives, bytes);
    // A node for every four leaves at most, where the trees of published scenes have one for every ten.
    const uint64_t leaves = primitives;
    return dry.bytes() + leaves * sizeof(CwbvhPrimitive) + (leaves / 4 + 1) * sizeof(CwbvhNode);
}

void check_no_groups(const SceneView& scene) {
    if (scene.group_count > 0)
        throw Error(ExitCode::usage,
                    "build=fast: trees of scenes with instances have two levels, which the good builder "
                    "makes alone; set build=good");
}

void check_depth(const FastBuild& build) {
    if (build.depth > uint32_t(kCwbvhStackSize))
        throw Error(ExitCode::device,
                    fmt::format("build=fast: a tree of {} levels exceeds the traversal stack of {}; set build=good",
                                build.depth, kCwbvhStackSize));
}

}  // namespace ambilux
