#include "formats/document/plugins.h"

#include <algorithm>

namespace ambilux::document {

bool is_one_of(const Plugins& plugins, const std::string& type) {
    return std::find(plugins.begin(), plugins.end(), type) != plugins.end();
}

std::string what_is_meant(const std::string& tag, const std::string& type) {
    const std::map<std::string, std::string> tags = plugins();
    const auto known = tags.find(type);
    if (known != tags.end() && known->second != tag) return ": it is of <" + known->second + ">";
    Plugins same;
    for (const auto& [name, of] : tags)
        if (of == tag && name != type) same.push_back(name);
    return known == tags.end() ? suggestion(same, type) : "";
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
