// libs: ambilux_formats ambilux_accel
// labels: accel
// timeout: 120
// Instances against copies: what loads, what rays meet, where they leave, and images.
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "accel/pair_bvh.h"
#include "core/parallel.h"
#include "scene/flatten.h"
#include "scene/info.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/plain_path.h"

using namespace ambilux;
using namespace ambilux::accel_test;
using test::ball;
using test::contains;
using test::kMaskBsdf;
using test::load_forest;
using test::placed;
using test::shared;

namespace {

constexpr Features F = kAllFeatures;

bool close(Vec3f a, Vec3f b, float tolerance) { return max_component(abs(a - b)) <= tolerance; }

/// Ids of the copy's primitives: copies follow the triangles of no group, in the order of instances.
uint32_t id_in_copy(const SceneView& instanced, const SceneView& flat, uint32_t prim) {
    if (instanced.is_instanced(prim)) return prim - instanced.primitive_count() + instanced.ungrouped_count();
    return instanced.is_triangle(prim) ? prim : prim - instanced.triangle_count + flat.triangle_count;
}

struct Differences {
    uint32_t rays = 0, hits = 0, instanced = 0, other = 0, blocked = 0;
};

/// Hits of the one tracer in the scene of instances, and Embree's in that of copies.
template <class Trace>
Differences compare(const Scene& scene, const Scene& copy, const std::vector<Ray>& rays, Trace trace) {
    const SceneView view = scene.view(), flat = copy.view();
    const EmbreeAccel accel(copy);
    Differences d;
    for (const Ray& ray : rays) {
        Hit expected, hit;
        bool blocked;
        const bool met = accel.tracer().closest<F>(flat, ray, expected);
        trace(ray, hit, blocked);
        ++d.rays;
        d.hits += met;
        d.blocked += blocked != (hit.prim != kNone);
        if (hit.prim != kNone) d.instanced += view.is_instanced(hit.prim);
        const bool same =
            met == (hit.prim != kNone) && (!met || (std::fabs(hit.t - expected.t) <= 1e-5f * (1 + expected.t) &&
                                                    id_in_copy(view, flat, hit.prim) == expected.prim));
        d.other += !same;
    }
    return d;
}

void check(const Differences& d) {
    CAPTURE(d.rays, d.hits, d.instanced, d.other, d.blocked);
    CHECK(d.instanced > d.rays / 20);
    CHECK(d.other <= d.rays / 2000);  // at edges
    CHECK(d.blocked <= d.rays / 2000);
}

}  // namespace

TEST_CASE("groups of many triangles in all are shared, others are copied") {
    const Scene scene = load_forest("<bsdf type='diffuse'/>");
    REQUIRE(scene.groups.size() == 1);
    REQUIRE(scene.instances.size() == 4);
    CHECK(scene.features.instances);
    const uint32_t each = 2 * 12 * 16 - 2 * 16 + 12;
    CHECK(scene.groups[0].triangle_count == each);
    CHECK(scene.triangles.size() == 4 + each);
    CHECK(scene.view().instanced_count == 4 * each);
    CHECK(test::has_note(scene, "4 instances share 364 triangles"));
    CHECK(scene.instances[3].mirrored == 1);
    const nlohmann::json info = scene_info(scene);
    CHECK(info["instances"]["count"] == 4);
    CHECK(info["instances"]["triangles"] == 4 * each);
    CHECK(info["instances"]["bytes_of_copies"] > info["instances"]["bytes"]);

    const Scene copied = load_forest("<bsdf type='diffuse'/>", {});
    CHECK(copied.instances.empty());
    CHECK(!copied.features.instances);
    CHECK(copied.triangles.size() == 4 + 4 * each);

    // A sphere of a group is copied: a record is all that it is. So is a group in one place.
    const std::string group = "<shape type='shapegroup' id='s'><shape type='sphere'/><shape type='cube'/></shape>";
    const Scene once = test::load(group + placed("s", "<translate x='3'/>"), shared());
    CHECK(once.instances.empty());
    CHECK(once.triangles.size() == 12);
    const Scene twice = test::load(
        group + placed("s", "<translate x='3'/>") + placed("s", "<translate x='-3'/><scale value='2'/>"), shared());
    CHECK(twice.instances.size() == 2);
    REQUIRE(twice.quadrics.size() == 2);
    CHECK(close(twice.quadrics[1].to_world.point({0, 0, 0}), {-6, 0, 0}, 1e-5f));
    CHECK(twice.view().instances[0].first_id == 14);

    CHECK(contains(test::error_of(group + placed("s", "<scale x='0'/>")), "the transform of the instance is singular"));
    LoadOptions few = shared();
    few.limits.shapes = 3;
    CHECK(contains(test::error_of(group + placed("s", "") + placed("s", ""), few), "--limits shapes=3"));
    CHECK_THROWS_AS(PairAccel(scene), Error);
}

