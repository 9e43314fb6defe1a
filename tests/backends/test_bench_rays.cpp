// libs: ambilux_backends ambilux_formats ambilux_accel ambilux_core
// The batches of `bench rays` and what it reports about them on the CPU.
#include <cmath>
#include <map>
#include <thread>

#include "accel/cwbvh.h"
#include "backends/bench_rays.h"
#include "backends/ray_batches.h"
#include "backends/traversal_features.h"
#include "core/error.h"
#include "formats/load.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

Scene cornell() { return load_mitsuba(std::string(AMBILUX_SOURCE_DIR) + "/scenes/cornell.xml"); }

constexpr uint32_t kSize = 128;

struct Batches {
    Scene scene = cornell();
    CwbvhAccel accel{scene};
    std::vector<RayBatch> make(uint64_t seed) const {
        return make_ray_batches<kOpaqueTriangles>(scene.view(), accel.tracer(), kSize, seed);
    }
};

bool equal(const Ray& a, const Ray& b) {
    return a.o == b.o && a.d == b.d && float_bits(a.tmax) == float_bits(b.tmax) && a.alpha_seed == b.alpha_seed;
}

}  // namespace

TEST_CASE("Primary rays go through jittered pixels in Morton order") {
    const Batches b;
    const std::vector<RayBatch> batches = b.make(1);
    REQUIRE(batches.size() == 8);
    CHECK(batches[0].name == "primary");
    CHECK(batches[0].coherent);
    const std::vector<Ray>& rays = batches[0].rays;
    REQUIRE(rays.size() == kSize * kSize);
    // The camera of cornell.xml looks along -z from (0,0,3.9) with a field of view of 39 degrees; +x is right, +y up.
    const float tangent = tanf(degrees_to_radians(19.5f));
    double sum = 0, sum_squares = 0;
    for (uint32_t i = 0; i < rays.size(); ++i) {
        const float x = (rays[i].d.x / -rays[i].d.z / tangent + 1) * 0.5f * kSize;
        const float y = (1 - rays[i].d.y / -rays[i].d.z / tangent) * 0.5f * kSize;
        uint32_t pixel_x = 0, pixel_y = 0;
        for (uint32_t bit = 0; bit < 7; ++bit)
            pixel_x |= (i >> (2 * bit) & 1) << bit, pixel_y |= (i >> (2 * bit + 1) & 1) << bit;
        const float jitter_x = x - float(pixel_x), jitter_y = y - float(pixel_y);
        if (!(fabsf(jitter_x - 0.5f) <= 0.501f && fabsf(jitter_y - 0.5f) <= 0.501f))
            FAIL("ray " << i << " is at " << x << " " << y);
        sum += jitter_x + jitter_y;
        sum_squares += jitter_x * jitter_x + jitter_y * jitter_y;
    }
    // Means of n uniform numbers and of their squares: variances 1/12 and 4/45.
    const double n = 2.0 * double(rays.size());
    CHECK(std::fabs(sum / n - 0.5) < 5 * std::sqrt(1.0 / 12 / n));
    CHECK(std::fabs(sum_squares / n - 1.0 / 3) < 5 * std::sqrt(4.0 / 45 / n));
}

