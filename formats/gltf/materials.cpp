#include <algorithm>
#include <cmath>

#include "formats/gltf/model.h"

namespace ambilux::gltf {

using namespace mitsuba;

namespace {

/// A texture of a material; index -1: none.
struct Used {
    int index = -1, tex_coord = 0;
    const tinygltf::ExtensionMap* extensions = nullptr;
};
template <class Info>
Used used(const Info& info) {
    return {info.index, info.texCoord, &info.extensions};
}
/// Of an extension.
Used used(const tinygltf::Value* object, const char* name) {
    if (!object || !object->Has(name)) return {};
    const tinygltf::Value& info = object->Get(name);
    return {int(number(&info, "index", -1)), int(number(&info, "texCoord", 0)), nullptr};
}

Rgb color_of(const std::vector<double>& v, Rgb fallback) {
    return v.size() < 3 ? fallback : Rgb{float(v[0]), float(v[1]), float(v[2])};
}

class MaterialMaker {
public:
    MaterialMaker(Context& context, const tinygltf::Material& material, const std::string& what)
        : c_(context), m_(material), what_(what) {}

    Context::Surface make() {
        check_extensions();
        const auto& pbr = m_.pbrMetallicRoughness;
        base_ = color_of(pbr.baseColorFactor, splat(1));
        alpha_ = pbr.baseColorFactor.size() > 3 ? pbr.baseColorFactor[3] : 1;
        base_texture_ = used(pbr.baseColorTexture);
        rough_texture_ = used(pbr.metallicRoughnessTexture);
        const Object* bsdf = &with_transmission();
        if (m_.normalTexture.index >= 0) bsdf = &with_normals(*bsdf);
        if (!transmits_) {
            Object& both = object("bsdf", "twosided");
            add_child(both, *bsdf);
            bsdf = &both;
            if (!m_.doubleSided) c_.note("surfaces that glTF shows from one side are seen from both");
        }
        if (m_.occlusionTexture.index >= 0) c_.note("occlusion textures are left out: light is traced");
        if (m_.alphaMode != "OPAQUE") bsdf = &with_opacity(*bsdf);
        const bool double_sided = m_.doubleSided && bsdf->type == "twosided";
        const Object* light = emitter();
        if (light)
            c_.note(double_sided ? "two-sided surfaces that shine are two, a hundred-thousandth of their extent apart"
                                 : "surfaces that shine do so on their front side");
        return {bsdf, light, std::max(tex_coord_, 0), double_sided};
    }

private:
    Object& object(const char* tag, const char* type) { return add_object(c_.document, tag, type, c_.where); }

    void check_extensions() {
        for (const auto& [name, value] : m_.extensions) {
            if (name == "KHR_materials_emissive_strength" || name == "KHR_materials_transmission" ||
                name == "KHR_materials_volume" || name == "KHR_materials_ior" || name == "KHR_materials_clearcoat" ||
                name == "KHR_materials_specular" || name == "KHR_materials_sheen")
                continue;
            if (name.starts_with("KHR_materials_") || name.starts_with("EXT_") || name.starts_with("MSFT_"))
                c_.refuse(what_ + ": extension '" + name + "' is not supported", "it is left out");
        }
    }

    /// The image with this index, decoded once.
    const std::string& image(int index) {
        std::string& name = c_.images[index];
        if (!name.empty()) return name;
        if (index < 0 || size_t(index) >= c_.image_bytes.size())
            c_.fail(what_ + ": there is no image " + std::to_string(index));
        name = c_.where.file + ", image " + std::to_string(index);
        c_.document.images[name] = read_image(name, c_.image_bytes[size_t(index)], c_.document.limits);
        return name;
    }