TEST_CASE("copies of instances are what the loader copies") {
    const Scene flat = flatten_instances(load_forest("<bsdf type='diffuse'/>")),
                copied = load_forest("<bsdf type='diffuse'/>", {});
    CHECK(!flat.features.instances);
    REQUIRE(flat.triangles.size() == copied.triangles.size());
    CHECK(flat.sort_keys.size() == copied.sort_keys.size());
    double area = 0, expected = 0;
    const auto area_of = [](const Scene& s, const Triangle& t) {
        return 0.5 * length(cross(s.vertices[t.v1].p - s.vertices[t.v0].p, s.vertices[t.v2].p - s.vertices[t.v0].p));
    };
    for (const Triangle& t : flat.triangles) area += area_of(flat, t);
    for (const Triangle& t : copied.triangles) expected += area_of(copied, t);
    CHECK(area == Approx(expected).epsilon(1e-6));
    CHECK(flat.bounds_radius == Approx(copied.bounds_radius).epsilon(0.2));  // of boxes, not of vertices
}

TEST_CASE("rays meet instances where they meet copies") {
    const Scene scene = load_forest("<bsdf type='diffuse'/>"), copy = flatten_instances(scene);
    const SceneView view = scene.view();
    const std::vector<Ray> rays = test::rays_around(40000, 1);
    const EmbreeAccel embree(scene);
    const CwbvhAccel cwbvh(scene);
    check(compare(scene, copy, rays, [&](const Ray& ray, Hit& hit, bool& blocked) {
        embree.tracer().closest<F>(view, ray, hit);
        blocked = embree.tracer().occluded<F>(view, ray);
    }));
    check(compare(scene, copy, rays, [&](const Ray& ray, Hit& hit, bool& blocked) {
        cwbvh.tracer().closest<F>(view, ray, hit);
        blocked = cwbvh.tracer().occluded<F>(view, ray);
    }));
}

TEST_CASE("packets and the other structure meet instances as single rays do, with holes too") {
    for (const char* bsdf : {"<bsdf type='diffuse'/>", kMaskBsdf}) {
        const Scene scene = load_forest(bsdf);
        const SceneView view = scene.view();
        const std::vector<Ray> rays = test::rays_around(32000, 2);
        const EmbreeAccel embree(scene);
        const CwbvhAccel cwbvh(scene);
        uint32_t different = 0, other_tracer = 0, hits = 0;
        for (size_t first = 0; first < rays.size(); first += kMostPacketRays) {
            Hit packet[kMostPacketRays];
            bool blocked[kMostPacketRays];
            embree.tracer().closest<F>(view, &rays[first], kMostPacketRays, false, packet);
            embree.tracer().occluded<F>(view, &rays[first], kMostPacketRays, false, blocked);
            for (uint32_t k = 0; k < kMostPacketRays; ++k) {
                Hit one, own;
                embree.tracer().closest<F>(view, rays[first + k], one);
                cwbvh.tracer().closest<F>(view, rays[first + k], own);
                hits += one.prim != kNone;
                different += std::memcmp(&one, &packet[k], sizeof one) != 0 || blocked[k] != (one.prim != kNone);
                other_tracer += one.prim != own.prim || cwbvh.tracer().occluded<F>(view, rays[first + k]) != blocked[k];
            }
        }
        CAPTURE(bsdf, different, other_tracer, hits);
        CHECK(hits > rays.size() / 4);
        CHECK(different <= rays.size() / 2000);
        CHECK(other_tracer <= rays.size() / 2000);
    }
}

TEST_CASE("points of instances are those of copies, to the bit where no mirror turns corners") {
    const Scene scene = load_forest("<bsdf type='diffuse'/>"), copy = flatten_instances(scene);
    const SceneView view = scene.view(), flat = copy.view();
    Random random(3);
    for (uint32_t i = 0; i < 4000; ++i) {
        const uint32_t prim = view.primitive_count() + random.index(view.instanced_count);
        float u = random.uniform(), v = random.uniform();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const SurfacePoint a = surface_at<F>(view, prim, u, v);
        const bool mirrored = view.instance_of(prim).mirrored;
        const SurfacePoint b = surface_at<F>(flat, id_in_copy(view, flat, prim), mirrored ? v : u, mirrored ? u : v);
        CHECK(close(a.p, b.p, 1e-6f));
        CHECK(close(a.ng, b.ng, 1e-5f));
        CHECK(close(a.ns, b.ns, 1e-5f));
        CHECK((a.p_error.x > b.p_error.x && a.p_error.y > b.p_error.y && a.p_error.z > b.p_error.z));
        CHECK(max_component(a.p_error) < 3e-5f);
        if (mirrored) continue;
        CHECK(std::memcmp(&a.p, &b.p, sizeof a.p) == 0);
        CHECK(std::memcmp(&a.dpdu, &b.dpdu, sizeof a.dpdu) == 0);
        CHECK((a.uv.x == b.uv.x && a.uv.y == b.uv.y));
    }
}

