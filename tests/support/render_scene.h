// Scenes and renders for tests of whole images.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "formats/load.h"
#include "render/renderer.h"
#include "tests/support/skip.h"
#include "tests/support/temp_folder.h"

namespace ambilux {

/// A scene of the project, such as "cornell", at its own size or at the given one.
inline Scene project_scene(const std::string& name, uint32_t width = 0, uint32_t height = 0) {
    LoadOptions options;
    options.width = width;
    options.height = height;
    // A bundle for another machine brings its scenes along.
    const char* folder = std::getenv("AMBILUX_SCENES");
    return load_mitsuba((folder ? folder : AMBILUX_SOURCE_DIR "/scenes") + ("/" + name + ".xml"), options);
}

/// A file below AMBILUX_DATA; nothing, with a warning, if that is not set.
inline std::optional<std::string> published_file(const std::string& path) {
    const char* folder = std::getenv("AMBILUX_DATA");
    if (!folder) {
        skip("AMBILUX_DATA is not set: " + path + " is not tested");
        return {};
    }
    const std::string file = std::string(folder) + "/" + path;
    INFO(file);
    REQUIRE(std::filesystem::exists(file));
    return file;
}

/// A published scene, such as "cornell-box".
inline std::optional<Scene> published_scene(const std::string& name, uint32_t width, uint32_t height) {
    const std::optional<std::string> file = published_file("scenes/" + name + "/scene.xml");
    if (!file) return {};
    LoadOptions options;
    options.width = width;
    options.height = height;
    return load_mitsuba(*file, options);
}

/// A scene from its text.
inline Scene scene_from_text(const std::string& xml) {
    const test::TempFolder folder;
    return load_mitsuba(folder.write("scene.xml", xml));
}

/// Settings of a render on the CPU, with the scene's own depths.
inline RenderSettings cpu_settings(const Scene& scene, Estimator estimator, uint64_t seed = 1) {
    RenderSettings s;
    s.backend = "cpu";
    s.estimator = estimator;
    s.seed = seed;
    s.max_depth = scene.integrator.max_depth;
    s.rr_depth = scene.integrator.rr_depth;
    return s;
}

struct RenderResult {
    FilmMoments film;
    RenderStats stats;
};

/// Samples [0, spp) of every pixel.
inline RenderResult render_scene(const Scene& scene, const RenderSettings& settings, uint32_t spp) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    REQUIRE(renderer->render(0, spp) == spp);
    return {renderer->film(), renderer->stats()};
}

}  // namespace ambilux
