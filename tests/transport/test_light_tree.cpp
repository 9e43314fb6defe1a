// libs: ambilux_formats ambilux_accel ambilux_core
// Lights picked by a tree (transport/emitter/light_tree.h): probabilities by exhaustive enumeration.
#include "transport/emitter/light_tree.h"

#include <tbb/task_arena.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "accel/light_tree.h"
#include "core/rng.h"
#include "tests/support/many_lights.h"
#include "tests/support/render_scene.h"
#include "transport/emitter/emission.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features F = kAllFeatures;

struct Lit {
    Scene scene;
    LightTree tree{scene};
    SceneView view = scene.view();

    explicit Lit(Scene s) : scene(std::move(s)) { view.light_tree = tree.view(); }
};

std::vector<Scene> scenes() {
    std::vector<Scene> all;
    all.push_back(project_scene("lights"));
    all.push_back(project_scene("bathroom"));
    all.push_back(load(many_lamps(8, 1)));
    all.push_back(load(many_lamps(300, 2)));
    all.push_back(load(many_lamps(300, 3, false)));
    all.push_back(load("<emitter type='constant'/>"));
    return all;
}

Vec4f random(uint32_t i, uint32_t block) { return random_floats({7, i, 0, Stream::test}, block); }

Vec3f any_direction(uint32_t i) {
    const Vec4f u = random(i, 1);
    return square_to_sphere({u.x, u.y});
}

/// Around the scene and in it, on its lights, with a normal and without.
Receiver receiver(const SceneView& view, uint32_t i) {
    const Vec4f u = random(i, 0);
    const Vec3f n = i % 8 == 7 ? Vec3f{0, 0, 0} : any_direction(i);
    if (i % 4 == 1) {
        EmissionSample e;
        if (sample_emission<F>(view, random(i, 2), {u.x, u.y}, e) && e.prim != kNone) return {e.p, n};
    }
    const float reach = i % 4 == 2 ? 20.0f : i % 4 == 3 ? 0.05f : 1.0f;
    return {view.bounds_center + (Vec3f{u.x, u.y, u.z} - splat(0.5f)) * (2 * reach * view.bounds_radius), n};
}

/// Calls visit(emitter, prim, probability by power) for all that can be picked; prim is kNone where it does not matter.
template <class Visit>
void for_each_light(const SceneView& view, Visit visit) {
    for (uint32_t i = 0; i < view.emitter_count; ++i) {
        const Emitter& e = view.emitters[i];
        if (!has_light_leaf_per_triangle(e)) {
            visit(i, kNone, double(e.pick_probability));
            continue;
        }
        const Shape& shape = view.shapes[e.shape];
        const float* cdf = view.tables + e.area_cdf;
        for (uint32_t k = 0; k < shape.primitive_count; ++k)
            visit(i, shape.first_primitive + k, double(e.pick_probability) * (double(cdf[k + 1]) - double(cdf[k])));
    }
}

}  // namespace

TEST_CASE("Probabilities of all lights sum to one, wherever the receiver is") {
    for (Scene& scene : scenes()) {
        const Lit lit(std::move(scene));
        double worst = 0;
        for (uint32_t i = 0; i < 256; ++i) {
            const Receiver r = receiver(lit.view, i);
            double sum = 0;
            for_each_light(lit.view, [&](uint32_t emitter, uint32_t prim, double power) {
                const float over_power = LightsByTree::over_power(lit.view, r, emitter, prim);
                if (power > 0) CHECK((over_power >= kPowerShare && over_power < kInfinity));
                sum += power * double(over_power);
            });
            worst = std::max(worst, std::abs(sum - 1));
        }
        INFO(lit.scene.path << " " << lit.tree.leaves().size() << " leaves");
        CHECK(worst < 4e-6);
    }
}

TEST_CASE("The probability of a pick is that of the light that was found, to the last bit") {
    for (Scene& scene : scenes()) {
        const Lit lit(std::move(scene));
        uint32_t found = 0, differ = 0;
        for (uint32_t i = 0; i < 20000; ++i) {
            const Receiver r = receiver(lit.view, i / 16);
            EmitterSample s;
            LightsByTree::Pick pick;
            if (!sample_emitter_deferred<F>(lit.view, LightsByTree{}, r, random(i, 3), s, pick)) continue;
            const float over_power = LightsByTree::over_power(lit.view, r, s.emitter, s.prim);
            ++found;
            differ += std::memcmp(&over_power, &pick.over_power, sizeof over_power) != 0;
            if (lit.view.emitters[s.emitter].type != EmitterType::area) continue;
            // The density of the sample is that of a ray which meets the light there, to rounding.
            SurfacePoint hit{};
            hit.p = s.p, hit.ng = s.ng, hit.prim = s.prim;
            const float pdf = pdf_emitter_direct<F>(lit.view, s.emitter, r.p, s.wi, hit) * over_power;
            const float cosine = std::fabs(dot(s.ng, s.wi));
            if (cosine > 1e-2f && s.distance > 1e-2f) CHECK(pdf == Approx(s.pdf_sa).epsilon(1e-3));
        }
        CHECK(found > 1000);
        CHECK(differ == 0);
    }
}

