// libs: ambilux_backends ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 900
// OptiX against our own traversal on the same device: hits of the same rays, with what sets them apart.
#include <fmt/format.h>

#include <cmath>

#include "accel/cwbvh.h"
#include "backends/ray_batches.h"
#include "backends/trace_on_device.h"
#include "backends/traversal_features.h"
#include "tests/support/disk_rays.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/long_run.h"
#include "tests/support/optix_device.h"
#include "tests/support/render_scene.h"
#include "tests/support/traversal_rays.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

/// Rays by how two tracers answer.
struct Differences {
    uint64_t rays = 0;
    uint64_t bits = 0;  ///< the same primitive within rounding, in other bits
    uint64_t ties = 0;  ///< another primitive at the same distance: coincident surfaces, shared edges
    // Different ones: one of them meets a triangle at its edge, or where the ray begins or ends, or neither.
    uint64_t edges = 0, ends = 0, others = 0;
    uint64_t any = 0;  ///< other answers whether anything is hit

    std::string text() const {
        return fmt::format(
            "{} rays: {} hits in other bits, {} ties; different: {} at edges, {} at ends, {} others; "
            "{} other answers whether anything is hit",
            rays, bits, ties, edges, ends, others, any);
    }
};

bool is_hit(const SceneView& view, const Hit& hit) { return hit.prim < view.primitive_count() + view.instanced_count; }
/// Nearer to an edge than either test knows the crossing.
bool at_edge(const SceneView& view, const Ray& ray, const Hit& hit) {
    if (!is_hit(view, hit) || !view.is_triangle(view.stored(hit.prim))) return false;
    const Triangle t = view.triangles[view.stored(hit.prim)];
    const Vec3f v[3] = {view.vertices[t.v0].p, view.vertices[t.v1].p, view.vertices[t.v2].p};
    const float area = length(cross(v[1] - v[0], v[2] - v[0])), b[3] = {1.0f - hit.u - hit.v, hit.u, hit.v};
    for (int i = 0; i < 3; ++i)
        if (b[i] < 1e-3f || b[i] * area <= t_tolerance(view, ray, hit) * length(v[(i + 1) % 3] - v[(i + 2) % 3]))
            return true;
    return false;
}
/// As far as the crossing is known.
bool at_end(const SceneView& view, const Ray& ray, const Hit& hit) {
    if (!is_hit(view, hit)) return false;
    const float bound = t_tolerance(view, ray, hit);
    return hit.t <= bound || std::fabs(ray.tmax - hit.t) <= bound;
}

void compare(const SceneView& view, const Ray& ray, const Hit& own, const Hit& optix, Differences& d) {
    ++d.rays;
    if (own.prim == kNone && optix.prim == kNone) return;
    const bool close =
        is_hit(view, own) && is_hit(view, optix) && std::fabs(own.t - optix.t) <= t_tolerance(view, ray, own);
    if (close && own.prim == optix.prim)
        d.bits += own.t != optix.t || own.u != optix.u || own.v != optix.v;
    else if (close)
        ++d.ties;
    else if (at_edge(view, ray, own) || at_edge(view, ray, optix))
        ++d.edges;
    else if (at_end(view, ray, own) || at_end(view, ray, optix))
        ++d.ends;
    else if (++d.others <= 3)
        WARN(fmt::format("ray o {} {} {} d {} {} {} tmax {}: own {} at {}, OptiX {} at {}", ray.o.x, ray.o.y, ray.o.z,
                         ray.d.x, ray.d.y, ray.d.z, ray.tmax, own.prim, own.t, optix.prim, optix.t));
}

/// Nearest hits, and answers whether there is any.
void compare(const Scene& scene, const std::vector<Ray>& rays, Differences& d) {
    const SceneView view = scene.view();
    const std::vector<Hit> own = trace_on_device(scene, rays, false, true),
                           own_any = trace_on_device(scene, rays, true, true),
                           optix = trace_by_optix(scene, rays, false).hits,
                           optix_any = trace_by_optix(scene, rays, true).hits;
    REQUIRE(optix.size() == rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
        compare(view, rays[i], own[i], optix[i], d);
        d.any += (own_any[i].prim != kNone) != (optix_any[i].prim != kNone);
    }
}

void check(const std::string& name, const Scene& scene, const std::vector<Ray>& rays) {
    Differences d;
    compare(scene, rays, d);
    WARN(name << ": " << d.text());
    // Many of these rays go to an edge or a vertex, of which one test may say inside and the other outside.
    CHECK(double(d.others) <= 1e-6 * double(d.rays));
    CHECK(double(d.ends) <= 1e-5 * double(d.rays));
    CHECK(d.any <= d.edges + d.ends + d.others);
}

}  // namespace

