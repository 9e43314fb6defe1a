// A process of known mean and variance in the renderer's place, and what tests of experiments share.
#pragma once

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/rng.h"
#include "experiments/runner.h"
#include "formats/load.h"
#include "session/drive.h"
#include "tests/support/catch.h"
#include "tests/support/result_rows.h"
#include "tests/support/temp_folder.h"

namespace ambilux::test {

namespace fs = std::filesystem;

/// What the fakes of a test share.
struct World {
    double sleep_per_sample = 0;  ///< seconds
    uint32_t batch = 3;
    int kill_at = -1;  ///< the render call that kills the process
    int stop_at = -1;  ///< the render call that raises *flag
    volatile bool flag = false;
    bool counters_restart = false;  ///< with the film
    int calls = 0, made = 0;
    uint64_t samples = 0;  ///< rendered by all
};

/// Every value is (1 + channel)·exponential; estimator naive has a bias of 10 %.
class FakeRenderer : public Renderer {
public:
    FakeRenderer(const Scene& scene, const RenderSettings& settings, World& world)
        : settings_(settings), world_(world) {
        ++world.made;
        film_.width = scene.sensor.crop_width;
        film_.height = scene.sensor.crop_height;
        clear_film();
    }
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        if (++world_.calls == world_.kill_at) ::raise(SIGKILL);
        uint32_t done = 0;
        for (; done < count; ++done) {
            if (world_.calls == world_.stop_at && done == 1) set_flag(&world_.flag);
            if (is_set(interrupt)) break;
            if (world_.sleep_per_sample > 0)
                std::this_thread::sleep_for(std::chrono::duration<double>(world_.sleep_per_sample));
            for (uint32_t p = 0; p < film_.width * film_.height; ++p) {
                const Vec4f u = random_floats({settings_.seed, p, first + done, Stream::eye}, 0);
                const double v = -std::log(1.0 - double(u.x)) * (settings_.estimator == Estimator::naive ? 1.1 : 1.0);
                for (size_t c = 0; c < 3; ++c) {
                    film_.sum[3 * p + c] += v * double(1 + c);
                    film_.sum_squares[3 * p + c] += v * v * double(1 + c) * double(1 + c);
                }
            }
        }
        film_.samples += done;
        rendered_ += done;
        world_.samples += done;
        rays_ += uint64_t(done) * film_.width * film_.height;
        return done;
    }
    FilmMoments film() override { return film_; }
    void clear_film() override {
        film_.samples = 0;
        if (world_.counters_restart) rays_ = 0;
        film_.sum.assign(size_t(film_.width) * film_.height * 3, 0.0);
        film_.sum_squares = film_.sum;
    }
    std::vector<StrategyImage> strategy_images() override {
        const std::vector<float> values(size_t(film_.width) * film_.height * 3, float(rendered_));
        return {{0, 2, false, values, values, 0}};
    }
    RenderStats stats() override {
        RenderStats s;
        s.backend = "fake";
        s.device = "fake device";
        s.samples = film_.samples;
        s.rays_extend = rays_;
        return s;
    }
    uint32_t preferred_batch() const override { return world_.batch; }

private:
    RenderSettings settings_;
    World& world_;
    FilmMoments film_;
    uint64_t rays_ = 0, rendered_ = 0;
};

/// Says what its samples cost, so that no busy machine disturbs a test.
struct SaysItsTime : FakeRenderer, SelfTimed {
    double cost, last = 0;
    SaysItsTime(const Scene& scene, const RenderSettings& settings, World& world, double c)
        : FakeRenderer(scene, settings, world), cost(c) {}
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const uint32_t done = FakeRenderer::render(first, count, interrupt);
        last = cost * done;
        return done;
    }
    double last_seconds() const override { return last; }
};

inline Scene fake_scene(const std::string& path, const LoadOptions& options) {
    const std::string content = read_file(path);
    if (content.find("broken") != std::string::npos) throw input_error(path, 7, "unknown bsdf 'broken'");
    Scene scene;
    scene.path = path;
    scene.integrator.max_depth = 5;
    for (size_t i = 0; i < content.size(); ++i) scene.content_hash[i % 32] ^= uint8_t(content[i] + 31 * i);
    scene.sensor.crop_width = options.width ? options.width : 16;
    scene.sensor.crop_height = options.height ? options.height : 12;
    return scene;
}

inline Hooks fake_hooks(World& world) {
    return {fake_scene,
            [&world](const Scene& scene, const RenderSettings& settings) {
                if (settings.integrator != "path" && settings.integrator != "bdpt")
                    throw Error(ExitCode::usage, "integrator '" + settings.integrator + "' is not known");
                if (settings.connections == 99)
                    throw Error(ExitCode::usage, "connections=99: too many for this renderer");
                return std::make_unique<FakeRenderer>(scene, settings, world);
            },
            [](RenderSettings& s, const std::string& key, const std::string& value) {
                if (key == "integrator")
                    s.integrator = value;
                else if (key == "max_depth")
                    s.max_depth = std::stoi(value);
                else if (key == "rr_depth")
                    s.rr_depth = std::stoi(value);
                else if (key == "connections")
                    s.connections = uint32_t(std::stoul(value));
                else if (key == "bdpt.auto")
                    s.automatic = value == "true";
                else if (key == "technique_depth")
                    s.technique_depth = uint32_t(std::stoul(value));
                else if (key == "variant")
                    s.variant = value;
                else if (key == "estimator" && value == "naive")
                    s.estimator = Estimator::naive;
                else if (key == "estimator" && value == "mis")
                    s.estimator = Estimator::mis;
                else
                    throw Error(ExitCode::usage, key + "=" + value + " is not known");
            },
            [] { return LoadReading{}; }};
}

constexpr const char* kConfig = R"(name = "fake"
seeds = [1, 2]
order = "listed"
[reference]
spp = 400
[budget]
spp = [1, 2, 8, 32]
[[scene]]
name = "a"
path = "a.xml"
[[scene]]
name = "b"
path = "b.xml"
size = [9, 5]
[[run]]
name = "good"
integrator = "path"
[[run]]
name = "biased"
integrator = "path"
estimator = "naive"
)";

inline void write_inputs(const TempFolder& folder, const std::string& config = kConfig) {
    folder.write("a.xml", "<scene a>");
    folder.write("b.xml", "<scene b>");
    folder.write("e.toml", config);
}

inline ExperimentRequest request(const TempFolder& folder, const std::string& output, bool resume = false) {
    return {folder / "e.toml", folder / output, "", resume, nullptr};
}

inline std::string error_of(const std::function<void()>& f, ExitCode code = ExitCode::bad_input) {
    try {
        f();
    } catch (const Error& e) {
        CHECK(e.code == code);
        return e.what();
    }
    return "no error";
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace ambilux::test
