#include <algorithm>
#include <bit>
#include <optional>

#include "formats/convert/writer.h"
#include "transport/bsdf/coating.h"

namespace ambilux::convert {

namespace {

void add_ior(xml_node node, float ior) {
    add_number(node, "int_ior", ior);
    add_number(node, "ext_ior", 1);
}

void add_distribution(Writer& w, xml_node node, Microfacets distribution, bool sample_visible = true) {
    constexpr const char* names[] = {"beckmann", "ggx", "phong"};
    add_text(node, "distribution", names[uint32_t(distribution)]);
    if (distribution == Microfacets::phong) w.note("Mitsuba 3 has no microfacet distribution 'phong'");
    if (!sample_visible) add_boolean(node, "sample_visible", false);
}

template <class P>
void add_roughness(Writer& w, xml_node node, const P& p) {
    add_distribution(w, node, p.distribution, p.sample_visible);
    add_textured_number(w, node, "alpha_u", p.alpha_u);
    add_textured_number(w, node, "alpha_v", p.alpha_v);
}

template <class P>
void add_metal(Writer& w, xml_node node, const P& p) {
    add_rgb(node, "eta", p.eta);
    add_rgb(node, "k", p.k);
    add_color(w, node, "specular_reflectance", p.specular_reflectance, true);
}

template <class P>
void add_glass(Writer& w, xml_node node, const P& p) {
    add_ior(node, p.ior);
    add_color(w, node, "specular_reflectance", p.specular_reflectance, true);
    add_color(w, node, "specular_transmittance", p.specular_transmittance, true);
}

template <class P>
void add_coating(Writer& w, xml_node node, const P& p) {
    add_ior(node, p.ior);
    add_color(w, node, "diffuse_reflectance", p.reflectance);
    add_color(w, node, "specular_reflectance", p.specular_reflectance, true);
    add_boolean(node, "nonlinear", p.nonlinear);
}

template <class P>
void add_lobes(Writer& w, xml_node node, const P& p) {
    add_color(w, node, "diffuse_reflectance", p.reflectance);
    add_color(w, node, "specular_reflectance", p.specular_reflectance);
    w.note(std::string("Mitsuba 3 has no BSDF '") + P::Model::plugin + "'");
}

// One function a model.

void add_parameters(Writer& w, xml_node node, const Textured<Diffuse>& p) {
    add_color(w, node, "reflectance", p.reflectance);
}
void add_parameters(Writer& w, xml_node node, const Textured<RoughDiffuse>& p) {
    add_color(w, node, "reflectance", p.reflectance);
    add_textured_number(w, node, "alpha", p.alpha);
    w.note("Mitsuba 3 has no BSDF 'roughdiffuse'");
}
void add_parameters(Writer& w, xml_node node, const Textured<Conductor>& p) { add_metal(w, node, p); }
void add_parameters(Writer& w, xml_node node, const Textured<RoughConductor>& p) {
    add_metal(w, node, p);
    add_roughness(w, node, p);
}
void add_parameters(Writer& w, xml_node node, const Textured<Dielectric>& p) { add_glass(w, node, p); }
void add_parameters(Writer& w, xml_node node, const Textured<ThinDielectric>& p) { add_glass(w, node, p); }
void add_parameters(Writer& w, xml_node node, const Textured<RoughDielectric>& p) {
    add_glass(w, node, p);
    add_roughness(w, node, p);
}
void add_parameters(Writer& w, xml_node node, const Textured<Plastic>& p) { add_coating(w, node, p); }
void add_parameters(Writer& w, xml_node node, const Textured<RoughPlastic>& p) {
    add_coating(w, node, p);
    add_distribution(w, node, p.distribution, p.sample_visible);
    add_number(node, "alpha", p.alpha.value);
}
void add_parameters(Writer& w, xml_node node, const Textured<Phong>& p) {
    add_lobes(w, node, p);
    add_textured_number(w, node, "exponent", p.exponent);
}
void add_parameters(Writer& w, xml_node node, const Textured<Ward>& p) {
    add_lobes(w, node, p);
    constexpr const char* variants[] = {"ward", "ward-duer", "balanced"};
    add_text(node, "variant", variants[uint32_t(p.variant)]);
    add_textured_number(w, node, "alpha_u", p.alpha_u);
    add_textured_number(w, node, "alpha_v", p.alpha_v);
}
void add_parameters(Writer& w, xml_node node, const Textured<DiffuseTransmitter>& p) {
    add_color(w, node, "transmittance", p.transmittance);
    w.note("Mitsuba 3 has no BSDF 'difftrans'");
}
void add_unless_zero(Writer& w, xml_node node, const char* name, const ParamFloat& value) {
    if (value.texture >= 0 || value.value > 1e-7f) add_textured_number(w, node, name, value);
}

/// Slots that are in a table, all of them; of a record without there is none.
template <class Model>
std::optional<typename Model::template Slots<ParamFloat>> table_slots(const Writer& w, const Textured<Model>& p) {
    if (!in_slots(p)) return {};
    typename Model::template Slots<ParamFloat> slots;
    for (uint32_t i = 0; i < kSlotsOf<Model>; ++i) {
        const float* at = w.scene.tables.data() + slots_at(p) + 2 * i;
        slot_array<ParamFloat>(slots)[i] = {at[0], std::bit_cast<int32_t>(at[1])};
    }
    return slots;
}

/// A share in 1/65535.
ParamFloat of_65535(uint16_t share) { return {float(share / 65535.0), -1}; }

typename Principled::Slots<ParamFloat> slots_of(const Writer& w, const Textured<Principled>& p) {
    if (const auto slots = table_slots(w, p)) return *slots;
    const double gloss = (0.1 - double(p.clearcoat_alpha)) / (0.1 - 0.001);
    return {{p.specular_tint},    {p.sheen},     of_65535(p.sheen_tint),
            of_65535(p.flatness), {p.clearcoat}, {p.clearcoat > 0 ? std::min(float(gloss), 1.0f) : 0}};
}
typename PrincipledThin::Slots<ParamFloat> slots_of(const Writer& w, const Textured<PrincipledThin>& p) {
    if (const auto slots = table_slots(w, p)) return *slots;
    return {{p.specular_tint}, {p.sheen}, of_65535(p.sheen_tint), of_65535(p.flatness), {p.ior}, {p.through}};
}

/// What both principled BSDFs have.
template <class P, class Slots>
void add_principled(Writer& w, xml_node node, const P& p, const Slots& slots) {
    add_color(w, node, "base_color", p.base_color);
    add_textured_number(w, node, "roughness", p.roughness);
    add_unless_zero(w, node, "anisotropic", p.anisotropic);
    add_unless_zero(w, node, "spec_tint", slots.specular_tint);
    add_unless_zero(w, node, "sheen", slots.sheen);
    add_unless_zero(w, node, "sheen_tint", slots.sheen_tint);
    add_unless_zero(w, node, "flatness", slots.flatness);
}

void add_parameters(Writer& w, xml_node node, const Textured<Principled>& p) {
    const auto slots = slots_of(w, p);
    add_principled(w, node, p, slots);
    add_number(node, "eta", p.ior);
    add_textured_number(w, node, "metallic", p.metallic);
    add_unless_zero(w, node, "clearcoat", slots.clearcoat);
    add_unless_zero(w, node, "clearcoat_gloss", slots.clearcoat_gloss);
}
void add_parameters(Writer& w, xml_node node, const Textured<PrincipledThin>& p) {
    auto slots = slots_of(w, p);
    add_principled(w, node, p, slots);
    add_textured_number(w, node, "eta", slots.ior);
    add_textured_number(w, node, "spec_trans", p.specular);
    slots.through.value *= 2;
    add_unless_zero(w, node, "diff_trans", slots.through);
}

/// A coating; the BSDF below it goes inside.
xml_node add_coat(Writer& w, xml_node parent, const Coat& coat) {
    xml_node node = add_object(parent, "bsdf", coat.rough() ? "roughcoating" : "coating");
    add_ior(node, coat.ior());
    add_rgb(node, "sigma_a", coat.absorption());
    add_rgb(node, "specular_reflectance", coat.reflectance());
    if (coat.rough()) {
        add_distribution(w, node, coat.distribution());
        add_number(node, "alpha", coat.alpha());
    }
    w.note("Mitsuba 3 has no BSDFs 'coating' and 'roughcoating'");
    return node;
}

/// With its bumps or normals around it.
void add_bsdf(Writer& w, xml_node parent, uint32_t index) {
    const BsdfRecord& record = w.scene.bsdfs[index];
    if (record.bump_map >= 0) {
        parent = add_object(parent, "bsdf", "bumpmap");
        add_texture(w, parent, nullptr, record.bump_map, splat(1), true);
        add_number(parent, "scale", record.bump_scale);
    } else if (record.normal_map >= 0) {
        parent = add_object(parent, "bsdf", "normalmap");
        add_texture(w, parent, "normalmap", record.normal_map, splat(1), false);
    }
    if (record.bump_map >= 0 || record.normal_map >= 0) {
        add_boolean(parent, "flip_invalid_normals", record.map_rules & kTurnNormals);
        add_boolean(parent, "use_shadowing_function", record.map_rules & kShadowBumps);
    }
    if (record.coat != kNone) parent = add_coat(w, parent, Coat{w.scene.tables.data() + record.coat});
    BsdfModels::for_each([&](auto model) {
        using Model = typename decltype(model)::type;
        if (record.type != kBsdfType<Model>) return;
        xml_node node = add_object(parent, "bsdf", Model::plugin);
        add_parameters(w, node, record.as<Model>());
    });
}

}  // namespace

void add_material(Writer& w, xml_node parent, uint32_t index, const std::string& id) {
    const Material& m = w.scene.materials[index];
    const xml_node root = parent;
    if (m.lets_pass()) {
        parent = add_object(parent, "bsdf", "mask");
        add_textured_number(w, parent, "opacity", m.opacity);
    }
    if (m.first != kNone) {
        parent = add_object(parent, "bsdf", "blendbsdf");
        add_textured_number(w, parent, "weight", m.second_weight);
        add_material(w, parent, m.first);
        add_material(w, parent, m.second);
    } else if (m.two_sided) {
        parent = add_object(parent, "bsdf", "twosided");
        add_bsdf(w, parent, m.front);
        if (m.back != m.front) add_bsdf(w, parent, m.back);
    } else {
        add_bsdf(w, parent, m.front);
    }
    if (!id.empty()) root.last_child().append_attribute("id") = id.c_str();
}

}  // namespace ambilux::convert