TEST_CASE("Bounced rays leave what the rays before them met, cosine-weighted, and escaped paths are left out") {
    const Batches b;
    const SceneView view = b.scene.view();
    const std::vector<RayBatch> batches = b.make(2);
    CHECK(batches[1].name == "bounce 1");
    CHECK(batches[2].name == "bounce 3");
    const float diagonal = detail::scene_diagonal(view);
    CHECK(diagonal == Approx(2 * sqrtf(3.0f)).epsilon(0.01));
    size_t next = 0;
    double sum = 0;
    for (const Ray& ray : batches[0].rays) {
        Hit hit;
        if (!b.accel.tracer().closest<kOpaqueTriangles>(view, ray, hit)) continue;
        REQUIRE(next < batches[1].rays.size());
        const Ray& bounced = batches[1].rays[next++];
        const SurfacePoint s = surface_at<kOpaqueTriangles>(view, hit.prim, hit.u, hit.v);
        const Vec3f n = dot(s.ng, ray.d) > 0 ? -s.ng : s.ng;
        const float height = dot(bounced.o - s.p, n);
        if (!(fabsf(height - 1e-5f * diagonal) < 2e-6f && length(bounced.o - s.p) < 5e-5f))
            FAIL("origin " << next << " is " << height << " off the surface");
        const float cosine = dot(bounced.d, n);
        if (!(cosine > 0) || fabsf(length(bounced.d) - 1) > 1e-5f) FAIL("direction " << next);
        sum += cosine;
    }
    CHECK(next == batches[1].rays.size());
    // The cosine c has density 2c: mean 2/3, variance 1/18.
    CHECK(std::fabs(sum / double(next) - 2.0 / 3) < 5 * std::sqrt(1.0 / 18 / double(next)));
    CHECK(batches[2].rays.size() < batches[1].rays.size());
    CHECK(batches[2].rays.size() > batches[1].rays.size() / 2);
}

TEST_CASE("Shadow rays end just before the surfaces that they connect") {
    const Batches b;
    const SceneView view = b.scene.view();
    const RayBatch shadow = b.make(3)[3];
    CHECK(shadow.name == "shadow");
    CHECK(shadow.any_hit);
    REQUIRE(shadow.rays.size() == kSize * kSize);
    const float diagonal = detail::scene_diagonal(view);
    uint64_t free = 0, ends = 0;
    for (const Ray& ray : shadow.rays) {
        if (b.accel.tracer().occluded<kOpaqueTriangles>(view, ray)) continue;
        ++free;
        // A little farther there is the surface that the segment was drawn to, unless the ray slips past the border of
        // an open mesh.
        const float end = ray.tmax / 0.9999f;
        const Ray longer = {ray.o, end + 100 * 1e-5f * diagonal, ray.d, ray.alpha_seed};
        ends += b.accel.tracer().occluded<kOpaqueTriangles>(view, longer);
    }
    CHECK(free > shadow.rays.size() / 4);
    CHECK(double(ends) > 0.98 * double(free));
}

TEST_CASE("Rays to emitters leave first and third hits and, where nothing is in the way, end just before a lamp") {
    const Batches b;
    const std::vector<RayBatch> batches = b.make(6);
    CHECK(batches[4].name == "to emitters");
    CHECK(batches[5].name == "to emitters 3");
    const SceneView view = b.scene.view();
    for (const RayBatch* batch : {&batches[4], &batches[5]}) {
        INFO(batch->name);
        CHECK(batch->any_hit);
        CHECK(batch->rays.size() > kSize * kSize / 4);
        uint64_t free = 0, lamps = 0;
        for (const Ray& ray : batch->rays) {
            if (b.accel.tracer().occluded<kOpaqueTriangles>(view, ray)) continue;
            ++free;
            Hit hit;
            if (!b.accel.tracer().closest<kOpaqueTriangles>(view, {ray.o, kInfinity, ray.d, 0}, hit)) continue;
            lamps += b.scene.shapes[view.shape_of(hit.prim)].emitter != kNone;
        }
        CHECK(free > batch->rays.size() / 4);
        CHECK(double(lamps) > 0.99 * double(free));
    }
    CHECK(batches[5].rays.size() < batches[4].rays.size());
}

TEST_CASE("Rays from emitters begin at a lamp, and bounce where they end") {
    const Batches b;
    const std::vector<RayBatch> batches = b.make(7);
    CHECK(batches[6].name == "from emitters");
    CHECK(batches[7].name == "light bounce");
    REQUIRE(batches[6].rays.size() == kSize * kSize);
    CHECK(batches[7].rays.size() < batches[6].rays.size());
    CHECK(batches[7].rays.size() > batches[6].rays.size() / 2);
    // Turned round, a ray meets the lamp at once, unless it leaves along it past its border.
    const SceneView view = b.scene.view();
    uint64_t lamps = 0;
    for (const Ray& ray : batches[6].rays) {
        Hit hit;
        if (b.accel.tracer().closest<kOpaqueTriangles>(view, {ray.o, kInfinity, -ray.d, 0}, hit))
            lamps += b.scene.shapes[view.shape_of(hit.prim)].emitter != kNone;
    }
    CHECK(double(lamps) > 0.995 * double(batches[6].rays.size()));
}

