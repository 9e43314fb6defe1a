// One sample of a render again, with all that happened on its way.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "python/src/bindings.h"
#include "python/src/loaded_scene.h"
#include "render/replay/print.h"
#include "session/guide_tree.h"
#include "session/light_vertices.h"
#include "session/replays.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace ambilux {
namespace {

using Said = std::pair<std::string, std::string>;  ///< as JSON, and for a person

struct TraceRequest {
    std::optional<std::pair<uint32_t, uint32_t>> pixel;
    uint32_t sample = 0;
    std::optional<uint32_t> light_subpath;
    bool compare = false;
};

void compare(const Scene& scene, const RenderSettings& settings, const ReplayRequest& request, SharedAccels& accels,
             nlohmann::json& json, std::string& text) {
    const auto film = [&](const RenderSettings& s, uint32_t sample) { return rendered_film(scene, s, sample); };
    const std::vector<LengthComparison> lengths = compare_by_length(scene, settings, request, accels, film);
    text += by_length_text(lengths);
    json["by_segments"] = by_length_json(lengths);
}

Said traced(const LoadedScene& loaded, RenderSettings settings, const TraceRequest& o, const ReplayFormat& format) {
    if (settings.backend == Backend::automatic) settings.backend = Backend::cpu;
    SharedAccels accels(loaded.scene, loaded.structures);
    const std::unique_ptr<Replay> replay = make_replay(loaded.scene, settings, accels);
    if (!o.pixel) {
        std::vector<ReplayCandidate> splats;
        const ReplaySubpath subpath = replay->light_subpath(*o.light_subpath, o.sample, true, splats);
        return {json_text(replay_json(subpath, splats, format)), replay_text(subpath, splats, format)};
    }
    ReplayRequest request;
    request.x = o.pixel->first;
    request.y = o.pixel->second;
    request.sample = o.sample;
    request.light_subpath = o.light_subpath;
    const ReplaySample sample = replay->sample(request);
    nlohmann::json json = replay_json(sample, format);
    std::string text = replay_text(sample, format);
    if (o.compare) compare(loaded.scene, settings, request, accels, json, text);
    return {json_text(json), text};
}

Said trace(const SharedScene& scene, const RenderSettings& settings, std::optional<std::pair<uint32_t, uint32_t>> pixel,
           uint32_t sample, std::optional<uint32_t> light_subpath, const std::string& strategy, bool compare) {
    ReplayFormat format;
    if (!strategy.empty()) format.only = parse_strategy(strategy);
    format.origin = scene->scene.origin;
    Said said;
    run_unlocked([&](const volatile bool*) {
        said = traced(*scene, settings, {pixel, sample, light_subpath, compare}, format);
    });
    return said;
}

nb::dict vertices_of(const SharedScene& scene, RenderSettings settings, uint32_t sample) {
    if (settings.backend == Backend::automatic) settings.backend = Backend::cpu;
    LightVertices v;
    run_unlocked([&](const volatile bool*) {
        SharedAccels accels(scene->scene, scene->structures);
        v = light_vertices(*make_replay(scene->scene, settings, accels), scene->scene, sample);
    });
    const size_t n = v.positions.size();
    nb::dict out;
    out["position"] = array_of<double>(v.positions, {n, 3});
    out["normal"] = array_of<float>(v.normals, {n, 3});
    out["direction"] = array_of<float>(v.directions, {n, 3});
    out["throughput"] = array_of<float>(v.throughputs, {n, 3});
    out["depth"] = array_of<uint32_t>(v.depths, {n});
    out["subpath"] = array_of<uint32_t>(v.subpaths, {n});
    out["shape"] = array_of<uint32_t>(v.shapes, {n});
    out["connectible"] = array_of<bool>(v.connectible, {n});
    out["subpath_count"] = v.subpath_count;
    return out;
}

nb::dict trees_of(const SharedScene& scene, RenderSettings settings, uint32_t sample,
                  std::optional<std::array<double, 3>> point, const std::string& side) {
    if (settings.backend == Backend::automatic) settings.backend = Backend::cpu;
    GuideArrays a;
    Layer picture;
    nlohmann::json statistics;
    run_unlocked([&](const volatile bool*) {
        SharedAccels accels(scene->scene, scene->structures);
        const auto guide = guide_of(*make_replay(scene->scene, settings, accels), sample, side, "");
        a = guide_arrays(*guide, scene->scene);
        statistics = guide_json(a, *guide);
        if (!point) return;
        const auto& origin = scene->scene.origin;
        const Vec3f p = {float((*point)[0] - origin[0]), float((*point)[1] - origin[1]),
                         float((*point)[2] - origin[2])};
        picture = guide_layer(*guide, p, "density");
    });
    const size_t leaves = a.count.size(), nodes = a.probability.size();
    nb::dict out;
    out["low"] = array_of<double>(a.low, {leaves, 3});
    out["high"] = array_of<double>(a.high, {leaves, 3});
    out["bsdf_share"] = array_of<float>(a.bsdf_share, {leaves});
    out["reflected"] = array_of<float>(a.reflected, {leaves});
    out["depth"] = array_of<uint32_t>(a.depth, {leaves});
    out["first"] = array_of<uint32_t>(a.first, {leaves});
    out["count"] = array_of<uint32_t>(a.count, {leaves});
    out["probability"] = array_of<float>(a.probability, {nodes, 4});
    out["child"] = array_of<int32_t>(a.child, {nodes, 4});
    out["statistics"] = json_text(statistics);
    out["density"] = nb::none();
    if (point) out["density"] = array_of<float>(picture.values, {kGuidePictureHeight, kGuidePictureWidth});
    return out;
}

}  // namespace

void bind_replays(nb::module_& m) {
    nb::class_<RenderSettings>(m, "Settings", "All settings of a render.")
        .def("__init__", [](RenderSettings* s, const SharedScene& scene, const Assignments& assignments) {
            new (s) RenderSettings(settings_of(scene->scene, assignments));
        });
    m.def("trace", &trace, "scene"_a, "settings"_a, "pixel"_a.none(), "sample"_a, "light_subpath"_a.none(),
          "strategy"_a, "compare"_a, "One sample as JSON and as text.");
    m.def("light_vertices", &vertices_of, "scene"_a, "settings"_a, "sample"_a);
    m.def("guide", &trees_of, "scene"_a, "settings"_a, "sample"_a, "point"_a.none(), "side"_a);
}

}  // namespace ambilux
