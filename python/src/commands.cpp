// What the program has besides renders: what is in a scene, devices, scenes for other renderers, the stress sweep.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "core/outputs.h"
#include "formats/convert/convert.h"
#include "python/src/bindings.h"
#include "python/src/loaded_scene.h"
#include "render/shared_renderer.h"
#include "session/devices.h"
#include "session/statistics.h"
#include "stress/families.h"
#include "stress/folder.h"
#include "stress/runner.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace ambilux {
namespace {

std::string info(const SharedScene& scene, const RenderSettings& settings) {
    std::string text;
    run_unlocked([&](const volatile bool*) {
        SharedAccels accels(scene->scene, scene->structures);
        const RenderStats stats = make_renderer(scene->scene, settings, accels)->stats();
        text = json_text(info_json(scene->scene, settings, stats, scene->seconds, scene->times));
    });
    return text;
}

std::vector<std::string> convert(const SharedScene& scene, const std::string& path) {
    const std::vector<Output> outputs = {{"path", path}};
    check_outputs(outputs);
    check_not_inputs(outputs, scene->files);
    return write_mitsuba(scene->scene, path);
}

/// Rows as CSV, how many are planned, how many are bad, and a report.
using SweepResult = std::tuple<std::string, size_t, size_t, std::string>;

SweepResult result_of(const stress::Summary& summary) {
    return {stress::rows_text(summary.rows), summary.planned, summary.bad(), stress::report(summary)};
}

SweepResult sweep(stress::Request request, bool quiet) {
    const QuietFor silence(quiet);
    stress::Summary summary;
    run_unlocked([&](const volatile bool* interrupt) {
        request.interrupt = interrupt;
        summary = stress::run(request, stress::families(), default_hooks());
    });
    return result_of(summary);
}

std::vector<std::tuple<std::string, size_t, std::string>> families() {
    std::vector<std::tuple<std::string, size_t, std::string>> all;
    for (const stress::Family& f : stress::families()) all.emplace_back(f.name, f.cells.size(), f.parameter);
    return all;
}

}  // namespace

void bind_commands(nb::module_& m) {
    m.def("info", &info, "scene"_a, "settings"_a);
    m.def("devices", [] { return json_text(devices_json(cuda_report())); });
    m.def("convert", &convert, "scene"_a, "path"_a, "Writes the scene; returns what Mitsuba takes in another way.");
    m.def(
        "stress",
        [](const std::string& output, const std::vector<std::string>& families, const std::vector<std::string>& methods,
           const std::string& backend, uint64_t seed, double seconds, bool quick, bool resume,
           bool quiet) { return sweep({output, backend, families, methods, quick, resume, seed, seconds}, quiet); },
        "output"_a, "families"_a, "methods"_a, "backend"_a, "seed"_a, "seconds"_a, "quick"_a, "resume"_a, "quiet"_a);
    m.def("stress_families", &families, "Names, numbers of cells, and what is swept.");
    m.def(
        "stress_export",
        [](const std::string& folder, const std::vector<std::string>& names, bool quick) {
            stress::export_cells(folder, stress::chosen_cells(stress::families(), names, quick));
        },
        "folder"_a, "families"_a, "quick"_a);
    m.def(
        "stress_judge",
        [](const std::string& table, const std::string& output) {
            return result_of(stress::judge(table, output, stress::families()));
        },
        "table"_a, "output"_a);
}

}  // namespace ambilux