TEST_CASE("Batches are a function of the seed") {
    const Batches b;
    const std::vector<RayBatch> first = b.make(4), again = b.make(4), other = b.make(5);
    for (size_t i = 0; i < first.size(); ++i) {
        INFO(first[i].name);
        REQUIRE(first[i].rays.size() == again[i].rays.size());
        uint64_t same = 0, common = 0;
        for (size_t k = 0; k < first[i].rays.size(); ++k) {
            same += equal(first[i].rays[k], again[i].rays[k]);
            common += k < other[i].rays.size() && equal(first[i].rays[k], other[i].rays[k]);
        }
        CHECK(same == first[i].rays.size());
        CHECK(common == 0);
    }
}

TEST_CASE("the median is the middle of times, or the mean of the two in the middle") {
    CHECK(median({3}) == 3);
    CHECK(median({5, 1}) == 3);
    CHECK(median({9, 1, 2}) == 2);
    CHECK(median({8, 1, 3, 2}) == 2.5);
}

TEST_CASE("runs are timed one by one, after three that do not count") {
    for (const int repetitions : {1, 5}) {
        CAPTURE(repetitions);
        int runs = 0;
        const std::vector<double> seconds = seconds_of_runs(repetitions, [&] {
            if (++runs > 3) std::this_thread::sleep_for(std::chrono::milliseconds(2));
        });
        CHECK(runs == 3 + repetitions);
        CHECK(seconds.size() == size_t(repetitions));
        for (const double s : seconds) CHECK(s >= 0.002);
    }
    int runs = 0;
    CHECK(runs_that_count(2, [&] { return ++runs; }) == std::vector<int>{4, 5});
}

TEST_CASE("rays are traced by the least set of features that a scene needs, of those that there are") {
    constexpr uint32_t kTriangle = bit(PrimitiveType::triangle), kSphere = bit(PrimitiveType::sphere);
    const auto traced = [](uint32_t primitives, bool opacity, bool instances) {
        Features features;
        features.primitives = primitives;
        features.opacity = opacity;
        features.instances = instances;
        return with_traversal_features(features, [](auto set) -> Features { return set.value; });
    };
    CHECK(traced(kTriangle, false, false) == kOpaqueTriangles);
    CHECK(traced(kTriangle, true, false) == kMaskedTriangles);
    for (const uint32_t shapes : {kSphere, kTriangle | kSphere}) {
        CHECK(traced(shapes, false, false) == kOpaqueShapes);
        CHECK(traced(shapes, true, false) == kAllFeatures);
        CHECK(traced(shapes, false, true) == kOpaqueInstances);
        CHECK(traced(shapes, true, true) == kAllFeatures);
    }
    CHECK(traced(kTriangle, false, true) == kOpaqueInstances);
    CHECK(traced(kTriangle, true, true) == kAllFeatures);
    // Kernels of few features.
    const auto some = [](const Features& features) {
        return with_traversal_features<kMaskedTriangles>(features, [](auto set) -> Features { return set.value; });
    };
    CHECK(some(kOpaqueTriangles) == kOpaqueTriangles);
    CHECK(some(kMaskedTriangles) == kMaskedTriangles);
    CHECK_THROWS_AS(some(kOpaqueShapes), std::logic_error);
    CHECK_THROWS_AS(some(kOpaqueInstances), std::logic_error);
    constexpr Features kNoInstances = {0, 0, kAllFeatures.primitives, true, false, true};
    const auto shapes = [](const Features& features) {
        return with_traversal_features<kNoInstances>(features, [](auto set) -> Features { return set.value; });
    };
    Features masked = kOpaqueShapes;
    masked.opacity = true;
    CHECK(shapes(kOpaqueShapes) == kOpaqueShapes);
    CHECK(shapes(masked) == kNoInstances);
    masked.instances = true;
    CHECK_THROWS_AS(shapes(masked), std::logic_error);
}