TEST_CASE("Lights are picked as often as their probability says") {
    constexpr uint32_t kNumbers = 1u << 18;
    for (Scene& scene : scenes()) {
        const Lit lit(std::move(scene));
        const uint32_t leaves = uint32_t(lit.tree.leaves().size());
        for (uint32_t i = 0; i < 16; ++i) {
            const Receiver r = receiver(lit.view, i);
            // All equal steps of the number that goes down, and where it does not: of both that pick by power.
            std::vector<double> by_tree(lit.view.emitter_count + leaves);
            for (uint32_t k = 0; k < kNumbers; ++k) {
                const LightsByTree::Pick pick =
                    LightsByTree::pick(lit.view, r, {(float(k) + 0.5f) / float(kNumbers), 0.5f, 0.5f, 0.5f});
                const Emitter& e = lit.view.emitters[pick.emitter];
                uint32_t at = pick.emitter;
                if (has_light_leaf_per_triangle(e)) {
                    const float* cdf = lit.view.tables + e.area_cdf;
                    at = lit.view.emitter_count + lit.tree.first_leaf()[pick.emitter] +
                         sample_cdf(cdf, lit.view.shapes[e.shape].primitive_count, pick.u.w);
                }
                by_tree[at] += 1.0 / kNumbers;
            }
            double worst = 0;
            for_each_light(lit.view, [&](uint32_t emitter, uint32_t prim, double power) {
                const double p = power * double(LightsByTree::over_power(lit.view, r, emitter, prim)),
                             expected = (p - double(kPowerShare) * power) / (1 - double(kPowerShare));
                const size_t at = prim == kNone ? emitter
                                                : lit.view.emitter_count + lit.tree.first_leaf()[emitter] + prim -
                                                      lit.view.shapes[lit.view.emitters[emitter].shape].first_primitive;
                worst = std::max(worst, std::abs(by_tree[at] - expected) * kNumbers);
            });
            INFO(lit.scene.path << ", receiver " << i);
            CHECK(worst < 3);  // steps of the number
        }
        // With the share by power: frequencies of random numbers.
        const Receiver r = receiver(lit.view, 3);
        std::vector<double> seen(lit.view.emitter_count), expected(seen.size());
        for (uint32_t k = 0; k < kNumbers; ++k) ++seen[LightsByTree::pick(lit.view, r, random(k, 4)).emitter];
        for_each_light(lit.view, [&](uint32_t emitter, uint32_t prim, double power) {
            expected[emitter] += kNumbers * power * double(LightsByTree::over_power(lit.view, r, emitter, prim));
        });
        double chi2 = 0, cells = 0, rare_seen = 0, rare = 0;
        for (size_t e = 0; e < seen.size(); ++e) {
            if (expected[e] < 10)
                rare += expected[e], rare_seen += seen[e];
            else
                chi2 += (seen[e] - expected[e]) * (seen[e] - expected[e]) / expected[e], ++cells;
        }
        INFO(lit.scene.path << " chi2 " << chi2 << " of " << cells << ", rare " << rare_seen << " of " << rare);
        CHECK(chi2 < cells + 5 * std::sqrt(2 * cells) + 10);
        CHECK(std::abs(rare_seen - rare) < 5 * std::sqrt(rare) + 5);
    }
}

TEST_CASE("The tree leaves out no light that arrives") {
    for (Scene& scene : scenes()) {
        const Lit lit(std::move(scene));
        uint32_t arrived = 0;
        for (uint32_t i = 0; i < 40000; ++i) {
            const Receiver r = receiver(lit.view, i);
            EmitterSample s;
            if (!sample_emitter_deferred<F>(lit.view, r.p, random(i, 5), s)) continue;
            uint32_t leaf = lit.tree.first_leaf()[s.emitter];
            if (leaf == kLightBeside) continue;
            const Emitter& e = lit.view.emitters[s.emitter];
            if (has_light_leaf_per_triangle(e)) leaf += s.prim - lit.view.shapes[e.shape].first_primitive;
            ++arrived;
            INFO(lit.scene.path << " emitter " << s.emitter << " type " << int(e.type) << " receiver " << i);
            CHECK(LightsByTree::probability(*lit.view.light_tree, leaf, r) > 0.0f);
        }
        CHECK((arrived > 1000 || lit.tree.leaves().empty()));
    }
}

