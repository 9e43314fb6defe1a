#include "formats/document/plugins.h"

#include <algorithm>

namespace ambilux::document {

bool is_one_of(const Plugins& plugins, const std::string& type) {
    return std::find(plugins.begin(), plugins.end(), type) != plugins.end();
}

std::map<std::string, std::string> plugins() {
    std::map<std::string, std::string> tags;
    const auto add = [&](const char* tag, const Plugins& types) {
        for (const std::string& type : types) tags.emplace(type, tag);
    };
    add("bsdf", bsdf_plugins());
    add("emitter", emitter_plugins());
    add("film", film_plugins());
    add("rfilter", filter_plugins());
    add("integrator", integrator_plugins());
    add("sampler", sampler_plugins());
    add("sensor", sensor_plugins());
    add("shape", shape_plugins());
    add("texture", texture_plugins());
    return tags;
}

}  // namespace ambilux::document
