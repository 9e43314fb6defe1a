// libs: ambilux_session ambilux_render ambilux_integrators ambilux_formats ambilux_film ambilux_accel ambilux_core
// timeout: 120
// Trees of path guiding as arrays and as pictures: boxes fill the cube, densities are those of what is sampled.
#include "session/guide_tree.h"

#include "integrators/offers.h"
#include "render/replay/guide.h"
#include "tests/support/guided_settings.h"

using namespace ambilux;

TEST_CASE("Boxes of leaves fill the cube, quadtrees have what a path samples, and a picture has mean one") {
    const Scene scene = project_scene("cornell", 32, 24);
    const RenderSettings settings = guided(scene, 5, {{"guide_samples", "2"}, {"guide_split", "32"}});
    SharedAccels accels(scene);
    const std::shared_ptr<const KeptGuide> guide = make_replay(scene, settings, accels)->guide(8);
    REQUIRE(guide);
    const GuideTree& tree = guide->state.eye.tree;
    const GuideArrays a = guide_arrays(guide->state.eye, scene);
    REQUIRE(a.count.size() > 4);
    double volume = 0;
    for (size_t leaf = 0; leaf < a.count.size(); ++leaf) {
        double box = 1;
        Vec3f middle;
        for (size_t c = 0; c < 3; ++c) {
            box *= a.high[leaf][c] - a.low[leaf][c];
            middle[int(c)] = float(0.5 * (a.high[leaf][c] + a.low[leaf][c]) - scene.origin[c]);
        }
        volume += box;
        CHECK(tree.leaf(middle) == leaf);
        if (a.count[leaf] == 0) continue;
        // Down the arrays, to the cell of a direction.
        const Vec3f d = normalize(Vec3f{0.3f, -0.5f, 0.7f});
        Vec2f u = square_of_direction(d);
        double density = 1;
        for (int32_t node = int32_t(a.first[leaf]); node >= 0;) {
            const uint32_t x = u.x >= 0.5f, y = u.y >= 0.5f, q = x + 2 * y;
            u = {2 * u.x - float(x), 2 * u.y - float(y)};
            density *= 4 * double(a.probability[size_t(node)][q]);
            node = a.child[size_t(node)][q];
        }
        CHECK(density * double(kInv4Pi) == Approx(double(tree.pdf_sa(uint32_t(leaf), d))).epsilon(1e-4));
    }
    const double side = 1 / double(tree.inverse_side);
    CHECK(volume == Approx(side * side * side));
    const nlohmann::json said = guide_json(a, guide->state.eye);
    CHECK(said["leaves"] == a.count.size());
    CHECK(said["nodes"] == a.probability.size());
    CHECK(said["updates"] == kGuideRounds + 2);  // nothing is known of units in the first round
    CHECK(guide_text(said).starts_with("guide after"));
    const Layer picture = guide_layer(guide->state.eye, {0, 0, 0}, "here");
    double mean = 0;
    for (const float v : picture.values) mean += double(v) / double(picture.values.size());
    CHECK(mean == Approx(1).epsilon(0.05));
}