TEST_CASE("OptiX meets what our own traversal meets: triangles of all sizes, shapes, all together") {
    if (!optix()) return;
    const uint32_t count = is_long_run() ? 4000000 : 400000;
    for (const float scale : {1e-4f, 1.0f, 1e4f}) {
        const std::string of = " of size " + std::to_string(scale);
        const Scene soup = triangle_soup(3000, 0.3f, scale, 7);
        check("triangles" + of, soup, test_rays(soup, count, scale, 31));
        Scene quadrics;
        add_random_quadrics(quadrics, 60, scale, 5);
        check("shapes" + of, quadrics, test_rays(quadrics, count, scale, 34));
    }
    Scene box, mixed = triangle_soup(500, 0.3f, 1.0f, 9);
    add_box(box, 1.0f, 16);
    check("box", box, test_rays(box, count, 1.0f, 32));
    add_random_quadrics(mixed, 60, 1.0f, 6);
    check("triangles and shapes", mixed, test_rays(mixed, count, 1.0f, 35));
    check("nothing", Scene(), test_rays(Scene(), 1000, 1.0f, 37));
}

TEST_CASE("No ray leaves a closed mesh through its edges and vertices with OptiX") {
    if (!optix()) return;
    Scene ball;
    add_ball(ball, {0, 0, 0}, 1.0f, 40, 0.1f, 3);
    Random random(77);
    std::vector<Ray> rays;
    for (uint32_t i = 0; i < 1000000; ++i) {
        const Triangle t = ball.triangles[random.index(uint32_t(ball.triangles.size()))];
        const float u = i % 2 ? random.uniform() : 0.0f;
        const Vec3f o = random.in_box(0.3f), to = ball.vertices[t.v0].p * (1 - u) + ball.vertices[t.v1].p * u;
        rays.push_back({o, kInfinity, normalize(to - o), i});
    }
    uint64_t escaped = 0;
    for (const bool any_hit : {false, true})
        for (const Hit& hit : trace_by_optix(ball, rays, any_hit).hits) escaped += hit.prim == kNone;
    CHECK(escaped == 0);
}

TEST_CASE("With OptiX a disk blocks no shadow ray that ends on it, and every one that goes through it") {
    if (!optix()) return;
    const DiskRays disk = rays_that_end_on_a_disk(200000, 51);
    const std::vector<Hit> hits = trace_by_optix(disk.scene, disk.rays, true).hits;
    int different = 0;
    for (size_t i = 0; i < hits.size(); ++i) different += (hits[i].prim != kNone) != disk.behind[i];
    CHECK(different == 0);
}

TEST_CASE("OptiX meets instances, with holes and without, and masked shapes") {
    if (!optix()) return;
    const std::vector<Ray> rays = test::rays_around(is_long_run() ? 4000000 : 400000, 5);
    for (const char* bsdf : {"<bsdf type='diffuse'/>", test::kMaskBsdf})
        check(std::string("forest, ") + bsdf, test::load_forest(bsdf), rays);
    Scene masked = triangle_soup(2000, 0.3f, 1.0f, 10);
    add_random_quadrics(masked, 30, 1.0f, 11);
    masked.materials[0].opacity = {0.5f, -1};
    masked.features.opacity = true;
    check("masked triangles and shapes", masked, test_rays(masked, 400000, 1.0f, 36));
}

TEST_CASE("OptiX meets what our own traversal meets: rays of paths through scenes of the project") {
    if (!optix()) return;
    const uint32_t size = is_long_run() ? 2048 : 256;
    Differences d;
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured", "mirror_caustic"}) {
        const Scene scene = project_scene(name);
        const CwbvhAccel accel(scene);
        const std::vector<RayBatch> batches = with_traversal_features(scene.features, [&](auto set) {
            return make_ray_batches<set.value>(scene.view(), accel.tracer(), size, 0);
        });
        for (const RayBatch& batch : batches) compare(scene, batch.rays, d);
        WARN("up to " << name << ": " << d.text());
    }
    CHECK(double(d.edges + d.ends + d.others) <= 1e-5 * double(d.rays));
    CHECK(double(d.any) <= 1e-5 * double(d.rays));
}

TEST_CASE("What OptiX takes of a device is what is said") {
    if (!optix()) return;
    const Scene scene = triangle_soup(1000000, 0.02f, 1.0f, 12);
    const OptixAnswers a = trace_by_optix(scene, test_rays(scene, 1 << 20, 1.0f, 3), false);
    CHECK(a.facts.peak_bytes <= a.facts.predicted_peak_bytes);
    WARN(fmt::format("structure and stacks: {} bytes are counted, {} are gone from the device; peak {} of {} predicted",
                     a.facts.bytes, a.taken_bytes, a.facts.peak_bytes, a.facts.predicted_peak_bytes));
}