TEST_CASE("Nodes hold their lights, and paths lead to leaves") {
    for (Scene& scene : scenes()) {
        const Lit lit(std::move(scene));
        const auto& nodes = lit.tree.nodes();
        const auto& leaves = lit.tree.leaves();
        CHECK(nodes.size() == (leaves.empty() ? 0 : 2 * leaves.size() - 1));
        for (uint32_t i = 0; i < leaves.size(); ++i) {
            const Emitter& e = lit.view.emitters[leaves[i].emitter];
            uint32_t node = 0, path = leaves[i].path, depth = 0;
            std::vector<uint32_t> above = {0};
            while (!(nodes[node].next & kLightLeaf)) {
                node = nodes[node].next + (path & 1u);
                path >>= 1;
                above.push_back(node);
                ++depth;
            }
            CHECK(depth <= 32);
            CHECK((nodes[node].next & ~kLightLeaf) == i);
            if (!has_light_leaf_per_triangle(e)) continue;
            const Shape& shape = lit.view.shapes[e.shape];
            const uint32_t prim = shape.first_primitive + i - lit.tree.first_leaf()[leaves[i].emitter];
            const Triangle t = lit.view.triangles[prim];
            const Vec3f n = surface_at<F>(lit.view, prim, 0.5f, 0.1f).ng;
            for (uint32_t a : above) {
                const LightNode& at = nodes[a];
                for (uint32_t v : {t.v0, t.v1, t.v2})
                    CHECK(length(lit.view.vertices[v].p - at.center) <= at.radius * (1 + 1e-6f));
                CHECK(dot(n, at.axis) >= at.cos_o - 1e-6f);
            }
        }
        double energy = 0;
        for (const LightNode& n : nodes)
            if (n.next & kLightLeaf) energy += double(n.energy);
        if (!nodes.empty()) CHECK(double(nodes[0].energy) == Approx(energy).epsilon(1e-4));
    }
}

TEST_CASE("A tree does not depend on the number of threads, and takes the memory that was predicted") {
    const Scene scene = load(many_lamps(6000, 5));
    const LightTree tree(scene);
    tbb::task_arena one(1);
    one.execute([&] {
        const LightTree alone(scene);
        CHECK(std::memcmp(alone.nodes().data(), tree.nodes().data(), tree.nodes().size() * sizeof(LightNode)) == 0);
        CHECK(std::memcmp(alone.leaves().data(), tree.leaves().data(), tree.leaves().size() * sizeof(LightLeaf)) == 0);
    });
    CHECK(tree.memory_bytes() == light_tree_bytes(scene));
    CHECK(tree.leaves().size() == light_leaf_count(scene));
}

TEST_CASE("Lights in one place, in a row and far more of them than levels have a tree") {
    std::string same, row;
    for (int i = 0; i < 200; ++i) {
        same += lamp_of_kind(4, {0.5f, 0.5f, 0.5f}, {0, 0, 0}, 0.1, 1);
        row += lamp_of_kind(4, {float(std::exp2(-i * 0.5)), 0, 0}, {0, 0, 0}, 0.1, 1);
    }
    for (const std::string& text : {same, row}) {
        const Lit lit(load(text + many_lamps(1, 1, false)));
        for (uint32_t i = 0; i < 64; ++i) {
            const Receiver r = receiver(lit.view, i);
            double sum = 0;
            for_each_light(lit.view, [&](uint32_t emitter, uint32_t prim, double power) {
                sum += power * double(LightsByTree::over_power(lit.view, r, emitter, prim));
            });
            CHECK(std::abs(sum - 1) < 1e-5);
        }
    }
}

TEST_CASE("A tree over a million lights is built within seconds", "[.bench]") {
    Scene scene;
    for (uint32_t i = 0; i < 1000000; ++i) {
        Emitter e{};
        const Vec4f u = random(i, 6);
        e.type = i % 2 ? EmitterType::point : EmitterType::spot;
        e.position = {100 * u.x, 3 * u.y, 10 * u.z};
        e.direction = any_direction(i);
        e.cutoff = 0.7f, e.beam_width = 0.5f;
        e.pick_probability = 1e-6f;
        scene.emitters.push_back(e);
    }
    const auto start = std::chrono::steady_clock::now();
    const LightTree tree(scene);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    std::printf("%zu lights: %.2f s, %.0f MiB\n", tree.leaves().size(), seconds,
                double(tree.memory_bytes()) / double(1 << 20));
    CHECK(seconds < 60);
}

TEST_CASE("A tree is made where it has something to choose from") {
    CHECK_FALSE(light_tree_pays(project_scene("cornell")));
    CHECK_FALSE(light_tree_pays(load("<emitter type='constant'/>")));
    CHECK(light_tree_pays(project_scene("lights")));
    const std::string bulb = lamp_of_kind(4, {0, 0, 0}, {0, 0, 0}, 0.1, 1);
    CHECK_FALSE(light_tree_pays(load(bulb)));
    CHECK(light_tree_pays(load(bulb + bulb)));
}

TEST_CASE("A coarse normal rounded again is the same") {
    for (uint32_t i = 0; i < 10000; ++i) {
        const Vec3f n = any_direction(i);
        const CoarseNormal coarse = CoarseNormal::pack(n);
        CHECK(CoarseNormal::pack(coarse.unpack()).bits == coarse.bits);
        CHECK(length(coarse.unpack() - n) < 2e-3f);
    }
    CHECK(is_zero(CoarseNormal::pack({0, 0, 0}).unpack()));
}
