// Renders step by step, references and experiments.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/outputs.h"
#include "experiments/dry_run.h"
#include "experiments/reference_store.h"
#include "experiments/runner.h"
#include "integrators/warnings.h"
#include "python/src/bindings.h"
#include "python/src/loaded_scene.h"
#include "render/shared_renderer.h"
#include "session/aovs.h"
#include "session/render_plan.h"
#include "session/replays.h"
#include "session/statistics.h"
#include "session/technique_files.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace ambilux {

RenderSettings settings_of(const Scene& scene, const Assignments& assignments) {
    RenderSettings settings = default_settings(scene);
    for (const auto& [key, value] : assignments) apply_setting(settings, key, value);
    return settings;
}

namespace {

/// What a render is to have besides its image.
struct Extras {
    std::vector<std::string> aovs;
    bool technique_images = false, outliers = false;
};

/// A render that goes on step by step.
class Render {
public:
    Render(SharedScene scene, const Assignments& assignments, std::optional<uint64_t> spp, std::optional<double> time,
           const Extras& extras)
        : scene_(std::move(scene)), settings_(settings_of(scene_->scene, assignments)),
          budget_(render_budget(spp, time, scene_->scene, "")), aovs_(extras.aovs) {
        check_aovs(aovs_, "");
        check_aovs_of(settings_, aovs_, "");
        if (extras.technique_images && settings_.technique_depth == 0)
            settings_.technique_depth = kDefaultTechniqueDepth;
        expect(settings_, budget_);
        run_unlocked([&](const volatile bool*) {
            SharedAccels accels(scene_->scene, scene_->structures);
            renderer_ = make_renderer(scene_->scene, settings_, accels);
        });
        if (extras.outliers) {
            auto watched = watch_samples(std::move(renderer_), settings_, "");
            watch_ = watched.get();
            renderer_ = std::move(watched);
        }
        position_ = first_position(*renderer_);
    }

    std::vector<std::string> warnings() const { return render_warnings(scene_->scene, used()); }
    /// All settings of the samples that were rendered.
    RenderSettings used() const {
        const RenderStats stats = renderer_->stats();
        RenderSettings used = used_settings(settings_, stats);
        apply_setting(used, "backend", stats.backend);
        return used;
    }

    /// Renders for about `seconds`, or with 0 to the end. Returns false at the end.
    bool advance(double seconds) {
        bool ended = false;
        run_unlocked([&](const volatile bool* interrupt) {
            Budget part = budget_;
            const bool shorter = seconds > 0 && (budget_.seconds == 0 || position_.seconds + seconds < budget_.seconds);
            // A batch of its own is the least that a step makes.
            if (shorter) part.seconds = position_.seconds + std::max(seconds, position_.per_iteration());
            const uint64_t before = position_.samples;
            position_ = drive(*renderer_, position_, part, interrupt);
            position_.interrupted = false;
            ended =
                !shorter || position_.samples == before || (budget_.samples && position_.samples >= budget_.samples);
        });
        return !ended;
    }

    /// Samples [first, first + count) of every pixel, whatever the budget is; returns the seconds that took. pixels()
    /// are those of the samples since clear().
    double add(uint32_t first, uint32_t count) {
        double seconds = 0;
        run_unlocked([&](const volatile bool* interrupt) {
            const auto start = std::chrono::steady_clock::now();
            position_.samples += renderer_->render(first, count, interrupt);
            seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        });
        position_.seconds += seconds;
        return seconds;
    }
    void clear() { renderer_->clear_film(); }