TEST_CASE("rays that leave a convex instance never meet it again, and those that enter it do") {
    const test::TempFolder folder;
    folder.write("ball.obj", ball(10, 14, 0));
    const std::string group =
        "<shape type='shapegroup' id='g'><shape type='obj'><string name='filename' value='ball.obj'/><boolean "
        "name='face_normals' value='true'/></shape></shape>";
    Random random(4);
    for (const char* place :
         {"<scale value='0.01'/><rotate x='1' y='2' angle='40'/><translate x='90' y='-60' z='30'/>",
          "<scale x='30' y='7' z='0.5'/><rotate x='1' z='2' angle='70'/><translate x='-10'/>",
          "<scale x='-2' y='2' z='2'/><rotate z='1' angle='10'/><translate z='50'/>", "<scale value='300'/>"}) {
        INFO(place);
        const Scene scene =
            test::load(group + placed("g", place) + placed("g", "<translate z='-5000'/>"), shared(), "3.0.0", &folder);
        const SceneView view = scene.view();
        const EmbreeAccel embree(scene);
        const CwbvhAccel cwbvh(scene);
        uint32_t again = 0, missed = 0;
        for (uint32_t i = 0; i < 6000; ++i) {
            const uint32_t prim = view.primitive_count() + random.index(scene.groups[0].triangle_count);
            float u = random.uniform(), v = random.uniform();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const SurfacePoint s = surface_at<F>(view, prim, u, v);
            const Vec4f r = random.next();
            const Vec3f w = normalize(frame_from_normal(s.ng).to_world(
                i % 2 ? square_to_cosine_hemisphere({r.x, r.y})
                      : normalize(Vec3f{cosf(9 * r.x), sinf(9 * r.x), 0.02f * r.y + 1e-3f})));
            const Ray out = {offset_ray_origin(s.p, s.p_error, s.ng, w), kInfinity, w, i},
                      in = {offset_ray_origin(s.p, s.p_error, s.ng, -w), kInfinity, -w, i};
            Hit hit;
            const auto same = [&] { return hit.prim != kNone && &view.instance_of(hit.prim) == view.instances; };
            embree.tracer().closest<F>(view, out, hit), again += same();
            cwbvh.tracer().closest<F>(view, out, hit), again += same();
            embree.tracer().closest<F>(view, in, hit), missed += !same();
            cwbvh.tracer().closest<F>(view, in, hit), missed += !same();
        }
        CHECK(again == 0);
        CHECK(missed <= 24);  // grazing: what lies within the offset
    }
}

TEST_CASE("a path tracer sees instances as it sees copies, sample by sample") {
    const Scene scene = load_forest(
        "<bsdf type='twosided'><bsdf type='roughconductor'><float name='alpha' value='0.3'/></bsdf></bsdf>");
    const Scene copy = flatten_instances(scene);
    Rules<UnidirectionalMis> rules = {};
    rules.max_depth = 6, rules.rr_depth = 100, rules.rr_cap = 0.95f;
    rules.count_hits = rules.count_environment = rules.next_event = true;
    const uint32_t width = 48, height = 40, spp = 4;
    const auto render = [&](const Scene& s) {
        const SceneView view = s.view();
        const EmbreeAccel accel(s);
        const EmbreeTracer tracer = accel.tracer();
        std::vector<Rgb> samples(size_t(width) * height * spp);
        parallel_for(samples.size(), [&](size_t i) {
            const uint32_t pixel = uint32_t(i / spp), s_index = uint32_t(i % spp);
            const PathSlot slot = {pixel % width, pixel / width, pixel, s_index, true};
            samples[i] = test::plain_sample<F>(view, tracer, rules, slot, {7, pixel, s_index, Stream::eye});
        });
        return samples;
    };
    const std::vector<Rgb> a = render(scene), b = render(copy);
    size_t different = 0;
    double sum = 0, expected = 0;
    for (size_t i = 0; i < a.size(); ++i) {
        sum += luminance(a[i]), expected += luminance(b[i]);
        different += std::fabs(luminance(a[i]) - luminance(b[i])) > 1e-3 * (luminance(b[i]) + 0.05);
    }
    CAPTURE(sum, expected, different, a.size());
    CHECK(expected > 0.01 * double(a.size()));
    CHECK(sum == Approx(expected).epsilon(0.01));
    CHECK(different <= a.size() / 50);
}
