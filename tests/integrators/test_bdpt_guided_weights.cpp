// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Weights of bdpt where subpaths of either side, or of both, follow a mixture of BSDF and learned trees, against the
// densities of all strategies enumerated.
#include "integrators/shared/guide/directions.h"
#include "tests/support/bidirectional_paths.h"
#include "tests/support/guided_trees.h"

namespace ambilux {

using GuidedBidirectionalMis = GuidedMis<BidirectionalMis>;

inline GuidedDirections<true> directions_of(const GuidedBidirectionalMis& mis) { return {mis.trees, true}; }

/// b p_bsdf + (1 - b) g at a vertex, and b times the probability of a delta.
inline test::SideDensity density_of(const SceneView& scene, const GuideTree& tree) {
    if (!tree.grid) return {};
    return [&scene, tree](const test::OraclePath::Vertex& x, Vec3f arrived, Vec3f left, double bsdf) {
        const Scattering s = make_scattering<test::kOracleFeatures>(scene, x.point, arrived);
        if (is_narrow<test::kOracleFeatures>(s.bsdf)) return bsdf;
        const uint32_t leaf = tree.leaf(x.point.p);
        const double share = double(tree.leaves[leaf].bsdf_share);
        return share * bsdf + (x.delta ? 0.0 : (1 - share) * double(tree.pdf_sa(leaf, left)));
    };
}
inline test::SideDensities densities_of(const SceneView& scene, const GuidedBidirectionalMis& mis) {
    return {density_of(scene, mis.trees.eye), density_of(scene, mis.trees.light)};
}

}  // namespace ambilux

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// 256 leaves over the scenes of the oracle, each with a quadtree and a share of the BSDF of its own.
Trees taught(uint32_t lesson) {
    GuidedSettings settings;
    settings.split = 16;
    settings.most_leaves = 512;
    Trees trees(settings);
    GuideTree& tree = trees.state.tree;
    tree.low = {-4, -2, -4};
    tree.inverse_side = 0.125f;
    while (trees.leaves() < settings.most_leaves && trees.state.progress->rounds < kGuideRounds)
        trees.learn([&](uint32_t leaf) { trees.put_light(leaf, 20000); });
    for (int i = 0; i < 2; ++i) {
        trees.state.progress->rounds = kGuideRounds - 1;
        trees.learn([&](uint32_t leaf) {
            const Vec4f u = random_floats({3, leaf, lesson, Stream::test}, 0);
            const Frame frame = frame_from_normal(square_to_sphere({u.x, u.y}));
            for (uint32_t k = 0; k < 200; ++k) {
                const Vec4f v = random_floats({4, leaf, k, Stream::test}, lesson);
                trees.put(leaf, frame.to_world(square_to_cone({v.x, v.y}, k % 2 ? 0.1f : 1.0f)), 1000);
            }
            tree.leaves[leaf].bsdf_share = 0.1f + 0.85f * u.z;
        });
    }
    REQUIRE(trees.leaves() == 256);
    CHECK(tree.leaves[7].quads > 5);
    return trees;
}

void check_weights(const GuideTree& eye, const GuideTree& light) {
    const std::map<std::string, uint64_t> seen =
        compare_weights(1.0, [&](uint32_t i) { return GuidedBidirectionalMis{settings(i), {eye, light}}; });
    for (const std::string kind : {"hit", "escape", "next event", "connection", "light tracing"}) {
        for (const char* sensor : {"perspective", "thinlens", "orthographic", "spherical"})
            CHECK(seen.at(kind + ", " + sensor) >= 20);
        for (const char* bsdf : {"diffuse", "roughconductor", "dielectric, delta", "roughdielectric", "plastic",
                                 "plastic, delta", "roughplastic"}) {
            INFO(kind << " " << bsdf);
            CHECK(seen.at(kind + ", " + bsdf) >= 20);
        }
    }
}

}  // namespace

TEST_CASE("Weights with guided eye subpaths equal those of all strategies enumerated, and sum to one") {
    check_weights(taught(0).state.tree, {});
}
TEST_CASE("So do those with guided light subpaths") { check_weights({}, taught(1).state.tree); }
TEST_CASE("So do those with both, which follow trees of their own") {
    const Trees eye = taught(0), light = taught(1);
    check_weights(eye.state.tree, light.state.tree);
}
