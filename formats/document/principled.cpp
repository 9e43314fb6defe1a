#include "formats/document/principled.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "formats/document/baked_textures.h"
#include "transport/bsdf/burley.h"

namespace ambilux::document {
namespace {

template <class Model>
using SlotsOf = typename Model::template Slots<ParamFloat>;

bool is_zero(const ParamFloat& p) { return is_constant(p) && p.value == 0; }

void leave_rates(Reader& in, std::initializer_list<const char*> lobes) {
    for (const std::string lobe : lobes)
        in.leave({{(lobe + "_sampling_rate").c_str()}}, "samples are chosen in our own way");
}

/// A number from 0 to `most`, or a texture of such.
ParamFloat textured_share(Reader& in, const char* name, float fallback, float most = 1) {
    const ParamFloat given = in.textured_number(name, fallback);
    if (!(given.value >= 0 && given.value <= most))
        in.fail(in.where(name), fmt::format("'{}' must lie between 0 and {:g}", name, most));
    return given;
}

/// Weight of a lobe that is added to the others.
ParamFloat lobe_weight(Builder& builder, Reader& in, const char* name) {
    const ParamFloat given = in.textured_number(name, 0);
    if (!(given.value >= 0)) in.fail(in.where(name), fmt::format("'{}' must not be negative", name));
    if (given.value > 1) builder.note(in.where(name), fmt::format("'{}' above 1 is taken as it is", name));
    return given;
}

/// Index of refraction: `eta`, or `specular`, a share of 8 % reflectance at normal incidence (Burley 2012).
float read_eta(Builder& builder, Reader& in) {
    if (in.has("eta") && in.has("specular")) in.fail(in.where("specular"), "both 'eta' and 'specular' are given");
    if (in.has("specular")) {
        ParamFloat specular = textured_share(in, "specular", 0.5f);
        if (specular.texture >= 0) {
            builder.refuse(in.where("specular"), "a texture as 'specular' is not supported", "its mean is used");
            specular = {luminance(mean_color(builder, {splat(specular.value), specular.texture})), -1};
        }
        return 2 / (1 - std::sqrt(0.08f * specular.value)) - 1;
    }
    const float eta = in.ior("eta", "bk7");
    if (!(eta >= 1)) in.fail(in.where("eta"), "'eta' of " + in.object().type + " must not be less than 1");
    return eta;
}

/// What both principled BSDFs have.
template <class Model>
void read_common(Builder& builder, Reader& in, Textured<Model>& p, SlotsOf<Model>& slots) {
    p.base_color = in.textured_color("base_color", splat(0.5f), SpectrumUse::reflectance);
    p.roughness = textured_share(in, "roughness", 0.5f);
    p.anisotropic = textured_share(in, "anisotropic", 0);
    slots.specular_tint = textured_share(in, "spec_tint", 0);
    slots.sheen = lobe_weight(builder, in, "sheen");
    slots.sheen_tint = textured_share(in, "sheen_tint", 0);
    slots.flatness = textured_share(in, "flatness", 0);
}

/// Into the record: as constants, or in a table if textures set some.
template <class Model>
void set_slots(Builder& builder, Textured<Model>& p, SlotsOf<Model> slots) {
    const ParamFloat* given = slot_array<ParamFloat>(slots);
    const std::span all(given, kSlotsOf<Model>);
    typename Model::Constants& constants = p;
    if (std::all_of(all.begin(), all.end(), is_constant)) {
        typename Model::template Slots<float> numbers;
        for (uint32_t i = 0; i < kSlotsOf<Model>; ++i) slot_array<float>(numbers)[i] = given[i].value;
        constants = Model::with_slots(constants, numbers);
    } else if (!builder.validate_only) {
        set_slots_at(constants, uint32_t(builder.scene.tables.size()));
        for (const ParamFloat& slot : all) {
            const float words[] = {slot.value, std::bit_cast<float>(slot.texture)};
            builder.scene.tables.append(words, 2);
        }
    }
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

/// What is not glass has all of the terms that glass lacks, over a smaller share of the surface: the tint of the
/// dielectric reflection (1 - metallic), of which glass takes the part spec_trans; sheen, which is weighted with the
/// diffuse part of that; and the clearcoat.
void raise_for_glass(Builder& builder, Reader& in, const ParamFloat& metallic, const ParamFloat& spec_trans,
                     SlotsOf<Principled>& slots) {
    // From textures, which are interpolated, not out of all bounds where all is glass.
    const bool textured = !is_constant(metallic) || !is_constant(spec_trans);
    const float least_opaque = textured ? 1.0f / 64 : 0, least_diffuse = textured ? 1.0f / 64 : 1e-6f;
    bool too_much = false, glass_alone = false;
    if (!is_zero(slots.specular_tint))
        slots.specular_tint = baked_number(builder, in, {slots.specular_tint, spec_trans}, [&](const auto& v) {
            too_much |= v[0] > 1 - v[1];
            return v[0] > 0 ? std::min(v[0] / (1 - v[1]), 1.0f) : 0.0f;
        });
    if (!is_zero(slots.sheen))
        slots.sheen = baked_number(builder, in, {slots.sheen, spec_trans},
                                   [&](const auto& v) { return v[0] / std::max(1 - v[1], least_diffuse); });
    if (!is_zero(slots.clearcoat))
        slots.clearcoat = baked_number(builder, in, {slots.clearcoat, metallic, spec_trans}, [&](const auto& v) {
            const float rest = 1 - (1 - v[1]) * v[2];
            const bool alone = v[0] > 0 && rest <= least_opaque;
            glass_alone |= alone;
            return alone ? 0.0f : v[0] / rest;
        });
    if (too_much)
        builder.refuse(in.where("spec_tint"), "spec_tint and spec_trans may be 1 together at most",
                       "the reflection of glass is not tinted");
    if (glass_alone)
        builder.refuse(in.where("clearcoat"), "clearcoat on glass alone is not supported", "it is left out there");
}

/// With spec_trans: `parts` become two.
void split_off_glass(Builder& builder, Reader& in, const ParamFloat& spec_trans, PrincipledParts& parts,
                     SlotsOf<Principled>& slots) {
    Textured<Principled>& p = parts.opaque;
    const auto glass_share = [](const std::vector<float>& v) { return (1 - v[0]) * v[1]; };
    parts.glass_weight = baked_number(builder, in, {p.metallic, spec_trans}, glass_share);
    parts.glass = glass_of(builder, in, p);
    raise_for_glass(builder, in, p.metallic, spec_trans, slots);
    p.metallic = baked_number(builder, in, {p.metallic, spec_trans}, [&](const std::vector<float>& v) {
        const float rest = 1 - glass_share(v);
        return rest > 0 ? std::min(v[0] / rest, 1.0f) : 0.0f;
    });
}

}  // namespace

PrincipledParts read_principled(Builder& builder, Reader& in) {
    PrincipledParts parts;
    Textured<Principled>& p = parts.opaque;
    p = {};
    SlotsOf<Principled> slots;
    read_common(builder, in, p, slots);
    p.metallic = textured_share(in, "metallic", 0);
    p.ior = in.has("eta") || in.has("specular") ? read_eta(builder, in) : 1.5f;
    slots.clearcoat = lobe_weight(builder, in, "clearcoat");
    slots.clearcoat_gloss = textured_share(in, "clearcoat_gloss", 0);
    const ParamFloat spec_trans = textured_share(in, "spec_trans", 0);
    leave_rates(in, {"diffuse_reflectance", "main_specular", "clearcoat", "spec_reflectance", "spec_trans"});
    if (!is_zero(spec_trans)) {
        if (p.ior == 1) in.fail(in.where("eta"), "spec_trans needs an index of refraction other than 1");
        split_off_glass(builder, in, spec_trans, parts, slots);
    }
    set_slots(builder, p, slots);
    return parts;
}

Textured<PrincipledThin> read_principled_thin(Builder& builder, Reader& in) {
    Textured<PrincipledThin> p{};
    SlotsOf<PrincipledThin> slots;
    read_common(builder, in, p, slots);
    p.specular = textured_share(in, "spec_trans", 0);
    slots.ior = {1.5f, -1};
    if (in.is_textured("eta"))
        slots.ior = in.textured_number("eta", 1.5f);
    else if (in.has("eta"))
        slots.ior.value = read_eta(builder, in);
    slots.through = textured_share(in, "diff_trans", 0, 2);
    slots.through.value /= 2;
    leave_rates(in, {"diffuse_reflectance", "specular_reflectance", "specular_transmittance", "diffuse_transmittance"});
    set_slots(builder, p, slots);
    return p;
}

}  // namespace ambilux::document
