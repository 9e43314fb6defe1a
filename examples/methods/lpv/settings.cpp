#include "settings.h"

#include <fmt/format.h>

#include "core/error.h"
#include "scene/scene.h"
#include "variant.h"

namespace ambilux {

std::vector<Declaration<lpv::Settings>> LpvVariant::settings() {
    using S = lpv::Settings;
    using Of = Declare<S>;
    return {Of::number("lpv_cascades", &S::cascades, 1u, lpv::kMostCascades,
                       "nested grids, each with half the edge of the one around it"),
            Of::number("lpv_resolution", &S::resolution, 4u, 128u, "cells of a grid along an axis"),
            Of::number("lpv_steps", &S::steps, 0u, 1024u, "steps of propagation, each from cell to cell"),
            Of::number("lpv_size", &S::size, 0.01f, 2.0f,
                       "edge of the largest grid, over that of the cube around all surfaces"),
            Of::number("lpv_occlusion", &S::occlusion, 0.0f, 1.0f,
                       "share of the flux towards surfaces that they hold back on its way; 0: none"),
            Of::number(
                "lpv_samples", &S::iteration_samples, 1u, 1024u,
                "samples of every pixel in one iteration: they share virtual lights and grids, and surfaces that few "
                "lights show hold little back")};
}

std::string LpvVariant::bias(const RenderSettings& settings) {
    const auto s = lpv::Settings::plan(settings);
    return fmt::format(
        "biased: one diffuse bounce of light through {} grids of {}^3 cells, in {} steps; nothing of other bounces",
        s.cascades, s.resolution, s.steps);
}

lpv::Settings lpv::Settings::plan(const RenderSettings& settings) {
    return own_settings(LpvVariant::settings(), settings);
}

uint32_t lpv::Settings::lights(const Scene& scene) const {
    const uint64_t lights = uint64_t(scene.sensor.crop_width) * scene.sensor.crop_height * iteration_samples;
    if (lights * cascades <= 0xffffffffull) return uint32_t(lights);
    throw Error(ExitCode::usage,
                fmt::format("lpv_samples={}: an iteration would have {} virtual lights in {} grids, and "
                            "4294967295 can be numbered; choose fewer samples or grids",
                            iteration_samples, lights, cascades));
}

}  // namespace ambilux