    /// Bitmap of a texture. `channel`: "r" to "a", or all.
    Object& bitmap(const Used& use, bool raw, const char* channel = "") {
        if (size_t(use.index) >= c_.model.textures.size())
            c_.fail(what_ + ": there is no texture " + std::to_string(use.index));
        const tinygltf::Texture& texture = c_.model.textures[size_t(use.index)];
        Object& out = object("texture", "bitmap");
        set_text(out, "image", image(texture.source));
        if (raw) set_boolean(out, "raw", true);
        if (*channel) set_text(out, "channel", channel);
        Matrix to_uv;
        int tex_coord = use.tex_coord;
        if (const tinygltf::Value* t = use.extensions ? extension(*use.extensions, "KHR_texture_transform") : nullptr) {
            const auto pair = [&](const char* name, int i, double fallback) {
                if (!t->Has(name) || !t->Get(name).IsArray() || t->Get(name).ArrayLen() < 2) return fallback;
                const tinygltf::Value& v = t->Get(name).Get(i);
                return v.IsNumber() ? v.GetNumberAsDouble() : fallback;
            };
            const double a = number(t, "rotation", 0), x = pair("scale", 0, 1), y = pair("scale", 1, 1);
            to_uv.m[0][0] = std::cos(a) * x, to_uv.m[0][1] = std::sin(a) * y, to_uv.m[0][3] = pair("offset", 0, 0);
            to_uv.m[1][0] = -std::sin(a) * x, to_uv.m[1][1] = std::cos(a) * y, to_uv.m[1][3] = pair("offset", 1, 0);
            tex_coord = int(number(t, "texCoord", tex_coord));
        }
        if (tex_coord_ >= 0 && tex_coord != tex_coord_)
            c_.refuse(what_ + " uses several sets of texture coordinates", "the first of them is used");
        else
            tex_coord_ = tex_coord;
        set_transform(out, "to_uv", to_uv);
        if (texture.sampler < 0 || size_t(texture.sampler) >= c_.model.samplers.size()) return out;
        const tinygltf::Sampler& sampler = c_.model.samplers[size_t(texture.sampler)];
        const auto wrap = [](int mode) {
            return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? "clamp"
                   : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? "mirror"
                                                                   : "repeat";
        };
        set_text(out, "wrap_mode_u", wrap(sampler.wrapS));
        set_text(out, "wrap_mode_v", wrap(sampler.wrapT));
        if (sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST) set_text(out, "filter_type", "nearest");
        return out;
    }

    const Object& scaled(const Object& texture, Rgb factor) {
        if (factor == splat(1)) return texture;
        Object& out = object("texture", "scale");
        set_rgb(out, "scale", factor);
        add_child(out, texture);
        return out;
    }

    void set_color_or_texture(Object& parent, const char* name, Rgb factor, const Used& texture) {
        if (texture.index < 0) return set_rgb(parent, name, factor);
        add_child(parent, scaled(bitmap(texture, false), factor), name);
    }

    void set_number_or_texture(Object& parent, const char* name, double factor, const Used& texture,
                               const char* channel) {
        if (texture.index < 0) return set_number(parent, name, factor);
        add_child(parent, scaled(bitmap(texture, true, channel), splat(float(factor))), name);
    }

    double ior() { return number(extension(m_.extensions, "KHR_materials_ior"), "ior", 1.5); }

    /// Refuses textures of an extension.
    void without_textures(const tinygltf::Value& of, std::initializer_list<const char*> names) {
        for (const char* name : names)
            if (of.Has(name)) c_.refuse(what_ + ": " + name + " is not supported", "it is left out");
    }
    Rgb color_in(const tinygltf::Value& of, const char* name, Rgb fallback) {
        if (!of.Has(name) || !of.Get(name).IsArray() || of.Get(name).ArrayLen() < 3) return fallback;
        for (int i = 0; i < 3; ++i) fallback[i] = float(of.Get(name).Get(i).GetNumberAsDouble());
        return fallback;
    }

