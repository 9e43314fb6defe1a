#include "integrators/warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/reachability.h"

namespace ambilux {

namespace {

/// Light outside of these leaves the range in which products of a path's floats keep all their digits.
constexpr float kLeastLight = 1e-30f, kMostLight = 1e30f;

/// Largest share of the light that a diffuse surface without texture reflects.
float largest_albedo(const Scene& scene) {
    float largest = 0;
    for (const BsdfRecord& b : scene.bsdfs) {
        const auto look = [&](const ParamRgb& reflectance) {
            if (reflectance.texture < 0) largest = std::max(largest, max_component(reflectance.value));
        };
        if (b.type == BsdfType::diffuse) look(b.as<Diffuse>().reflectance);
        if (b.type == BsdfType::rough_diffuse) look(b.as<RoughDiffuse>().reflectance);
    }
    return largest;
}

/// Roulette that survives at most with probability `cap` multiplies second moments by albedo² / cap at every vertex.
std::string roulette_warning(const Scene& scene, const RenderSettings& settings) {
    if (settings.rr_depth < 0) return {};
    const double albedo = largest_albedo(scene), growth = albedo * albedo / double(settings.rr_cap);
    if (!(growth > 1)) return {};
    const double doubles_after = std::log(2.0) / std::log(growth);
    if (settings.max_depth >= 0 && settings.max_depth - settings.rr_depth < doubles_after) return {};
    return fmt::format(
        "a surface reflects {:.4g} of the light, and Russian roulette ends one path in {:.3g} at least: where such "
        "surfaces see only each other, variance grows without bound and error bars are too small; --set rr_cap={:.3g} "
        "avoids that",
        albedo, 1.0 / (1.0 - double(settings.rr_cap)), std::min(0.999, std::max(albedo, double(settings.rr_cap))));
}

std::string depth_warning(const RenderSettings& settings) {
    if (settings.max_depth != 0) return {};
    return fmt::format(
        "max_depth={}: the shortest path has one segment, so that the image is black; 1 is emission alone, -1 no limit",
        settings.max_depth);
}

std::string range_warning(const Scene& scene) {
    for (size_t i = 0; i < scene.emitters.size(); ++i) {
        const float most = max_component(scene.emitters[i].radiance.value);
        if (most > 0 && (most < kLeastLight || most > kMostLight))
            return fmt::format(
                "emitter {} has {:.3g}, outside of {:.0e} to {:.0e}: products of floats lose digits there or leave "
                "their "
                "range; scale all emission by the same factor, and the image back",
                i, most, kLeastLight, kMostLight);
    }
    return {};
}

}  // namespace

std::vector<std::string> render_warnings(const Scene& scene, const RenderSettings& settings) {
    std::vector<std::string> warnings;
    const auto add = [&](std::string text) {
        if (!text.empty()) warnings.push_back(std::move(text));
    };
    add(missing_light(scene.features, settings));
    add(roulette_warning(scene, settings));
    add(range_warning(scene));
    add(depth_warning(settings));
    return warnings;
}

}  // namespace ambilux
