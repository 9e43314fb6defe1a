#include "core/nearest.h"

#include <algorithm>

namespace ambilux {

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

/// What different programs and papers call alike, a group a line.
const std::vector<Names>& synonyms() {
    static const std::vector<Names> groups = {
        {"reflectance", "diffuse_reflectance", "base_color", "albedo", "kd", "color", "colour", "diffuse_color"},
        {"specular_reflectance", "ks", "specular_color"},
        {"alpha", "roughness", "alpha_u"},
        {"radiance", "intensity", "irradiance", "power", "emission", "le", "emittance"},
        {"int_ior", "ior", "eta", "refractive_index", "interior_ior"},
        {"to_world", "transform", "matrix", "object_to_world"},
        {"filename", "file", "path"},
        {"fov", "field_of_view", "fovx"},
        {"sample_count", "spp", "samples", "samples_per_pixel"},
        {"max_depth", "max_bounces", "bounces", "depth", "max_path_length"},
        {"rr_depth", "roulette_depth", "min_depth"},
        {"time", "seconds", "time_budget"},
        {"threads", "cores"},
        {"backend", "device"},
        {"variant", "method", "algorithm"},
        {"diffuse", "lambertian", "lambert", "matte"},
        {"roughdielectric", "rough_glass", "frosted"},
        {"dielectric", "glass"},
        {"conductor", "metal", "mirror"},
        {"principled", "disney"},
        {"area", "arealight", "area_light", "diffuse_light"},
        {"envmap", "environment", "infinite", "hdri", "ibl"},
        {"directional", "distant"},
        {"perspective", "pinhole"},
        {"bitmap", "image", "imagemap", "image_texture"},
    };
    return groups;
}

bool are_synonyms(const std::string& a, const std::string& b) {
    const auto has = [](const Names& group, const std::string& name) {
        return std::find(group.begin(), group.end(), name) != group.end();
    };
    return std::any_of(synonyms().begin(), synonyms().end(), [&](const Names& g) { return has(g, a) && has(g, b); });
}

}  // namespace

std::string nearest_name(const Names& known, const std::string& name) {
    constexpr size_t kLongest = 64;  // files may hold names of any length, and the distance takes their product
    std::string nearest;
    size_t least = std::min<size_t>(3, 1 + name.size() / 3);
    for (const std::string& k : known)
        if (k != name && are_synonyms(k, name)) return k;
    for (const std::string& k : known)
        if (std::max(name.size(), k.size()) <= kLongest)
            if (const size_t d = distance(name, k); d < least) least = d, nearest = k;
    return nearest;
}

std::string suggestion(const Names& known, const std::string& name) {
    const std::string near = nearest_name(known, name);
    return near.empty() ? "" : ": '" + near + "' is known";
}

std::string suggestion_or_all(const Names& known, const std::string& name) {
    const std::string near = nearest_name(known, name);
    if (!near.empty()) return ": is '" + near + "' meant?";
    std::string all;
    for (const std::string& k : known) all += (all.empty() ? "; known are: " : ", ") + k;
    return all;
}

}  // namespace ambilux
