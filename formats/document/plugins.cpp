#include "formats/document/plugins.h"

#include <algorithm>

namespace ambilux::document {

bool is_one_of(const Plugins& plugins, const std::string& type) {
    return std::find(plugins.begin(), plugins.end(), type) != plugins.end();
}

std::string nearest_name(const Plugins& known, const std::string& name) {
    std::string nearest;
    size_t least = std::min<size_t>(3, 1 + name.size() / 3);
    for (const std::string& k : known) {
        std::vector<size_t> row(k.size() + 1);  // letters to change, add or leave out (Levenshtein)
        for (size_t j = 0; j <= k.size(); ++j) row[j] = j;
        for (size_t i = 1; i <= name.size(); ++i)
            for (size_t j = 0, left = i - 1; j <= k.size(); ++j) {
                const size_t above = row[j];
                row[j] = j == 0 ? i : std::min({above + 1, row[j - 1] + 1, left + (name[i - 1] != k[j - 1])});
                left = above;
            }
        if (row.back() < least) least = row.back(), nearest = k;
    }
    return nearest;
}

std::string what_is_meant(const std::string& tag, const std::string& type) {
    const std::map<std::string, std::string> tags = plugins();
    const auto known = tags.find(type);
    if (known != tags.end() && known->second != tag) return ": it is of <" + known->second + ">";
    Plugins same;
    for (const auto& [name, of] : tags)
        if (of == tag && name != type) same.push_back(name);
    const std::string near = known == tags.end() ? nearest_name(same, type) : "";
    return near.empty() ? "" : ": '" + near + "' is known";
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
