// libs: ambilux_session
// labels: gpu
// timeout: 300
// One render on several CUDA devices, or several times on one: the same bits where they are asked for, else the same
// estimate.
#include "backends/cuda_device.h"
#include "core/error.h"
#include "film/ztest.h"
#include "session/parallel/parallel_render.h"
#include "tests/support/gpu_device.h"
#include "tests/support/optix_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

ParallelRequest request_for(const Scene& scene, const test::TempFolder& folder, const std::string& variant) {
    ParallelRequest request;
    request.settings.max_depth = scene.integrator.max_depth;
    request.settings.rr_depth = scene.integrator.rr_depth;
    apply_setting(request.settings, "integrator", "bdpt");
    apply_setting(request.settings, "variant", variant);
    request.settings.seed = 3;
    request.budget = {200, 0};
    request.range_size = 16;
    request.state_path = folder / "state";
    return request;
}

/// Two workers on the first device, and one on each where there are two.
std::vector<std::vector<std::string>> many() {
    std::vector<std::vector<std::string>> devices = {{"0", "0"}};
    if (cuda_device_count() > 1) devices.push_back({"0", "1"});
    return devices;
}

}  // namespace

TEST_CASE("deterministic renders have the same bits on one device and on several") {
    if (!device()) return;
    const Scene scene = project_scene("glass", 160, 120);
    const test::TempFolder folder;
    ParallelRequest request = request_for(scene, folder, "wavefront");
    request.settings.deterministic = true;
    request.devices = {"0"};
    const FilmMoments one = render_parallel(scene, request, ranks()).film;
    for (const auto& devices : many()) {
        request.devices = devices;
        const ParallelResult result = render_parallel(scene, request, ranks());
        CAPTURE(devices, result.stats.device);
        CHECK(bool(result.film.sum == one.sum));
        CHECK(bool(result.film.sum_squares == one.sum_squares));
        for (const WorkerShare& w : result.workers) CHECK(w.samples > 0);
    }
}

namespace {

/// On several devices as on one, in the expectation.
void check_same_estimate(ParallelRequest request, const Scene& scene) {
    request.budget.samples = 2000;
    request.range_size = 100;
    request.devices = {"0"};
    const FilmMoments one = render_parallel(scene, request, ranks()).film;
    request.settings.seed = 4;
    for (const auto& devices : many()) {
        request.devices = devices;
        const ZTestResult z = z_test(to_estimate(render_parallel(scene, request, ranks()).film), to_estimate(one));
        INFO(z.report());
        CHECK(z.pass);
    }
}

}  // namespace

TEST_CASE("lvc with a cache on each device is the same estimate") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 64, 48);
    const test::TempFolder folder;
    check_same_estimate(request_for(scene, folder, "lvc"), scene);
}

TEST_CASE("OptiX with a structure on each device is the same estimate") {
    if (!optix()) return;
    const Scene scene = project_scene("cornell", 64, 48);
    const test::TempFolder folder;
    ParallelRequest request = request_for(scene, folder, "wavefront");
    request.settings.accel = AccelKind::optix;
    check_same_estimate(request, scene);
}

TEST_CASE("a device that is not there is named") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 16, 16);
    const test::TempFolder folder;
    ParallelRequest request = request_for(scene, folder, "wavefront");
    request.devices = {"0", "99"};
    try {
        render_parallel(scene, request, ranks());
        FAIL("it was not refused");
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::device);
        CHECK(std::string(e.what()).find("CUDA device 99 is not there") != std::string::npos);
    }
}