    /// Index of refraction of the opaque part: KHR_materials_specular scales the reflectance at normal incidence.
    double opaque_ior() {
        const tinygltf::Value* specular = extension(m_.extensions, "KHR_materials_specular");
        const double n = std::max(ior(), 1.0);
        if (!specular) return n;
        without_textures(*specular, {"specularTexture", "specularColorTexture"});
        const Rgb tint = color_in(*specular, "specularColorFactor", splat(1));
        const double factor = number(specular, "specularFactor", 1) * double(luminance(tint)),
                     reflectance = std::clamp((n - 1) * (n - 1) / ((n + 1) * (n + 1)) * factor, 0.0, 0.9);
        if (factor != 1)
            c_.note(
                "a specular factor scales the reflectance at normal incidence, not that at grazing angles; its "
                "colour counts by its luminance");
        return (1 + std::sqrt(reflectance)) / (1 - std::sqrt(reflectance));
    }

    void set_sheen(Object& out) {
        const tinygltf::Value* sheen = extension(m_.extensions, "KHR_materials_sheen");
        if (!sheen) return;
        without_textures(*sheen, {"sheenColorTexture", "sheenRoughnessTexture"});
        const float most = max_component(color_in(*sheen, "sheenColorFactor", splat(0)));
        if (!(most > 0)) return;
        set_number(out, "sheen", std::clamp(double(most), 0.0, 1.0));
        c_.note("sheen is approximated by that of the principled BSDF, which is white");
    }

    const Object& principled() {
        Object& out = object("bsdf", "principled");
        const auto& pbr = m_.pbrMetallicRoughness;
        set_color_or_texture(out, "base_color", base_, base_texture_);
        set_number_or_texture(out, "roughness", pbr.roughnessFactor, rough_texture_, "g");
        set_number_or_texture(out, "metallic", pbr.metallicFactor, rough_texture_, "b");
        set_number(out, "eta", opaque_ior());
        set_sheen(out);
        c_.note("metallic-roughness materials are Mitsuba's principled BSDF, whose diffuse lobe is Burley's");
        const tinygltf::Value* coat = extension(m_.extensions, "KHR_materials_clearcoat");
        if (number(coat, "clearcoatFactor", 0) > 0) {
            for (const char* name : {"clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"})
                if (coat->Has(name)) c_.refuse(what_ + ": " + name + " is not supported", "it is left out");
            const double rough = number(coat, "clearcoatRoughnessFactor", 0);
            set_number(out, "clearcoat", std::clamp(number(coat, "clearcoatFactor", 0), 0.0, 1.0));
            set_number(out, "clearcoat_gloss", std::clamp((0.1 - rough * rough) / 0.099, 0.0, 1.0));
            c_.note("clearcoats are approximated by those of the principled BSDF");
        }
        return out;
    }

    /// Light passes with the weight of the transmission: through a thin pane, or with a thickness into a volume.
    const Object& with_transmission() {
        const Object& opaque = principled();
        const tinygltf::Value* transmission = extension(m_.extensions, "KHR_materials_transmission");
        const Used texture = used(transmission, "transmissionTexture");
        const double weight = number(transmission, "transmissionFactor", 0);
        if (weight <= 0) return opaque;
        transmits_ = true;
        const tinygltf::Value* volume = extension(m_.extensions, "KHR_materials_volume");
        const bool thick = number(volume, "thicknessFactor", 0) > 0;
        if (number(volume, "attenuationDistance", INFINITY) < 1e30)
            c_.refuse(what_ + ": attenuation in a volume is not supported", "it is left out");
        const double rough = m_.pbrMetallicRoughness.roughnessFactor, alpha = rough * rough;
        const bool smooth = !thick || alpha < 1e-3 || ior() == 1;
        if (!thick && alpha >= 1e-3) c_.note("thin panes that transmit are smooth");
        if (!smooth && rough_texture_.index >= 0) c_.note("of rough glass the roughness is a number, no texture");
        Object& glass = object("bsdf", !thick ? "thindielectric" : smooth ? "dielectric" : "roughdielectric");
        set_number(glass, "int_ior", ior());
        set_number(glass, "ext_ior", 1);
        set_color_or_texture(glass, "specular_transmittance", base_, base_texture_);
        if (!smooth) {
            set_text(glass, "distribution", "ggx");
            set_number(glass, "alpha", alpha);
        }
        if (weight >= 1 && texture.index < 0 && m_.pbrMetallicRoughness.metallicFactor == 0) return glass;
        if (m_.pbrMetallicRoughness.metallicFactor > 0)
            c_.note("materials that transmit and are metallic are a blend by their transmission alone");
        Object& blend = object("bsdf", "blendbsdf");
        set_number_or_texture(blend, "weight", std::min(weight, 1.0), texture, "r");
        Object& both = object("bsdf", "twosided");
        add_child(both, opaque);
        add_child(blend, both);
        add_child(blend, glass);
        return blend;
    }

