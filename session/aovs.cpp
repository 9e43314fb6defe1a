#include "session/aovs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "core/error.h"
#include "integrators/bdpt/aware/counts.h"
#include "integrators/bdpt/aware/settings.h"
#include "integrators/registry.h"
#include "render/aov.h"

namespace ambilux {
namespace {

Layer samples_of(const FilmMoments& film) {
    return {"samples", {"V"}, std::vector<float>(size_t(film.width) * film.height, float(film.samples))};
}

Layer variance_of(const FilmMoments& film) {
    Layer layer{"variance", {"R", "G", "B"}, std::vector<float>(film.sum.size())};
    for (size_t i = 0; i < film.sum.size(); ++i) layer.values[i] = float(film.variance(i) / double(film.samples));
    return layer;
}

/// Light vertices that an eye vertex of each pixel draws.
Layer connections_of(const FilmMoments& film, const RenderSettings& settings) {
    Layer layer{"connections", {"V"}, std::vector<float>(size_t(film.width) * film.height)};
    if (!variant_of(settings).traits.draws) return layer;
    const ConnectionsMap map = AwareSettings::plan(settings).map;
    for (uint32_t y = 0; y < film.height; ++y)
        for (uint32_t x = 0; x < film.width; ++x)
            layer.values[size_t(y) * film.width + x] =
                map.counts[PixelCounts::block(float(y), film.height, map.y) * map.x +
                           PixelCounts::block(float(x), film.width, map.x)];
    return layer;
}

}  // namespace

std::vector<std::string> known_aovs() {
    std::vector<std::string> names = aov_names();
    names.insert(names.end(), {"samples", "variance", "connections"});
    return names;
}

void check_aovs(const std::vector<std::string>& names, const std::string& prefix) {
    const std::vector<std::string> known = known_aovs();
    for (size_t i = 0; i < names.size(); ++i) {
        if (std::find(known.begin(), known.end(), names[i]) == known.end())
            throw Error(ExitCode::usage,
                        fmt::format("{}aov {}: not known; known are {}", prefix, names[i], fmt::join(known, ", ")));
        if (std::find(names.begin(), names.begin() + long(i), names[i]) != names.begin() + long(i))
            throw Error(ExitCode::usage, fmt::format("{}aov {}: asked for twice", prefix, names[i]));
    }
}

void check_aovs_of(const RenderSettings& settings, const std::vector<std::string>& names, const std::string& prefix) {
    if (settings.sampler == Sampler::sobol && std::find(names.begin(), names.end(), "variance") != names.end())
        throw Error(ExitCode::usage,
                    prefix +
                        "aov variance: with sampler=sobol samples depend on each other, and their scatter is not "
                        "the error of the mean; render several seeds");
    if (!settings.automatic && !variant_of(settings).traits.draws &&
        std::find(names.begin(), names.end(), "connections") != names.end())
        throw Error(ExitCode::usage, prefix + "aov connections: this variant draws no light vertices");
}

std::vector<Layer> make_aovs(const Scene& scene, const RenderSettings& settings, const FilmMoments& film,
                             const std::vector<std::string>& names) {
    std::vector<Layer> made, layers;
    const auto of_surfaces = [](const std::string& name) {
        return std::find(aov_names().begin(), aov_names().end(), name) != aov_names().end();
    };
    if (std::any_of(names.begin(), names.end(), of_surfaces))
        made = sample_aovs(scene, settings, uint32_t(std::min<uint64_t>(film.samples, kAovSamples)));
    made.push_back(samples_of(film));
    made.push_back(variance_of(film));
    made.push_back(connections_of(film, settings));
    for (const std::string& name : names)
        layers.push_back(
            *std::find_if(made.begin(), made.end(), [&](const Layer& layer) { return layer.name == name; }));
    return layers;
}

}  // namespace ambilux
