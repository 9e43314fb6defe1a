#include "formats/document/bsdf_plugins.h"
#include "formats/document/named_media.h"
#include "formats/document/plugins.h"
#include "formats/document/principled.h"
#include "transport/bsdf/microfacet.h"
#include "transport/bsdf/precompute.h"

namespace ambilux::document {

Microfacets read_distribution(Builder& builder, Reader& in) {
    const std::string name = in.text("distribution", "beckmann");
    if (name == "ggx") return Microfacets::ggx;
    if (name == "phong" || name == "as") return Microfacets::phong;  // one and the same in Mitsuba 0.6
    if (name != "beckmann")
        builder.refuse(in.where("distribution"),
                       "microfacet distribution '" + name + "' is not supported (beckmann, ggx, phong, as)",
                       "beckmann is used");
    return Microfacets::beckmann;
}

namespace {

/// Visible normals are not sampled of phong's distribution, as in Mitsuba 0.6.
bool read_visible(Reader& in, Microfacets distribution) {
    return in.boolean("sample_visible", true) && distribution != Microfacets::phong;
}

template <class Parameters>
void read_roughness(Builder& builder, Reader& in, Parameters& p) {
    p.distribution = read_distribution(builder, in);
    const bool anisotropic = in.has("alpha_u") || in.has("alpha_v");
    if (anisotropic && in.has("alpha")) in.fail(in.where("alpha"), "both 'alpha' and 'alpha_u' or 'alpha_v' are given");
    if (anisotropic) {
        if (!in.has("alpha_u") || !in.has("alpha_v")) in.fail("'alpha_u' and 'alpha_v' must both be given");
        p.alpha_u = in.textured_number("alpha_u", 0.1f);
        p.alpha_v = in.textured_number("alpha_v", 0.1f);
    } else {
        p.alpha_u = p.alpha_v = in.textured_number("alpha", 0.1f);
    }
    for (const ParamFloat& alpha : {p.alpha_u, p.alpha_v})
        if (!(alpha.value >= 0)) in.fail(in.where(anisotropic ? "alpha_u" : "alpha"), "roughness must not be negative");
    p.sample_visible = read_visible(in, p.distribution);
}

float read_ior(Reader& in, const char* default_interior) {
    return in.ior("int_ior", default_interior) / in.ior("ext_ior", "air");
}

ParamRgb read_reflectance(Reader& in) {
    const bool other_name = in.object().version < 2 && in.has("diffuse_reflectance");
    return in.textured_color(other_name ? "diffuse_reflectance" : "reflectance", splat(0.5f), SpectrumUse::reflectance);
}

template <class Parameters>
void read_metal(Builder& builder, Reader& in, Parameters& p) {
    const bool old = in.object().version < 2;
    if (in.has("eta") || in.has("k")) {
        if (in.has("material")) in.fail(in.where("material"), "both 'material' and 'eta' or 'k' are given");
        if (!in.has("eta") || !in.has("k")) in.fail("'eta' and 'k' must both be given");
        p.eta = in.color("eta", {}, SpectrumUse::unbounded);
        p.k = in.color("k", {}, SpectrumUse::unbounded);
    } else {
        const std::string name = in.text("material", old ? "Cu" : "none");
        if (!find_metal(name, p.eta, p.k)) {
            builder.refuse(in.where("material"),
                           "no optical constants are known for '" + name + "' (known: " + metal_names() + ")",
                           "a perfect mirror is used");
            find_metal("none", p.eta, p.k);
        }
    }
    if (old) {  // relative to the outside; the newer format has the vacuum there
        const float outside = in.ior("ext_eta", "air");
        p.eta = p.eta / outside;
        p.k = p.k / outside;
    }
    p.specular_reflectance = in.textured_color("specular_reflectance", {1, 1, 1}, SpectrumUse::reflectance);
}

template <class Parameters>
void read_specular_colors(Reader& in, Parameters& p) {
    p.specular_reflectance = in.textured_color("specular_reflectance", {1, 1, 1}, SpectrumUse::reflectance);
    p.specular_transmittance = in.textured_color("specular_transmittance", {1, 1, 1}, SpectrumUse::reflectance);
}

/// Share of the specular lobe in sampling: mean specular over mean total reflectance.
float specular_weight(const Builder& builder, const ParamRgb& specular_reflectance, const ParamRgb& reflectance) {
    const auto average = [](Rgb c) { return (c.x + c.y + c.z) / 3; };
    const float specular = average(mean_color(builder, specular_reflectance)),
                diffuse = average(mean_color(builder, reflectance));
    return specular + diffuse > 0 ? specular / (specular + diffuse) : 1.0f;
}

template <class Parameters>
void read_plastic(Builder& builder, Reader& in, Parameters& p) {
    p.ior = read_ior(in, "polypropylene");
    p.nonlinear = in.boolean("nonlinear", false);
    p.reflectance = in.textured_color("diffuse_reflectance", splat(0.5f), SpectrumUse::reflectance);
    p.specular_reflectance = in.textured_color("specular_reflectance", {1, 1, 1}, SpectrumUse::reflectance);
    p.specular_sampling_weight = specular_weight(builder, p.specular_reflectance, p.reflectance);
}

/// Tables of a rough boundary, shared by all BSDFs with the same one.
void precompute_rough_plastic(Builder& builder, Textured<RoughPlastic>& p) {
    const std::string key = "transmittance " + std::to_string(int(p.distribution)) + " " +
                            std::to_string(float_bits(p.alpha.value)) + " " + std::to_string(float_bits(p.ior));
    p.transmittance_table = builder.add_table(key, kTransmittanceTableSize, [&](float* table) {
        rough_transmittance_table(p.distribution, p.alpha.value, p.ior, table);
    });
    const auto [known, added] = builder.rough_reflectance_pool.try_emplace(key, 0.0f);
    if (added) {
        const auto* before = builder.before ? &builder.before->reflectance_pool : nullptr;
        const bool same = before && before->contains(key);
        known->second = same ? before->at(key) : rough_internal_reflectance(p.distribution, p.alpha.value, p.ior);
    }
    p.fdr_internal = known->second;
}

// One plugin a model: what its XML says, as parameters.

void read_plugin(Builder&, Reader& in, Textured<Diffuse>& p) { p.reflectance = read_reflectance(in); }

void read_plugin(Builder&, Reader& in, Textured<RoughDiffuse>& p) {
    p.reflectance = read_reflectance(in);
    p.alpha = in.textured_number("alpha", 0.2f);
    in.leave({{"use_fast_approx", "false"}}, "the full model is evaluated");
}

void read_plugin(Builder& builder, Reader& in, Textured<Conductor>& p) { read_metal(builder, in, p); }

void read_plugin(Builder& builder, Reader& in, Textured<RoughConductor>& p) {
    read_roughness(builder, in, p);
    read_metal(builder, in, p);
}

void read_plugin(Builder&, Reader& in, Textured<Dielectric>& p) {
    p.ior = read_ior(in, "bk7");
    read_specular_colors(in, p);
}

void read_plugin(Builder&, Reader& in, Textured<ThinDielectric>& p) {
    p.ior = read_ior(in, "bk7");
    read_specular_colors(in, p);
}

void read_plugin(Builder& builder, Reader& in, Textured<RoughDielectric>& p) {
    p.ior = read_ior(in, "bk7");
    read_roughness(builder, in, p);
    if (p.ior == 1) in.fail("interior and exterior index of a roughdielectric must differ");
    read_specular_colors(in, p);
}

void read_plugin(Builder& builder, Reader& in, Textured<Plastic>& p) {
    read_plastic(builder, in, p);
    p.fdr_internal = fresnel_diffuse_reflectance(p.ior);
}

void read_plugin(Builder& builder, Reader& in, Textured<RoughPlastic>& p) {
    read_plastic(builder, in, p);
    p.distribution = read_distribution(builder, in);
    p.sample_visible = read_visible(in, p.distribution);
    p.alpha = {float(in.number("alpha", 0.1)), -1};
    if (!(p.alpha.value >= 0)) in.fail(in.where("alpha"), "roughness must not be negative");
    p.alpha.value = std::max(p.alpha.value, kMinAlpha);
    if (!builder.validate_only) precompute_rough_plastic(builder, p);
}

/// A diffuse part and a lobe, which may not give back more than all light together: both are scaled then, as Mitsuba
/// 0.6 does. Returns the lobe's share in sampling.
float read_diffuse_and_lobe(Builder& builder, Reader& in, ParamRgb& diffuse, ParamRgb& lobe) {
    diffuse = in.textured_color("diffuse_reflectance", splat(0.5f), SpectrumUse::reflectance);
    lobe = in.textured_color("specular_reflectance", splat(0.2f), SpectrumUse::reflectance);
    const float most = max_component(diffuse.value + lobe.value);
    if (most > 1 && diffuse.texture < 0 && lobe.texture < 0) {
        builder.note(in.where(), "the reflectances of '" + in.object().type + "' sum to more than 1 and are scaled");
        diffuse.value *= 0.99f / most;
        lobe.value *= 0.99f / most;
    }
    return specular_weight(builder, lobe, diffuse);
}

void read_plugin(Builder& builder, Reader& in, Textured<Phong>& p) {
    p.specular_sampling_weight = read_diffuse_and_lobe(builder, in, p.reflectance, p.specular_reflectance);
    p.exponent = in.textured_number("exponent", 30);
    if (!(p.exponent.value >= 0)) in.fail(in.where("exponent"), "the exponent must not be negative");
}

void read_plugin(Builder& builder, Reader& in, Textured<Ward>& p) {
    p.specular_sampling_weight = read_diffuse_and_lobe(builder, in, p.reflectance, p.specular_reflectance);
    const std::string variant = in.text("variant", "balanced");
    p.variant = variant == "ward"        ? WardVariant::ward
                : variant == "ward-duer" ? WardVariant::duer
                                         : WardVariant::balanced;
    if (variant != "ward" && variant != "ward-duer" && variant != "balanced")
        builder.refuse(in.where("variant"), "variant '" + variant + "' of ward is not known", "balanced is used");
    p.alpha_u = in.textured_number("alpha_u", 0.1f);
    p.alpha_v = in.textured_number("alpha_v", 0.1f);
    for (const ParamFloat& alpha : {p.alpha_u, p.alpha_v})
        if (!(alpha.value >= 0)) in.fail("roughness must not be negative");
}

void read_plugin(Builder&, Reader& in, Textured<DiffuseTransmitter>& p) {
    p.transmittance = in.textured_color("transmittance", splat(0.5f), SpectrumUse::reflectance);
}

void read_plugin(Builder& builder, Reader& in, Textured<Principled>& p) { p = read_principled(builder, in).opaque; }

void read_plugin(Builder& builder, Reader& in, Textured<PrincipledThin>& p) { p = read_principled_thin(builder, in); }

}  // namespace

BsdfRecord diffuse_record(float reflectance) {
    Textured<Diffuse> p{};
    p.reflectance = {splat(reflectance), -1};
    return bsdf_record(p);
}

BsdfRecord clear_pane_record() {
    Textured<ThinDielectric> p{};
    p.ior = 1;
    p.specular_reflectance = p.specular_transmittance = {splat(1), -1};
    return bsdf_record(p);
}

BsdfRecord read_bsdf(Builder& builder, const Object& object) {
    BsdfRecord record;
    bool known = false;
    BsdfModels::for_each([&](auto model) {
        using Model = typename decltype(model)::type;
        if (object.type != Model::plugin) return;
        Reader in(builder, object);
        Textured<Model> parameters{};
        read_plugin(builder, in, parameters);
        in.finish();
        record = bsdf_record(parameters);
        known = true;
    });
    if (known) return record;
    builder.refuse(object.where,
                   "BSDF type '" + object.type + "' is not supported" + what_is_meant("bsdf", object.type),
                   "a diffuse surface of reflectance 0.5 is used");
    return diffuse_record(0.5f);
}

}  // namespace ambilux::document