    const Object& with_normals(const Object& inner) {
        if (m_.normalTexture.scale != 1) c_.refuse(what_ + ": scaled normal maps are not supported", "the scale is 1");
        Object& out = object("bsdf", "normalmap");
        add_child(out, bitmap(used(m_.normalTexture), true));
        add_child(out, inner);
        c_.note("tangents of normal maps follow the texture coordinates");
        return out;
    }

    const Object& with_opacity(const Object& inner) {
        Object& mask = object("bsdf", "mask");
        const bool cut = m_.alphaMode == "MASK";
        if (base_texture_.index < 0) {
            set_number(mask, "opacity", cut ? alpha_ >= m_.alphaCutoff : std::clamp(alpha_, 0.0, 1.0));
        } else if (!cut) {
            add_child(mask, scaled(bitmap(base_texture_, true, "a"), splat(float(alpha_))), "opacity");
        } else {
            Object& texture = bitmap(base_texture_, true);
            Value& name = *std::find_if(texture.values.begin(), texture.values.end(),
                                        [](const Value& v) { return v.name == "image"; });
            const Texels source = c_.document.images[name.text];
            name.text += ", cut at " + std::to_string(m_.alphaCutoff);
            Texels& out = c_.document.images[name.text];
            out = {};
            out.width = source.width, out.height = source.height, out.is_8bit = true;
            for (size_t i = 0; i < size_t(out.width) * out.height; ++i) {
                const double a = source.is_8bit ? source.bytes[4 * i + 3] / 255.0 : source.floats[4 * i + 3];
                const uint8_t v = a * alpha_ >= m_.alphaCutoff ? 255 : 0;
                out.bytes.insert(out.bytes.end(), {v, v, v, 255});
            }
            c_.note("alpha is cut off texel by texel");
            add_child(mask, texture, "opacity");
        }
        add_child(mask, inner);
        return mask;
    }

    const Object* emitter() {
        const Rgb factor = color_of(m_.emissiveFactor, splat(0));
        const double strength =
            number(extension(m_.extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
        if (!(max_component(factor) * strength > 0)) return nullptr;
        Object& out = object("emitter", "area");
        set_color_or_texture(out, "radiance", factor * float(strength), used(m_.emissiveTexture));
        c_.emits = true;
        return &out;
    }

    Context& c_;
    const tinygltf::Material& m_;
    std::string what_;
    Rgb base_{};
    double alpha_ = 1;
    Used base_texture_, rough_texture_;
    int tex_coord_ = -1;
    bool transmits_ = false;
};

}  // namespace

Context::Surface surface(Context& context, int index) {
    const auto known = context.materials.find(index);
    if (known != context.materials.end()) return known->second;
    static const tinygltf::Material plain;
    if (index >= 0 && size_t(index) >= context.model.materials.size())
        context.fail("there is no material " + std::to_string(index));
    const tinygltf::Material& material = index < 0 ? plain : context.model.materials[size_t(index)];
    const std::string what =
        "material " + std::to_string(index) + (material.name.empty() ? "" : " '" + material.name + "'");
    return context.materials[index] = MaterialMaker(context, material, what).make();
}

}  // namespace ambilux::gltf
