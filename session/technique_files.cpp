#include "session/technique_files.h"

#include <fmt/format.h>

#include <numeric>

#include "core/atomic_file.h"
#include "film/exr_io.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

double mean_of(const std::vector<float>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

}  // namespace

void write_technique_images(const std::string& folder, const Scene& scene, const RenderSettings& settings,
                            const RenderStats& stats, const std::vector<StrategyImage>& images) {
    make_folders(folder);
    const uint32_t width = scene.sensor.crop_width, height = scene.sensor.crop_height;
    nlohmann::json entries = nlohmann::json::array();
    uint32_t max_depth = 0;
    for (const StrategyImage& image : images) {
        max_depth = std::max(max_depth, image.s + image.t - (image.merge ? 2 : 1));
        Attributes attributes = image_attributes(scene, settings, stats);
        attributes["s"] = image.s;
        attributes["t"] = image.t;
        if (image.merge) attributes["merge"] = 1;
        const auto write = [&](const char* kind, const std::vector<float>& rgb) {
            const std::string name =
                fmt::format("{}_{}s{:02}_t{:02}.exr", kind, image.merge ? "merge_" : "", image.s, image.t);
            attributes["technique"] = kind;
            write_exr(folder + "/" + name, {width, height, rgb}, attributes);
            return name;
        };
        const std::string raw = write("raw", image.raw), weighted = write("weighted", image.weighted);
        entries.push_back({{"s", image.s},
                           {"t", image.t},
                           {"merge", image.merge},
                           {"raw", raw},
                           {"weighted", weighted},
                           {"mean_raw", mean_of(image.raw)},
                           {"mean_weighted", mean_of(image.weighted)},
                           {"dropped", image.dropped}});
    }
    const nlohmann::json list = {{"scene", scene.path},
                                 {"integrator", settings.integrator},
                                 {"variant", settings.variant},
                                 {"spp", stats.samples},
                                 {"max_depth", max_depth},
                                 {"width", width},
                                 {"height", height},
                                 {"entries", entries}};
    write_file_atomic(folder + "/techniques.json", list.dump(2) + "\n");
}

}  // namespace ambilux