    /// Without standard errors where samples depend on each other.
    Reference pixels() {
        Reference pixels = to_reference(renderer_->film());
        if (renderer_->stats().settings.sampler == Sampler::sobol) pixels.standard_error = {};
        return pixels;
    }
    std::optional<DeviceImage> device_image() {
        std::optional<DeviceImage> image;
        run_unlocked([&](const volatile bool*) { image = renderer_->device_image(); });
        return image;
    }
    std::vector<Layer> layers() {
        std::vector<Layer> layers;
        run_unlocked([&](const volatile bool*) {
            layers = make_aovs(scene_->scene, used_settings(settings_, renderer_->stats()), renderer_->film(), aovs_);
        });
        return layers;
    }
    std::string outliers(uint32_t count) const {
        nlohmann::json list = nlohmann::json::array();
        run_unlocked([&](const volatile bool*) {
            SharedAccels accels(scene_->scene, scene_->structures);
            const std::unique_ptr<Replay> replay = make_replay(scene_->scene, used(), accels);
            for (const Outlier& o : find_outliers(*watch_, *replay, count)) list.push_back(outlier_json(o));
        });
        return json_text({{"outliers", list}});
    }
    /// s, t, merge, raw, weighted, dropped.
    nb::list strategies() {
        nb::list list;
        const Sensor& sensor = scene_->scene.sensor;
        const std::vector<size_t> shape = {sensor.crop_height, sensor.crop_width, 3};
        for (const StrategyImage& i : renderer_->strategy_images())
            list.append(nb::make_tuple(i.s, i.t, i.merge, array_of<float>(i.raw, shape),
                                       array_of<float>(i.weighted, shape), i.dropped));
        return list;
    }
    void write_techniques(const std::string& folder) {
        write_technique_images(folder, scene_->scene, settings_, renderer_->stats(), renderer_->strategy_images());
    }
    uint64_t samples() const { return position_.samples; }
    double seconds() const { return position_.seconds; }
    std::string stats() const {
        return json_text(stats_json(scene_->scene, settings_, renderer_->stats(), scene_->seconds));
    }
    std::string attributes() const { return json_text(image_attributes(scene_->scene, settings_, renderer_->stats())); }
    std::string lost() const { return lost_values(renderer_->stats()); }

private:
    SharedScene scene_;
    RenderSettings settings_;
    Budget budget_;
    std::vector<std::string> aovs_;
    std::unique_ptr<Renderer> renderer_;
    const SampleWatch* watch_ = nullptr;  ///< with outliers
    RenderPosition position_;
};

std::pair<Reference, std::string> reference(const SharedScene& scene, const std::string& path, uint64_t spp,
                                            const Assignments& assignments) {
    const std::vector<Output> outputs = {{"path", path}};
    check_outputs(outputs);
    check_not_inputs(outputs, scene->files);
    ReferenceRequest request = reference_request(path, spp, settings_of(scene->scene, assignments));
    ReferenceResult result;
    run_unlocked([&](const volatile bool* interrupt) {
        const ReferenceLock lock(path, interrupt);
        if (!lock.held()) return;
        request.interrupt = interrupt;
        result = make_reference(scene->scene, request, default_hooks());
    });
    return {std::move(result.reference), json_text(result.attributes)};
}

/// What an experiment would do.
std::string plan(const std::string& config, const std::string& references, bool reduced) {
    ExperimentRequest request;
    request.config = config;
    request.references = references;
    request.reduced = reduced;
    std::string text;
    run_unlocked([&](const volatile bool* interrupt) {
        request.interrupt = interrupt;
        text = describe_plan(request, default_hooks());
    });
    return text;
}

/// The last report of work on another thread, for Python's.
class LastReport {
public:
    void put(const ProgressReport& report) {
        const std::lock_guard lock(mutex_);
        last_ = report;
    }
    std::optional<ProgressReport> take() {
        const std::lock_guard lock(mutex_);
        return std::exchange(last_, std::nullopt);
    }

private:
    std::mutex mutex_;
    std::optional<ProgressReport> last_;
};

/// `progress`: None, or called with fraction, details and seconds left.
void experiment(const std::string& config, const std::string& output, const std::string& references, bool resume,
                bool reduced, bool quiet, const nb::object& progress) {
    const QuietFor silence(quiet);
    LastReport reports;
    ExperimentRequest request;
    request.config = config;
    request.output = output;
    request.references = references;
    request.resume = resume;
    request.reduced = reduced;
    if (!progress.is_none()) request.on_progress = [&](const ProgressReport& r) { reports.put(r); };
    run_unlocked(
        [&](const volatile bool* interrupt) {
            request.interrupt = interrupt;
            run_experiment(request, default_hooks());
        },
        [&] {
            if (const auto r = reports.take()) progress(r->fraction, r->details, r->seconds_left);
        });
}

}  // namespace

void bind_renders(nb::module_& m) {
    nb::class_<Render>(m, "Render")
        .def(
            "__init__",
            [](Render* render, SharedScene scene, const Assignments& settings, std::optional<uint64_t> spp,
               std::optional<double> time, std::vector<std::string> aovs, bool technique_images, bool outliers) {
                new (render)
                    Render(std::move(scene), settings, spp, time, {std::move(aovs), technique_images, outliers});
            },
            "scene"_a, "settings"_a, "spp"_a.none(), "time"_a.none(), "aovs"_a = std::vector<std::string>(),
            "technique_images"_a = false, "outliers"_a = false)
        .def("advance", &Render::advance, "seconds"_a)
        .def("add", &Render::add, "first"_a, "count"_a)
        .def("clear", &Render::clear)
        .def("pixels", &Render::pixels)
        .def("device_image", &Render::device_image)
        .def("stats", &Render::stats)
        .def("attributes", &Render::attributes)
        .def("lost", &Render::lost)
        .def("used", &Render::used)
        .def("layers", &Render::layers)
        .def("outliers", &Render::outliers, "count"_a)
        .def("strategies", &Render::strategies)
        .def("write_techniques", &Render::write_techniques, "folder"_a)
        .def_prop_ro("warnings", &Render::warnings)
        .def_prop_ro("samples", &Render::samples)
        .def_prop_ro("seconds", &Render::seconds);
    m.def("reference", &reference, "scene"_a, "path"_a, "spp"_a, "settings"_a);
    m.def("plan", &plan, "config"_a, "references"_a, "reduced"_a);
    m.def("experiment", &experiment, "config"_a, "output"_a, "references"_a, "resume"_a, "reduced"_a, "quiet"_a,
          "progress"_a.none());
}

}  // namespace ambilux
