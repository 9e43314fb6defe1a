#include "integrators/bdpt/vcm/settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "integrators/bdpt/vcm/variant.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

using Of = Declare<VcmSettings>;

std::vector<Declaration<VcmSettings>> fixed_radius() {
    return {
        Of::number(
            "merge_radius", &VcmSettings::radius, 0.0f, 1e30f,
            fmt::format("radius around an eye vertex within which light vertices merge with it, in the "
                        "first iteration, by default over the radius of the scene; 0: {} or that of a pixel at the "
                        "median of what is seen, whichever is less, over the root of merge_samples",
                        kUsualRadius)),
        Of::choice("merge_unit", &VcmSettings::unit, {"scene", "world", "pixel", "footprint"},
                   fmt::format("what merge_radius is measured in: radii of the scene, its own units, radii of a pixel "
                               "at the median of what is seen, or radii of a pixel where the eye subpath has its "
                               "first vertex, those beyond {} times the median as there",
                               kLargestFootprint)),
        Of::number("merge_samples", &VcmSettings::samples, 1u, 1024u,
                   "samples of every pixel in one iteration: they share light vertices and radius")};
}

std::vector<Declaration<VcmSettings>> shrinking_radius() {
    std::vector<Declaration<VcmSettings>> all = fixed_radius();
    all.insert(all.begin() + 2,
               Of::number("merge_alpha", &VcmSettings::alpha, 0.0f, 1.0f,
                          "the squared radius of iteration i is i^(alpha - 1) times that of the first; 1: it stays"));
    return all;
}

}  // namespace

std::vector<Declaration<VcmSettings>> MergingVariant::settings() { return shrinking_radius(); }
std::vector<Declaration<VcmSettings>> PmVariant::settings() { return fixed_radius(); }
std::vector<Declaration<VcmSettings>> VcmVariant::settings() {
    std::vector<Declaration<VcmSettings>> all = shrinking_radius();
    all.insert(all.begin() + 3,
               Of::flag("merge_first", &VcmSettings::first, "eye subpaths merge at their first vertex too"));
    return all;
}

VcmSettings VcmSettings::plan(const RenderSettings& settings) {
    VcmSettings s = own_settings(VcmVariant::settings(), settings);
    if (!variant_of(settings).find_own("merge_alpha")) s.alpha = 1.0f;
    if (s.unit != RadiusUnit::scene || s.open_radius()) return s;
    if (s.radius > 1.0f)
        throw Error(ExitCode::usage,
                    fmt::format("merge_radius={}: more than that of the scene; merge_unit=world or merge_unit=pixel "
                                "measure it otherwise",
                                s.radius));
    if (s.radius < kLeastRadius)
        throw Error(ExitCode::usage, fmt::format("merge_radius={}: floats tell places apart down to {} of the scene's "
                                                 "radius; choose that or more, or an integrator that does not merge",
                                                 s.radius, kLeastRadius));
    return s;
}

float VcmSettings::first_radius(float scene, float pixel) const {
    const float units[] = {scene, 1.0f, pixel, kLargestFootprint * pixel};
    const float asked = open_radius() ? std::min(pixel, kUsualRadius * scene) / std::sqrt(float(samples))
                                      : radius * units[uint32_t(unit)];
    return std::clamp(asked, kLeastRadius * scene, scene);
}

std::string MergingVariant::bias(const RenderSettings& settings) {
    const VcmSettings s = VcmSettings::plan(settings);
    const char* const units[] = {" of the scene's", " units of the scene", " pixels", " footprints of the pixel"};
    const std::string radius = s.open_radius() ? fmt::format("a radius of at most {:.3g} of the scene's",
                                                             kUsualRadius / std::sqrt(float(s.samples)))
                                               : fmt::format("a radius of {:.3g}{}", s.radius, units[uint32_t(s.unit)]);
    return s.alpha < 1.0f ? fmt::format("consistent, biased by {} that shrinks (merge_alpha {:.3g})", radius, s.alpha)
                          : fmt::format("biased by {}", radius);
}

}  // namespace ambilux
