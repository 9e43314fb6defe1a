#include "session/guide_tree.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "integrators/parse_value.h"
#include "render/replay/kept_guide.h"

namespace ambilux {
namespace {

/// Entries of the boxes of the leaves at and below `node` of the tree over space, whose cell is [low, high] in the unit
/// cube and is halved along `axis` next.
void add_boxes(const GuidedState& guide, uint32_t node, std::array<double, 3> low, std::array<double, 3> high, int axis,
               GuideArrays& to) {
    const uint32_t entry = guide.tree.space[node];
    if (entry & GuideTree::kLeafBit) {
        to.low[entry & ~GuideTree::kLeafBit] = low;
        to.high[entry & ~GuideTree::kLeafBit] = high;
        return;
    }
    const size_t a = size_t(axis);
    const double middle = 0.5 * (low[a] + high[a]);
    for (uint32_t upper = 0; upper < 2; ++upper) {
        auto half_low = low, half_high = high;
        (upper ? half_low : half_high)[a] = middle;
        add_boxes(guide, entry + upper, half_low, half_high, (axis + 1) % 3, to);
    }
}

void add_quads(const GuidedState& guide, uint32_t leaf, GuideArrays& to) {
    const uint32_t first = uint32_t(to.probability.size());
    const uint32_t count = std::max<uint32_t>(guide.tree.leaves[leaf].quads, 1);
    to.first.push_back(first);
    to.count.push_back(count);
    for (uint32_t n = 0; n < count; ++n) {
        const auto node = start_of<GuideQuads::Node>(guide.tree.quads.nodes[leaf * GuideQuads::kNodes + n]);
        const float right = 1.0f - node.left;
        to.probability.push_back({node.left * node.lower_left, right * node.lower_right,
                                  node.left * (1.0f - node.lower_left), right * (1.0f - node.lower_right)});
        std::array<int32_t, 4> child;
        for (uint32_t q = 0; q < 4; ++q) {
            const uint32_t c = GuideQuads::child(node.children, q);
            child[q] = c == 0 ? -1 : int32_t(first + c);
        }
        to.child.push_back(child);
    }
}

/// Levels of the quadtree that begins with entry `node`.
uint32_t levels(const GuideArrays& arrays, uint32_t node) {
    uint32_t most = 0;
    for (const int32_t c : arrays.child[node])
        if (c >= 0) most = std::max(most, levels(arrays, uint32_t(c)));
    return most + 1;
}

}  // namespace

std::shared_ptr<const GuidedState> guide_of(const Replay& replay, uint32_t sample, const std::string& side,
                                            const std::string& prefix) {
    const std::shared_ptr<const KeptGuide> kept = replay.guide(sample);
    if (!kept) throw Error(ExitCode::usage, prefix + "guide: variants guided alone learn where light comes from");
    const Side of = Side(parse_choice("side", side, {"eye", "light"}));
    if (!kept->policy.guided.guides(of))
        throw Error(ExitCode::usage,
                    fmt::format("{}guide: this render guides no {} subpaths (guide_sides)", prefix, side));
    return {kept, of == Side::eye ? &kept->state.eye : &kept->state.light};
}

GuideArrays guide_arrays(const GuidedState& guide, const Scene& scene) {
    GuideArrays to;
    const uint32_t leaves = guide.progress->leaves;
    to.updates = guide.progress->updates;
    to.low.resize(leaves);
    to.high.resize(leaves);
    add_boxes(guide, 0, {0, 0, 0}, {1, 1, 1}, 0, to);
    const double side = guide.tree.inverse_side > 0 ? 1.0 / double(guide.tree.inverse_side) : 0.0;
    for (auto* corners : {&to.low, &to.high})
        for (auto& corner : *corners)
            for (int c = 0; c < 3; ++c)
                corner[size_t(c)] = scene.origin[size_t(c)] + double(guide.tree.low[c]) + corner[size_t(c)] * side;
    for (uint32_t leaf = 0; leaf < leaves; ++leaf) {
        const GuideLeaf& of = guide.tree.leaves[leaf];
        to.bsdf_share.push_back(of.bsdf_share);
        to.reflected.push_back(of.reflected);
        to.depth.push_back(of.depth);
        // Before anything was learned there is no quadtree: all directions are alike.
        if (of.bsdf_share < 1.0f)
            add_quads(guide, leaf, to);
        else
            to.first.push_back(uint32_t(to.probability.size())), to.count.push_back(0);
    }
    return to;
}

nlohmann::json guide_json(const GuideArrays& a, const GuidedState& guide) {
    uint32_t learned = 0, deepest = 0;
    double share = 0;
    for (size_t leaf = 0; leaf < a.count.size(); ++leaf) {
        share += double(a.bsdf_share[leaf]);
        if (a.count[leaf] == 0) continue;
        ++learned;
        deepest = std::max(deepest, levels(a, a.first[leaf]));
    }
    return {{"updates", a.updates},
            {"leaves", a.count.size()},
            {"most_leaves", guide.most_leaves},
            {"learned_leaves", learned},
            {"deepest_leaf", *std::max_element(a.depth.begin(), a.depth.end())},
            {"nodes", a.probability.size()},
            {"most_nodes", *std::max_element(a.count.begin(), a.count.end())},
            {"deepest_cell", deepest},
            {"mean_bsdf_share", share / double(a.count.size())}};
}

std::string guide_text(const nlohmann::json& j) {
    return fmt::format(
        "guide after {} updates: {} of at most {} leaves, down to {} halvings, {} have learned; {} nodes "
        "over directions, at most {} in a leaf, cells down to 2^-{}; mean share of the BSDF {:.3g}\n",
        j["updates"].get<uint32_t>(), j["leaves"].get<size_t>(), j["most_leaves"].get<uint32_t>(),
        j["deepest_leaf"].get<uint32_t>(), j["learned_leaves"].get<uint32_t>(), j["nodes"].get<size_t>(),
        j["most_nodes"].get<uint32_t>(), j["deepest_cell"].get<uint32_t>(), j["mean_bsdf_share"].get<double>());
}

Layer guide_layer(const GuidedState& guide, Vec3f p, const std::string& name) {
    Layer layer = {name, {"V"}, {}};
    const uint32_t leaf = guide.tree.leaf(p);
    const bool learned = guide.tree.leaves[leaf].bsdf_share < 1.0f;
    for (uint32_t y = 0; y < kGuidePictureHeight; ++y)
        for (uint32_t x = 0; x < kGuidePictureWidth; ++x) {
            const Vec2f at = {(float(y) + 0.5f) / float(kGuidePictureHeight),
                              (float(x) + 0.5f) / float(kGuidePictureWidth)};
            layer.values.push_back(learned ? guide.tree.quads.cell(leaf, at).density : 1.0f);
        }
    return layer;
}

}  // namespace ambilux
