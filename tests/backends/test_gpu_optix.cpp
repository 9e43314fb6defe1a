// libs: ambilux_backends ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 900
// OptiX against our own traversal on the same device: hits of the same rays, with what sets them apart.
#include <cmath>
#include <map>

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

/// Rays that two tracers answer differently, by why.
struct Differences {
    uint64_t rays = 0, hits = 0;
    uint64_t ties = 0;   ///< another primitive at the same distance: coincident surfaces, shared edges
    uint64_t edges = 0;  ///< one of them meets a triangle at its edge, the other passes it
    uint64_t ends = 0;   ///< a hit that lies where the ray begins or ends
    uint64_t other = 0;
    uint64_t other_bits = 0;  ///< the same primitive within rounding, in other bits

    uint64_t all() const { return edges + ends + other; }
    std::string text() const {
        return std::to_string(rays) + " rays, " + std::to_string(hits) + " hits: " + std::to_string(ties) +
               " ties, different: " + std::to_string(edges) + " at edges, " + std::to_string(ends) + " at ends, " +
               std::to_string(other) + " others; " + std::to_string(other_bits) + " hits in other bits";
    }
    Differences& operator+=(const Differences& d) {
        rays += d.rays, hits += d.hits, ties += d.ties, edges += d.edges, ends += d.ends, other += d.other;
        other_bits += d.other_bits;
        return *this;
    }
};

bool at_edge(const SceneView& view, const Hit& hit) {
    if (hit.prim == kNone) return false;
    if (!view.is_triangle(view.stored(hit.prim))) return false;
    return std::min({hit.u, hit.v, 1.0f - hit.u - hit.v}) < 1e-3f;
}
/// Where a ray begins or ends, as far as its crossing with a surface is known.
bool at_end(const SceneView& view, const Ray& ray, const Hit& hit) {
    if (hit.prim == kNone) return false;
    const float bound = t_tolerance(view, ray, hit);
    return hit.t <= bound || std::fabs(ray.tmax - hit.t) <= bound;
}

void compare(const SceneView& view, const Ray& ray, const Hit& own, const Hit& optix, Differences& d) {
    ++d.rays;
    d.hits += own.prim != kNone;
    if (own.prim == optix.prim && own.prim == kNone) return;
    const bool both = own.prim != kNone && optix.prim != kNone;
    const bool close = both && std::fabs(own.t - optix.t) <= t_tolerance(view, ray, own);
    if (close && own.prim == optix.prim)
        d.other_bits += own.t != optix.t || own.u != optix.u || own.v != optix.v;
    else if (close)
        ++d.ties;
    else if (at_edge(view, own) || at_edge(view, optix))
        ++d.edges;
    else if (at_end(view, ray, own) || at_end(view, ray, optix))
        ++d.ends;
    else if (++d.other <= 5)
        UNSCOPED_INFO("ray o " << ray.o.x << " " << ray.o.y << " " << ray.o.z << " d " << ray.d.x << " " << ray.d.y
                               << " " << ray.d.z << " tmax " << ray.tmax << ": own " << own.prim << " at " << own.t
                               << ", OptiX " << optix.prim << " at " << optix.t);
}

/// Nearest hits, and answers whether there is any, of which those that differ count in `any`.
Differences compare_tracers(const Scene& scene, const std::vector<Ray>& rays, uint64_t& any) {
    const SceneView view = scene.view();
    const std::vector<Hit> own = trace_on_device(scene, rays, false, true),
                           own_any = trace_on_device(scene, rays, true, true);
    const OptixAnswers optix = trace_by_optix(scene, rays, false), optix_any = trace_by_optix(scene, rays, true);
    CHECK(optix.peak_bytes <= optix.predicted_peak_bytes);
    Differences d;
    REQUIRE(optix.hits.size() == rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
        compare(view, rays[i], own[i], optix.hits[i], d);
        any += (own_any[i].prim != kNone) != (optix_any.hits[i].prim != kNone);
    }
    return d;
}

void check(const std::string& name, const Scene& scene, const std::vector<Ray>& rays) {
    uint64_t any = 0;
    const Differences d = compare_tracers(scene, rays, any);
    WARN(name << ": " << d.text() << ", " << any << " other answers whether anything is hit");
    CHECK(double(d.all()) <= 1e-5 * double(d.rays));
    CHECK(double(any) <= 1e-5 * double(d.rays));
    CHECK(double(d.other) <= 1e-6 * double(d.rays));
    CHECK(double(d.ties) <= 1e-3 * double(d.rays));
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
    Differences all;
    uint64_t all_any = 0;
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured", "mirror_caustic"}) {
        const Scene scene = project_scene(name);
        const CwbvhAccel accel(scene);
        const std::vector<RayBatch> batches = with_traversal_features(scene.features, [&](auto set) {
            return make_ray_batches<set.value>(scene.view(), accel.tracer(), size, 0);
        });
        Differences of_scene;
        uint64_t any = 0;
        for (const RayBatch& batch : batches) of_scene += compare_tracers(scene, batch.rays, any);
        WARN(name << ": " << of_scene.text() << ", " << any << " other answers whether anything is hit");
        all += of_scene;
        all_any += any;
    }
    WARN("all: " << all.text() << ", " << all_any << " other answers whether anything is hit");
    CHECK(double(all.all()) <= 1e-5 * double(all.rays));
    CHECK(double(all_any) <= 1e-5 * double(all.rays));
}

TEST_CASE("What OptiX takes of a device is what is said") {
    if (!optix()) return;
    const Scene scene = triangle_soup(1000000, 0.02f, 1.0f, 12);
    const OptixAnswers answers = trace_by_optix(scene, test_rays(scene, 1 << 20, 1.0f, 3), false);
    CHECK(answers.peak_bytes <= answers.predicted_peak_bytes);
    WARN("structure and stacks: " << answers.bytes << " bytes are counted, " << answers.taken_bytes
                                  << " are gone from the device; peak " << answers.peak_bytes << " of "
                                  << answers.predicted_peak_bytes << " predicted");
}