TEST_CASE("bench rays reports complete rows on the CPU, and all structures find the same") {
    const Scene scene = cornell();
    std::map<std::string, double> hit;
    for (const std::string backend : {"cpu", "cpu-single", "cpu-cwbvh", "cpu-fast", "cpu-bvh2"}) {
        INFO(backend);
        const nlohmann::json json = bench_rays(scene, backend, 1);
        CHECK(json.at("backend") == backend);
        CHECK(json.at("accel") == (backend == "cpu" || backend == "cpu-single" ? "embree"
                                   : backend == "cpu-bvh2"                     ? "bvh2"
                                                                               : "cwbvh"));
        CHECK_FALSE(json.at("device").get<std::string>().empty());
        CHECK(json.at("build_seconds") > 0.0);
        CHECK(json.at("accel_bytes") > 1000);
        CHECK(json.at("repetitions") == 1);
        const nlohmann::json& rows = json.at("rows");
        REQUIRE(rows.size() == 8);
        for (const nlohmann::json& row : rows) {
            CHECK(row.size() == 6);
            const std::string batch = row.at("batch");
            INFO(batch);
            CHECK(row.at("kernel") == json.at("accel"));
            CHECK(row.at("mrays_per_s") > 0.01);
            const uint64_t count = row.at("count");
            const double fraction = row.at("hit");
            CHECK(count <= 512 * 512);
            if (batch == "primary" || batch == "shadow") CHECK(count == 512 * 512);
            // Half of the box is open: most rays from inside meet something, many pairs of points see each other.
            const bool segments = batch == "shadow" || batch.starts_with("to emitters");
            CHECK(fraction > (segments ? 0.02 : 0.5));
            CHECK(fraction < (segments ? 0.7 : 1.001));
            if (backend == "cpu")
                hit[batch] = fraction;
            else
                CHECK(std::fabs(fraction - hit.at(batch)) < 0.005);
        }
        CHECK(uint64_t(rows[1].at("count")) ==
              uint64_t(std::llround(double(rows[0].at("hit")) * double(rows[0].at("count")))));
    }
}

TEST_CASE("bench rays of a scene without surfaces has rows of nothing, as often as was asked for") {
    int repetitions = 1;
    for (const std::string backend : {"cpu-cwbvh", "cpu", "cpu-single", "cpu-bvh2", "cpu-fast"}) {
        INFO(backend);
        const nlohmann::json json = bench_rays(Scene{}, backend, repetitions);
        CHECK(json.size() == 8);
        CHECK(json.at("repetitions") == repetitions++);
        REQUIRE(json.at("rows").size() == 8);
        for (const nlohmann::json& row : json.at("rows")) CHECK(row.at("hit") == 0.0);
        CHECK(json.at("rows")[1].at("count") == 0);
        for (int row = 3; row < 8; ++row) CHECK(json.at("rows")[row].at("count") == 0);
    }
}

TEST_CASE("bench rays takes surfaces of partial opacity as opaque if asked to") {
    Scene scene = cornell();
    for (Material& material : scene.materials) material.opacity = {0.25f, -1};
    scene.features.opacity = true;
    const nlohmann::json some = bench_rays(scene, "cpu-cwbvh", 1), all = bench_rays(scene, "cpu-cwbvh", 1, true);
    CHECK(some.at("opaque") == false);
    CHECK(all.at("opaque") == true);
    CHECK(double(all.at("rows")[0].at("hit")) > 1.2 * double(some.at("rows")[0].at("hit")));
}

TEST_CASE("bench rays refuses what it does not know") {
    const Scene scene;
    std::string message;
    try {
        bench_rays(scene, "vulkan", 1);
    } catch (const Error& error) {
        CHECK(error.code == ExitCode::usage);
        message = error.what();
    }
    CHECK(message.find("'vulkan'") != std::string::npos);
    CHECK(message.find("cpu-cwbvh") != std::string::npos);
    CHECK_THROWS_AS(bench_rays(scene, "cpu", 0), Error);
}
