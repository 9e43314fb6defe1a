#include "formats/document/plugins.h"

#include <algorithm>

namespace ambilux::document {

bool is_one_of(const Plugins& plugins, const std::string& type) {
    return std::find(plugins.begin(), plugins.end(), type) != plugins.end();
}

namespace {

/// Letters to change, add, leave out or swap with the next (Damerau 1964).
size_t distance(const std::string& a, const std::string& b) {
    std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
    for (size_t i = 0; i <= a.size(); ++i)
        for (size_t j = 0; j <= b.size(); ++j) {
            d[i][j] = i == 0 ? j : j == 0 ? i : d[i - 1][j - 1] + (a[i - 1] != b[j - 1]);
            if (i > 0 && j > 0) d[i][j] = std::min({d[i][j], d[i - 1][j] + 1, d[i][j - 1] + 1});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
        }
    return d[a.size()][b.size()];
}

}  // namespace

std::string nearest_name(const Plugins& known, const std::string& name) {
    constexpr size_t kLongest = 64;  // files may hold names of any length, and the distance takes their product
    std::string nearest;
    size_t least = std::min<size_t>(3, 1 + name.size() / 3);
    for (const std::string& k : known)
        if (std::max(name.size(), k.size()) <= kLongest)
            if (const size_t d = distance(name, k); d < least) least = d, nearest = k;
    return nearest;
}

std::string nearly(const Plugins& known, const std::string& name) {
    const std::string near = nearest_name(known, name);
    return near.empty() ? "" : ": '" + near + "' is known";
}

std::string what_is_meant(const std::string& tag, const std::string& type) {
    const std::map<std::string, std::string> tags = plugins();
    const auto known = tags.find(type);
    if (known != tags.end() && known->second != tag) return ": it is of <" + known->second + ">";
    Plugins same;
    for (const auto& [name, of] : tags)
        if (of == tag && name != type) same.push_back(name);
    return known == tags.end() ? nearly(same, type) : "";
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
