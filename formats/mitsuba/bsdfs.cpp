#include <algorithm>
#include <cstring>

#include "formats/mitsuba/builder.h"
#include "formats/mitsuba/named_media.h"
#include "transport/bsdf/precompute.h"

namespace ambilux::mitsuba {

namespace {

/// What adapters add to the BSDF inside of them.
struct Adapters {
    ParamFloat opacity = {1, -1};
    bool has_opacity = false;
    int32_t normal_map = -1, bump_map = -1;
    float bump_scale = 1;

    bool has_map() const { return normal_map >= 0 || bump_map >= 0; }
};

Microfacets distribution(Builder& builder, Reader& in) {
    const std::string name = in.text("distribution", "beckmann");
    if (name == "ggx") return Microfacets::ggx;
    if (name != "beckmann")
        builder.refuse(in.where("distribution"), "microfacet distribution '" + name + "' is not supported",
                       "beckmann is used");
    return Microfacets::beckmann;
}

void read_roughness(Reader& in, BsdfRecord& r) {
    const bool anisotropic = in.has("alpha_u") || in.has("alpha_v");
    if (anisotropic && in.has("alpha")) in.fail(in.where("alpha"), "both 'alpha' and 'alpha_u' or 'alpha_v' are given");
    if (anisotropic) {
        if (!in.has("alpha_u") || !in.has("alpha_v")) in.fail("'alpha_u' and 'alpha_v' must both be given");
        r.alpha_u = in.textured_number("alpha_u", 0.1f);
        r.alpha_v = in.textured_number("alpha_v", 0.1f);
    } else {
        r.alpha_u = r.alpha_v = in.textured_number("alpha", 0.1f);
    }
    for (const ParamFloat& alpha : {r.alpha_u, r.alpha_v})
        if (!(alpha.value > 0)) in.fail(in.where(anisotropic ? "alpha_u" : "alpha"), "roughness must be positive");
    r.sample_visible = in.boolean("sample_visible", true);
}

void read_ior(Reader& in, BsdfRecord& r, const char* default_interior) {
    r.ior = in.ior("int_ior", default_interior) / in.ior("ext_ior", "air");
}

void read_metal(Builder& builder, Reader& in, BsdfRecord& r) {
    const bool old = in.object().version < 2;
    if (in.has("eta") || in.has("k")) {
        if (in.has("material")) in.fail(in.where("material"), "both 'material' and 'eta' or 'k' are given");
        if (!in.has("eta") || !in.has("k")) in.fail("'eta' and 'k' must both be given");
        r.eta = in.color("eta", {}, SpectrumUse::unbounded);
        r.k = in.color("k", {}, SpectrumUse::unbounded);
    } else {
        const std::string name = in.text("material", old ? "Cu" : "none");
        if (!find_metal(name, r.eta, r.k)) {
            builder.refuse(in.where("material"),
                           "no optical constants are known for '" + name + "' (known: " + metal_names() + ")",
                           "a perfect mirror is used");
            find_metal("none", r.eta, r.k);
        }
    }
    if (old) {  // relative to the outside; the newer format has the vacuum there
        const float outside = in.ior("ext_eta", "air");
        r.eta = r.eta / outside;
        r.k = r.k / outside;
    }
    r.specular_reflectance = in.textured_color("specular_reflectance", {1, 1, 1}, SpectrumUse::reflectance);
}

/// Share of the specular lobe in sampling: mean specular over mean total reflectance.
float specular_weight(const Builder& builder, const BsdfRecord& r) {
    const auto average = [](Rgb c) { return (c.x + c.y + c.z) / 3; };
    const float specular = average(mean_color(builder, r.specular_reflectance)),
                diffuse = average(mean_color(builder, r.reflectance));
    return specular + diffuse > 0 ? specular / (specular + diffuse) : 1.0f;
}

void read_plastic(Builder& builder, Reader& in, BsdfRecord& r) {
    read_ior(in, r, "polypropylene");
    r.nonlinear = in.boolean("nonlinear", false);
    r.reflectance = in.textured_color("diffuse_reflectance", splat(0.5f), SpectrumUse::reflectance);
    r.specular_reflectance = in.textured_color("specular_reflectance", {1, 1, 1}, SpectrumUse::reflectance);
    r.specular_sampling_weight = specular_weight(builder, r);
}

/// Tables of a rough boundary, shared by all BSDFs with the same one.
void precompute_rough_plastic(Builder& builder, BsdfRecord& r) {
    const std::string key = "transmittance " + std::to_string(int(r.microfacets)) + " " +
                            std::to_string(float_bits(r.alpha_u.value)) + " " + std::to_string(float_bits(r.ior));
    const auto it = builder.table_pool.find(key);
    if (it != builder.table_pool.end()) {
        r.transmittance_table = it->second;
        r.fdr_internal = builder.rough_reflectance_pool[key];
        return;
    }
    r.transmittance_table = uint32_t(builder.scene.tables.size());
    builder.scene.tables.resize(builder.scene.tables.size() + kTransmittanceTableSize);
    rough_transmittance_table(r.microfacets, r.alpha_u.value, r.ior,
                              builder.scene.tables.data() + r.transmittance_table);
    r.fdr_internal = rough_internal_reflectance(r.microfacets, r.alpha_u.value, r.ior);
    builder.table_pool[key] = r.transmittance_table;
    builder.rough_reflectance_pool[key] = r.fdr_internal;
}

/// A BSDF without adapters.
BsdfRecord read_leaf(Builder& builder, const Object& object) {
    Reader in(builder, object);
    const std::string& type = object.type;
    const bool old = object.version < 2;
    BsdfRecord r;
    if (type == "diffuse" || type == "roughdiffuse") {
        r.type = type == "diffuse" ? BsdfType::diffuse : BsdfType::rough_diffuse;
        const char* name = old && in.has("diffuse_reflectance") ? "diffuse_reflectance" : "reflectance";
        r.reflectance = in.textured_color(name, splat(0.5f), SpectrumUse::reflectance);
        if (type == "roughdiffuse") {
            r.alpha_u = r.alpha_v = in.textured_number("alpha", 0.2f);
            in.ignore({"use_fast_approx"});  // we always evaluate the full model
        }
    } else if (type == "conductor") {
        r.type = BsdfType::conductor;
        read_metal(builder, in, r);
    } else if (type == "roughconductor") {
        r.type = BsdfType::rough_conductor;
        r.microfacets = distribution(builder, in);
        read_roughness(in, r);
        read_metal(builder, in, r);
    } else if (type == "dielectric" || type == "thindielectric" || type == "roughdielectric") {
        r.type = type == "dielectric"
                     ? BsdfType::dielectric
                     : (type == "thindielectric" ? BsdfType::thin_dielectric : BsdfType::rough_dielectric);
        read_ior(in, r, "bk7");
        if (type == "roughdielectric") {
            r.microfacets = distribution(builder, in);
            read_roughness(in, r);
            if (r.ior == 1) in.fail("interior and exterior index of a roughdielectric must differ");
        }
        r.specular_reflectance = in.textured_color("specular_reflectance", {1, 1, 1}, SpectrumUse::reflectance);
        r.specular_transmittance = in.textured_color("specular_transmittance", {1, 1, 1}, SpectrumUse::reflectance);
    } else if (type == "plastic") {
        r.type = BsdfType::plastic;
        read_plastic(builder, in, r);
        r.fdr_internal = fresnel_diffuse_reflectance(r.ior);
    } else if (type == "roughplastic") {
        r.type = BsdfType::rough_plastic;
        read_plastic(builder, in, r);
        r.microfacets = distribution(builder, in);
        r.sample_visible = in.boolean("sample_visible", true);
        r.alpha_u = r.alpha_v = {float(in.number("alpha", 0.1)), -1};
        if (!(r.alpha_u.value > 0)) in.fail(in.where("alpha"), "roughness must be positive");
        if (!builder.validate_only) precompute_rough_plastic(builder, r);
    } else {
        builder.refuse(object.where, "BSDF type '" + type + "' is not supported",
                       "a diffuse surface of reflectance 0.5 is used");
        r.reflectance = {{0.5f, 0.5f, 0.5f}, -1};
        return r;
    }
    in.finish();
    return r;
}

bool transmits(BsdfType type) {
    return type == BsdfType::dielectric || type == BsdfType::thin_dielectric || type == BsdfType::rough_dielectric;
}

const Object& nested_bsdf(Reader& in) {
    const Object* nested = in.take("bsdf");
    if (!nested) in.fail(in.object().type + " has no nested BSDF");
    return *nested;
}

/// Strips masks and maps off `object`; returns what is inside of them.
const Object* strip(Builder& builder, const Object* object, Adapters& adapters, bool in_two_sided) {
    for (;;) {
        Reader in(builder, *object);
        if (object->type == "mask") {
            if (in_two_sided)
                in.fail("a mask inside of twosided is not supported: put the twosided inside of the mask");
            if (adapters.has_opacity) in.fail("a mask inside of a mask is not supported");
            adapters.has_opacity = true;
            const Value* opacity = object->find("opacity");
            if (opacity && (opacity->kind == ValueKind::rgb || opacity->kind == ValueKind::spectrum)) {
                adapters.opacity = {luminance(in.color("opacity", splat(0.5f), SpectrumUse::reflectance)), -1};
            } else {
                adapters.opacity = in.textured_number("opacity", 0.5f);
            }
            if (adapters.opacity.value < 0 || adapters.opacity.value > 1)
                in.fail(in.where("opacity"), "opacity must lie between 0 and 1");
        } else if (object->type == "bumpmap" || object->type == "normalmap") {
            if (adapters.has_map()) in.fail("more than one bumpmap or normalmap on a surface is not supported");
            const bool bump = object->type == "bumpmap";
            const Object* texture = in.take("texture");
            if (!texture) in.fail(object->type + " has no texture");
            (bump ? adapters.bump_map : adapters.normal_map) = load_texture(builder, *texture);
            if (bump) adapters.bump_scale = float(in.number("scale", 1));
        } else {
            return object;
        }
        object = &nested_bsdf(in);
        in.finish();
    }
}

uint32_t add_record(Builder& builder, const Object& object, const Adapters& adapters, bool two_sided) {
    BsdfRecord r = read_leaf(builder, object);
    if (two_sided && transmits(r.type))
        Reader(builder, object).fail("a BSDF that transmits light cannot be inside of twosided");
    r.normal_map = adapters.normal_map;
    r.bump_map = adapters.bump_map;
    r.bump_scale = adapters.bump_scale;
    if (builder.validate_only) return 0;
    builder.scene.bsdfs.push_back(r);
    return uint32_t(builder.scene.bsdfs.size() - 1);
}

}  // namespace

uint32_t build_material(Builder& builder, const Object& bsdf) {
    const auto known = builder.materials.find(&bsdf);
    if (known != builder.materials.end()) return known->second;
    if (bsdf.tag != "bsdf") Reader(builder, bsdf).fail("expected a bsdf, not a " + bsdf.tag);

    Adapters outer;
    const Object* inner = strip(builder, &bsdf, outer, false);
    Material material;
    material.opacity = outer.opacity;
    material.two_sided = inner->type == "twosided";
    if (material.two_sided) {
        Reader in(builder, *inner);
        const Object& first = nested_bsdf(in);
        const Object* second = in.take("bsdf");
        in.finish();
        const auto side = [&](const Object& object) {
            Adapters adapters = outer;
            const Object* leaf = strip(builder, &object, adapters, true);
            if (leaf->type == "twosided") Reader(builder, *leaf).fail("twosided inside of twosided");
            return add_record(builder, *leaf, adapters, true);
        };
        material.front = side(first);
        material.back = second ? side(*second) : material.front;
    } else {
        material.front = material.back = add_record(builder, *inner, outer, false);
    }
    if (builder.validate_only) return 0;
    builder.scene.materials.push_back(material);
    return builder.materials[&bsdf] = uint32_t(builder.scene.materials.size() - 1);
}

uint32_t default_material(Builder& builder, bool emitter) {
    uint32_t& known = builder.default_materials[emitter];
    if (known != kNone) return known;
    BsdfRecord r;
    r.reflectance = {splat(emitter ? 0.0f : 0.5f), -1};
    builder.scene.bsdfs.push_back(r);
    const uint32_t record = uint32_t(builder.scene.bsdfs.size() - 1);
    builder.scene.materials.push_back({record, record, 0, {1, -1}});
    return known = uint32_t(builder.scene.materials.size() - 1);
}

}  // namespace ambilux::mitsuba
