// What the experiments take from the renderer, as functions, so that tests can put a known process in its place.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "formats/load.h"
#include "render/renderer.h"
#include "session/load.h"

namespace ambilux {

struct Hooks {
    std::function<Scene(const std::string& path, const LoadOptions&)> load_scene;
    std::function<std::unique_ptr<Renderer>(const Scene&, const RenderSettings&)> make_renderer;
    std::function<void(RenderSettings&, const std::string& key, const std::string& value)> apply_setting;
    std::function<LoadReading()> load = read_load;  ///< of the machine
};

/// load_scene_file, make_renderer, apply_setting and read_load.
Hooks default_hooks();

}  // namespace ambilux
