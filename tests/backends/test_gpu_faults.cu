// libs: ambilux_cli ambilux_experiments ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_core
// labels: gpu
// wraps: cudaMalloc cudaMallocManaged cudaHostAlloc cudaStreamCreateWithFlags cudaGraphInstantiate cudaGraphAddNode
// wraps: cudaFree cudaFreeHost cudaStreamDestroy cudaGraphDestroy cudaGraphExecDestroy cudaStreamEndCapture
// wraps: cudaGraphConditionalHandleCreate cudaStreamBeginCapture cudaStreamBeginCaptureToGraph cudaGraphLaunch
// wraps: cudaLaunchKernel __cudaLaunchKernel cudaMemcpy cudaMemcpyAsync cudaMemset cudaMemsetAsync cudaGetLastError
// wraps: cudaStreamSynchronize cudaDeviceSynchronize cudaMemGetInfo
// Memory of a device that runs out at any allocation, and a device that is lost at any call: code 4, one message, no
// leak, what was finished is saved, and the next render works.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <map>

#include "backends/cuda/device_memory.h"
#include "cli/program.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "film/exr_io.h"
#include "tests/support/cuda_faults.h"
#include "tests/support/gpu_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// A render and all that is read from it.
void render_once(const Scene& scene, const RenderSettings& settings) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    const uint32_t done = renderer->render(0, 2);
    const FilmMoments film = renderer->film();
    if (done != 2 || film.samples != 2) throw std::logic_error("samples are missing and nothing was said");
    if (!renderer->device_image()) throw std::logic_error("no image on the device");
    renderer->strategy_images();
    renderer->stats();
}

struct Case {
    const char* name;
    std::vector<std::pair<const char*, const char*>> settings;

    bool has(std::string_view key, std::string_view value) const {
        return std::any_of(settings.begin(), settings.end(),
                           [&](const auto& s) { return s.first == key && s.second == value; });
    }
};

RenderSettings settings_of(const Scene& scene, const Case& c) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.backend = "cuda";
    s.wave_size = 4096;
    for (const auto& [key, value] : c.settings) apply_setting(s, key, value);
    return s;
}

/// Renders with a fault at its first call, at one `step` later, and so on until it has no more of them. Returns how
/// many it had.
long fail_everywhere(Fault fault, long step, const Scene& scene, const Case& c) {
    const RenderSettings settings = settings_of(scene, c);
    const auto work = [&] { render_once(scene, settings); };
    const char* const name = fault == Fault::lost ? "cudaErrorLaunchFailure" : "cudaErrorMemoryAllocation";
    const bool in_cub = c.has("compaction", "select");  // which has names of its own for what fails inside of it
    const bool managed = c.has("textures", "host");     // of which the driver may give back more than it had taken
    for (int i = 0; i < 3; ++i) work();                 // what is made once for all
    const uint64_t free_before = free_device_bytes();
    const long alive = cuda_faults.alive;
    for (long n = 0;; n += step) {
        CAPTURE(n);
        std::string message;
        bool other = false;
        cuda_faults.inject(fault, n);
        try {
            work();
        } catch (const Error& e) {
            message = e.what();
            other = e.code != ExitCode::device;
        } catch (const std::exception& e) {
            message = e.what();
            other = true;
        }
        cuda_faults.stop();
        cudaGetLastError();
        const bool begun = cuda_faults.begun;
        INFO(message);
        CHECK_FALSE(other);
        CHECK(begun == !message.empty());
        if (begun) CHECK(message.find(in_cub ? "cudaError" : name) != std::string::npos);
        REQUIRE(cuda_faults.alive == alive);
        if (!begun) {
            // `alive` counts to the object. What the driver keeps besides: a page or two of its own come and go; a leak
            // at each of some hundred faults would be more.
            constexpr uint64_t kPages = 2 * 65536;
            const uint64_t free_after = free_device_bytes();
            CHECK(free_after + kPages >= free_before);
            if (!managed) CHECK(free_after <= free_before + kPages);
            return n;
        }
    }
}

// Every integrator and variant, and every switch that takes memory or launches of its own.
const std::vector<Case> kCases = {
    {"path", {}},
    {"path, binary", {{"accel", "bvh2"}}},
    {"path, selected and sorted", {{"compaction", "select"}, {"ordering", "morton"}}},
    {"path, deterministic, by material", {{"deterministic", "true"}, {"ordering", "material"}}},
    {"path, textures on the host", {{"textures", "host"}}},
    {"path, textures pinned", {{"textures", "pinned"}}},
    {"light", {{"integrator", "light"}}},
    {"wavefront", {{"integrator", "bdpt"}}},
    {"wavefront, strategies", {{"integrator", "bdpt"}, {"technique_depth", "4"}}},
    {"lvc", {{"integrator", "bdpt"}, {"variant", "lvc"}}},
    {"megakernel", {{"integrator", "bdpt"}, {"variant", "megakernel"}}},
    {"streaming", {{"integrator", "bdpt"}, {"variant", "streaming"}}},
};

/// The program in this process, with its messages.
struct Outcome {
    int code;
    std::string messages;
};
Outcome run(const TempFolder& folder, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "ambilux");
    std::vector<const char*> argv;
    for (const std::string& a : arguments) argv.push_back(a.c_str());
    const std::string path = folder / ".err";
    std::fflush(stderr);
    const int kept = ::dup(STDERR_FILENO), file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    REQUIRE(kept >= 0);
    REQUIRE(file >= 0);
    ::dup2(file, STDERR_FILENO);
    const int code = run_program(int(argv.size()), argv.data());
    std::fflush(stderr);
    ::dup2(kept, STDERR_FILENO);
    ::close(file);
    ::close(kept);
    return {code, read_file(path)};
}

long lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

std::vector<std::string> render_arguments(const std::string& scene, const std::string& output,
                                          const std::vector<std::string>& more) {
    std::vector<std::string> all = {"--quiet", "render", scene, "-i",   "bdpt",  "--backend",      "cuda",
                                    "--size",  "32x24",  "-o",  output, "--set", "wave_size=1024", "--deterministic"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
}

std::string scene_path() {
    const char* folder = std::getenv("AMBILUX_SCENES");
    return (folder ? folder : AMBILUX_SOURCE_DIR "/scenes") + std::string("/cornell.xml");
}

}  // namespace

TEST_CASE("device memory runs out at any allocation of any render") {
    if (!device()) return;
    const Scene scene = project_scene("textured", 32, 24);
    for (const Case& c : kCases) {
        INFO(c.name);
        CHECK(fail_everywhere(Fault::memory, 1, scene, c) > 10);
    }
}

TEST_CASE("a selection by bdpt.auto survives or reports memory that runs out at any allocation") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 32, 24);
    RenderSettings s = settings_of(scene, {"auto", {{"integrator", "bdpt"}, {"bdpt.auto", "true"}}});
    const auto work = [&] { make_renderer(scene, s)->render(0, 2); };
    for (int i = 0; i < 3; ++i) work();
    const long alive = cuda_faults.alive;
    for (long n = 0; n == 0 || cuda_faults.begun; n += 5) {
        CAPTURE(n);
        cuda_faults.inject(Fault::memory, n);
        try {
            work();
        } catch (const Error& e) {
            CHECK(e.code == ExitCode::device);
        }
        cuda_faults.stop();
        cudaGetLastError();
        REQUIRE(cuda_faults.alive == alive);
    }
}

TEST_CASE("a device that is lost at any call ends the render by an exception, and leaks nothing") {
    if (!device()) return;
    const Scene scene = project_scene("textured", 32, 24);
    const std::pair<Case, long> cases[] = {
        {kCases[0], 1}, {kCases[2], 3}, {kCases[7], 3}, {{"kernel by kernel", {{"graph", "false"}}}, 3}};
    for (const auto& [c, step] : cases) {
        INFO(c.name);
        CHECK(fail_everywhere(Fault::lost, step, scene, c) > 40);
    }
}

TEST_CASE("the program ends with code 4 and one message, and the image holds the samples that were finished") {
    if (!device()) return;
    const TempFolder folder;
    const std::string exr = folder / "a.exr";
    const auto arguments = [&](const std::string& spp) { return render_arguments(scene_path(), exr, {"--spp", spp}); };
    for (int i = 0; i < 3; ++i) REQUIRE(run(folder, arguments("24")).code == 0);
    std::map<int, Image> whole;  // by samples
    int saved = 0;
    for (const Fault fault : {Fault::memory, Fault::lost})
        for (long n = 0;; n += fault == Fault::memory || n < 20 ? 1 : 3) {
            CAPTURE(fault == Fault::lost, n);
            std::filesystem::remove(exr);
            cuda_faults.inject(fault, n);
            const Outcome o = run(folder, arguments("24"));
            cuda_faults.stop();
            cudaGetLastError();
            INFO(o.messages);
            if (!cuda_faults.begun) {
                CHECK(o.code == 0);
                break;
            }
            REQUIRE(o.code == 4);
            CHECK(lines(o.messages) == 1);
            CHECK(o.messages.starts_with("error: "));
            CHECK(std::filesystem::exists(exr) == (o.messages.find("samples per pixel") != std::string::npos));
            if (!std::filesystem::exists(exr)) continue;
            ++saved;
            Attributes attributes;
            const Image image = read_exr(exr, &attributes);
            const int samples = attributes.at("spp").get<int>();
            if (!whole.contains(samples)) {
                const std::string other = folder / "b.exr";
                REQUIRE(run(folder, render_arguments(scene_path(), other, {"--spp", std::to_string(samples)})).code ==
                        0);
                whole[samples] = read_exr(other);
            }
            CHECK(bool(image.rgb == whole[samples].rgb));
        }
    CHECK(saved > 0);
}

TEST_CASE("after a fault a render by ranges goes on from its state, to the same bits") {
    if (!device()) return;
    const TempFolder folder;
    const std::string exr = folder / "a.exr", state = exr + ".state";
    const auto arguments = [&](std::vector<std::string> more) {
        more.insert(more.end(), {"--spp", "24", "--range-size", "4", "--devices", "0"});
        return render_arguments(scene_path(), exr, more);
    };
    for (int i = 0; i < 3; ++i) REQUIRE(run(folder, arguments({})).code == 0);
    const Image whole = read_exr(exr);
    int resumed = 0;
    for (long n = 0;; n += n < 20 ? 1 : 3) {
        CAPTURE(n);
        cuda_faults.inject(Fault::lost, n);
        const Outcome o = run(folder, arguments({}));
        cuda_faults.stop();
        INFO(o.messages);
        if (!cuda_faults.begun) {
            CHECK(o.code == 0);
            break;
        }
        REQUIRE(o.code == 4);
        CHECK(lines(o.messages) == 1);
        const bool kept = std::filesystem::exists(state);
        CHECK(kept == (o.messages.find("--resume goes on") != std::string::npos));
        if (!kept) continue;
        ++resumed;
        const Outcome next = run(folder, arguments({"--resume"}));
        INFO(next.messages);
        REQUIRE(next.code == 0);
        CHECK(bool(read_exr(exr).rgb == whole.rgb));
        CHECK_FALSE(std::filesystem::exists(state));
    }
    CHECK(resumed > 0);
}
