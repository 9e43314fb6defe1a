#include "formats/document/principled.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/document/baked_textures.h"
#include "transport/bsdf/burley.h"

namespace ambilux::document {
namespace {

void leave_rates(Reader& in, std::initializer_list<const char*> lobes) {
    for (const std::string lobe : lobes)
        in.leave({{(lobe + "_sampling_rate").c_str()}}, "samples are chosen in our own way");
}

ParamFloat textured_share(Reader& in, const char* name, float fallback) {
    const ParamFloat given = in.textured_number(name, fallback);
    if (!(given.value >= 0 && given.value <= 1))
        in.fail(in.where(name), fmt::format("'{}' must lie between 0 and 1", name));
    return given;
}

/// A share between 0 and `most`. With --lenient, a texture is its mean.
float share(Builder& builder, Reader& in, const char* name, float fallback, float most = 1) {
    const ParamFloat given = in.textured_number(name, fallback);
    double value = given.value;
    if (given.texture >= 0) {
        builder.refuse(in.where(name), fmt::format("a texture as '{}' of {} is not supported", name, in.object().type),
                       "its mean is used");
        value = luminance(mean_color(builder, {splat(given.value), given.texture}));
    }
    if (!(value >= 0 && value <= most))
        in.fail(in.where(name), fmt::format("'{}' must lie between 0 and {:g}", name, most));
    return float(value);
}

/// Index of refraction: `eta`, or `specular`, a share of 8 % reflectance at normal incidence (Burley 2012).
float read_eta(Builder& builder, Reader& in) {
    if (in.has("eta") && in.has("specular")) in.fail(in.where("specular"), "both 'eta' and 'specular' are given");
    if (in.has("specular")) return 2 / (1 - std::sqrt(0.08f * share(builder, in, "specular", 0.5f))) - 1;
    const float eta = in.ior("eta", "bk7");
    if (!(eta >= 1)) in.fail(in.where("eta"), "'eta' of " + in.object().type + " must not be less than 1");
    return eta;
}

uint16_t of_65535(float value) { return uint16_t(std::lround(value * 65535)); }

/// What both principled BSDFs have.
template <class Parameters>
void read_common(Builder& builder, Reader& in, Parameters& p) {
    p.base_color = in.textured_color("base_color", splat(0.5f), SpectrumUse::reflectance);
    p.roughness = textured_share(in, "roughness", 0.5f);
    p.anisotropic = textured_share(in, "anisotropic", 0);
    p.specular_tint = share(builder, in, "spec_tint", 0);
    p.sheen = share(builder, in, "sheen", 0);
    p.sheen_tint = of_65535(share(builder, in, "sheen_tint", 0));
    p.flatness = of_65535(share(builder, in, "flatness", 0));
}

/// What it transmits by.
Textured<RoughDielectric> glass_of(Builder& builder, Reader& in, const Textured<Principled>& p) {
    Textured<RoughDielectric> glass{};
    glass.specular_reflectance = {splat(1), -1};
    glass.specular_transmittance = baked_color(builder, in, {p.base_color}, [](const std::vector<Rgb>& v) {
        return Rgb{std::sqrt(v[0].x), std::sqrt(v[0].y), std::sqrt(v[0].z)};
    });
    const auto alpha = [&](bool along_s) {
        return baked_number(builder, in, {p.roughness, p.anisotropic}, [along_s](const std::vector<float>& v) {
            const MicrofacetDistribution d = burley_microfacets(v[0], v[1]);
            return along_s ? d.alpha_u : d.alpha_v;
        });
    };
    const bool isotropic = p.anisotropic.texture < 0 && p.anisotropic.value == 0;
    glass.alpha_u = alpha(true);
    glass.alpha_v = isotropic ? glass.alpha_u : alpha(false);
    glass.ior = p.ior;
    glass.distribution = Microfacets::ggx;
    glass.sample_visible = true;
    return glass;
}

}  // namespace

PrincipledParts read_principled(Builder& builder, Reader& in) {
    PrincipledParts parts;
    Textured<Principled>& p = parts.opaque;
    p = {};
    read_common(builder, in, p);
    p.metallic = textured_share(in, "metallic", 0);
    p.ior = in.has("eta") || in.has("specular") ? read_eta(builder, in) : 1.5f;
    p.clearcoat = share(builder, in, "clearcoat", 0);
    p.clearcoat_alpha = 0.1f + (0.001f - 0.1f) * share(builder, in, "clearcoat_gloss", 0);
    const ParamFloat spec_trans = textured_share(in, "spec_trans", 0);
    leave_rates(in, {"diffuse_reflectance", "main_specular", "clearcoat", "spec_reflectance", "spec_trans"});
    if (spec_trans.texture < 0 && spec_trans.value == 0) return parts;

    if (p.ior == 1) in.fail(in.where("eta"), "spec_trans needs an index of refraction other than 1");
    const bool textured = spec_trans.texture >= 0 || p.metallic.texture >= 0;
    if (p.specular_tint > 0) {
        // The tint is of the share (1 - metallic), of which the glass takes a part that has none.
        if (textured) in.fail(in.where("spec_tint"), "spec_tint with spec_trans from a texture is not supported");
        if (p.specular_tint > 1 - spec_trans.value)
            in.fail(in.where("spec_tint"), "spec_tint and spec_trans may be 1 together at most");
        p.specular_tint = std::min(p.specular_tint / (1 - spec_trans.value), 1.0f);
    }
    if (textured && (p.clearcoat > 0 || p.sheen > 0))
        in.fail("spec_trans or metallic from a texture, with clearcoat or sheen, is not supported");
    const auto glass_share = [](const std::vector<float>& v) { return (1 - v[0]) * v[1]; };
    parts.glass_weight = baked_number(builder, in, {p.metallic, spec_trans}, glass_share);
    const bool all_glass = parts.glass_weight.texture < 0 && parts.glass_weight.value == 1;
    if (all_glass && p.clearcoat > 0) in.fail(in.where("clearcoat"), "clearcoat on glass alone is not supported");
    parts.glass = glass_of(builder, in, p);
    if (all_glass) return parts;
    if (!textured) {
        const float rest = 1 - parts.glass_weight.value;
        p.clearcoat /= rest;
        p.sheen /= std::max(1 - spec_trans.value, 1e-6f);
    }
    p.metallic = baked_number(builder, in, {p.metallic, spec_trans}, [&](const std::vector<float>& v) {
        const float rest = 1 - glass_share(v);
        return rest > 0 ? std::min(v[0] / rest, 1.0f) : 0.0f;
    });
    return parts;
}

Textured<PrincipledThin> read_principled_thin(Builder& builder, Reader& in) {
    Textured<PrincipledThin> p{};
    read_common(builder, in, p);
    p.specular = textured_share(in, "spec_trans", 0);
    p.ior = in.has("eta") ? read_eta(builder, in) : 1.5f;
    p.through = share(builder, in, "diff_trans", 0, 2) / 2;
    leave_rates(in, {"diffuse_reflectance", "specular_reflectance", "specular_transmittance", "diffuse_transmittance"});
    return p;
}

}  // namespace ambilux::document
