#include "formats/mitsuba/principled.h"

#include <fmt/format.h>

#include <cmath>

namespace ambilux::mitsuba {
namespace {

/// A share between 0 and `most`.
float share(Reader& in, const char* name, float fallback, float most = 1) {
    const double value = in.number(name, fallback);
    if (!(value >= 0 && value <= most))
        in.fail(in.where(name), fmt::format("'{}' must lie between 0 and {:g}", name, most));
    return float(value);
}

/// Index of refraction: `eta`, or `specular`, a share of 8 % reflectance at normal incidence (Burley 2012).
float read_eta(Reader& in) {
    if (in.has("eta") && in.has("specular")) in.fail(in.where("specular"), "both 'eta' and 'specular' are given");
    if (in.has("specular")) return 2 / (1 - std::sqrt(0.08f * share(in, "specular", 0.5f))) - 1;
    const float eta = in.ior("eta", "bk7");
    if (!(eta >= 1)) in.fail(in.where("eta"), "'eta' of principled must not be less than 1");
    return eta;
}

uint16_t of_65535(float value) { return uint16_t(std::lround(value * 65535)); }

}  // namespace

PrincipledParts read_principled(Reader& in) {
    PrincipledParts parts;
    Textured<Principled>& p = parts.opaque;
    p = {};
    p.base_color = in.textured_color("base_color", splat(0.5f), SpectrumUse::reflectance);
    p.roughness = in.textured_number("roughness", 0.5f);
    p.metallic = in.textured_number("metallic", 0);
    for (const auto& [name, value] : {std::pair{"roughness", p.roughness.value}, {"metallic", p.metallic.value}})
        if (!(value >= 0 && value <= 1)) in.fail(in.where(name), fmt::format("'{}' must lie between 0 and 1", name));
    p.ior = in.has("eta") || in.has("specular") ? read_eta(in) : 1.5f;
    p.aspect = std::sqrt(1 - 0.9f * share(in, "anisotropic", 0));
    p.specular_tint = share(in, "spec_tint", 0);
    p.sheen = share(in, "sheen", 0);
    p.sheen_tint = of_65535(share(in, "sheen_tint", 0));
    p.flatness = of_65535(share(in, "flatness", 0));
    p.clearcoat = share(in, "clearcoat", 0);
    p.clearcoat_alpha = 0.1f + (0.001f - 0.1f) * share(in, "clearcoat_gloss", 0);
    const float spec_trans = share(in, "spec_trans", 0);
    // How another renderer chooses its samples.
    in.ignore({"diffuse_reflectance_sampling_rate", "main_specular_sampling_rate", "clearcoat_sampling_rate"});
    if (spec_trans == 0) return parts;

    if (p.metallic.texture >= 0)
        in.fail(in.where("spec_trans"), "spec_trans with a texture as metallic is not supported");
    if (p.specular_tint > 0) in.fail(in.where("spec_tint"), "spec_trans with spec_tint is not supported");
    if (p.base_color.texture >= 0)
        in.fail(in.where("base_color"), "spec_trans with a texture as base_color is not supported");
    if (p.roughness.texture >= 0)
        in.fail(in.where("roughness"), "spec_trans with a texture as roughness is not supported");
    if (p.ior == 1) in.fail(in.where("eta"), "spec_trans needs an index of refraction other than 1");
    const float glass = (1 - p.metallic.value) * spec_trans, rest = 1 - glass;
    if (glass == 1 && p.clearcoat > 0) in.fail(in.where("clearcoat"), "clearcoat on glass alone is not supported");
    parts.glass_weight = glass;
    parts.glass = {};
    parts.glass.specular_reflectance = {splat(1), -1};
    const Rgb c = p.base_color.value;
    parts.glass.specular_transmittance = {{std::sqrt(c.x), std::sqrt(c.y), std::sqrt(c.z)}, -1};
    const float alpha = p.roughness.value * p.roughness.value;
    parts.glass.alpha_u = {std::max(alpha / p.aspect, 1e-3f), -1};
    parts.glass.alpha_v = {std::max(alpha * p.aspect, 1e-3f), -1};
    parts.glass.ior = p.ior;
    parts.glass.distribution = Microfacets::ggx;
    parts.glass.sample_visible = true;
    if (glass < 1) {
        p.metallic.value /= rest;
        p.clearcoat /= rest;
        p.sheen /= std::max(1 - spec_trans, 1e-6f);
    }
    return parts;
}

}  // namespace ambilux::mitsuba
