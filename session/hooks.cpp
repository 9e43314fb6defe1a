#include "session/hooks.h"
#include "formats/load.h"

namespace ambilux {

Hooks default_hooks() {
    return {[](const std::string& path, const LoadOptions& options) { return load_scene_file(path, options); },
            [](const Scene& scene, const RenderSettings& settings) { return make_renderer(scene, settings); },
            [](RenderSettings& settings, const std::string& key, const std::string& value) {
                apply_setting(settings, key, value);
            }};
}

}  // namespace ambilux
