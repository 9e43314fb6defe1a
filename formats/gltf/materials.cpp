#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/gltf/textures.h"

namespace ambilux::gltf {

using namespace document;

namespace {

constexpr const char* kGlossiness = "KHR_materials_pbrSpecularGlossiness";

Rgb color_of(const std::vector<double>& v, Rgb fallback) {
    return v.size() < 3 ? fallback : Rgb{float(v[0]), float(v[1]), float(v[2])};
}

class MaterialMaker {
public:
    MaterialMaker(Context& context, int index, const tinygltf::Material& material, const Use& use,
                  const std::string& what)
        : c_(context), m_(material), what_(what), colors_(use.colors), use_(use), textures_(context, index, what) {}

    Context::Surface make() {
        if (m_.extensions.contains("KHR_materials_unlit"))
            c_.note("unlit surfaces are lit, as by programs that do not know the extension");
        const auto& pbr = m_.pbrMetallicRoughness;
        base_ = at_most_1(color_of(pbr.baseColorFactor, splat(1)), "baseColorFactor");
        alpha_ = pbr.baseColorFactor.size() > 3 ? pbr.baseColorFactor[3] : 1;
        base_texture_ = textures_.with_image(used(pbr.baseColorTexture));
        rough_texture_ = textures_.with_image(used(pbr.metallicRoughnessTexture));
        rough_ = c_.at_most_1(pbr.roughnessFactor, what_ + ": roughnessFactor");
        metallic_ = c_.at_most_1(pbr.metallicFactor, what_ + ": metallicFactor");
        if (const auto* given = extension(m_.extensions, kGlossiness)) convert(*given);
        normal_texture_ = textures_.with_image(used(m_.normalTexture));
        if (!colors_.varies) base_ *= colors_.color;
        if (!colors_.alpha_varies) alpha_ *= colors_.alpha;
        const Object* bsdf = &with_transmission();
        if (normal_texture_.index >= 0) bsdf = &with_normals(*bsdf);
        if (!transmits_) {
            Object& both = object("bsdf", "twosided");
            add_child(both, *bsdf);
            bsdf = &both;
            if (!m_.doubleSided) c_.note("surfaces that glTF shows from one side are visible from both");
        }
        if (m_.occlusionTexture.index >= 0) c_.note("occlusion textures are left out: light is traced");
        if (m_.alphaMode != "OPAQUE") bsdf = &with_opacity(*bsdf);
        const bool double_sided = m_.doubleSided && bsdf->type == "twosided";
        const Object* light = emitter();
        if (light)
            c_.note(double_sided ? "two-sided emissive surfaces become two, a hundred-thousandth of their extent apart"
                                 : "emissive surfaces emit on their front side only");
        return {bsdf, light, textures_.tex_coord(), double_sided, normal_texture_.index >= 0, textures_.any()};
    }

private:
    Object& object(const char* tag, const char* type) { return add_object(c_.document, tag, type, c_.where); }

    Rgb at_most_1(Rgb color, const char* name) {
        for (int k = 0; k < 3; ++k) color[k] = float(c_.at_most_1(double(color[k]), what_ + ": " + name));
        return color;
    }

    /// The extension takes the place of the metallic-roughness part, which is for programs that do not know it.
    void convert(const tinygltf::Value& given) {
        SpecularGlossiness from;
        from.diffuse = color_in(given, "diffuseFactor", splat(1));
        from.specular = color_in(given, "specularFactor", splat(1));
        from.glossiness = number(&given, "glossinessFactor", 1);
        from.diffuse_texture = textures_.with_image(used(&given, "diffuseTexture"));
        from.texture = textures_.with_image(used(&given, "specularGlossinessTexture"));
        alpha_ = 1;
        if (given.Has("diffuseFactor") && given.Get("diffuseFactor").ArrayLen() > 3)
            alpha_ = given.Get("diffuseFactor").Get(3).GetNumberAsDouble();
        base_ = splat(1), rough_ = metallic_ = 1;
        base_texture_ = rough_texture_ = {};
        if (from.diffuse_texture.index >= 0 || from.texture.index >= 0) {
            textures_.convert(from, base_texture_, rough_texture_);
        } else {
            const BaseAndMetal as = base_and_metal(from.diffuse, from.specular);
            base_ = as.base, metallic_ = as.metallic, rough_ = 1 - from.glossiness;
        }
        c_.note("specular-glossiness materials are converted to metallic-roughness");
    }

    const Object& attribute(const char* name) {
        Object& out = object("texture", "mesh_attribute");
        set_text(out, "name", name);
        return out;
    }

    void set_color_or_texture(Object& parent, const char* name, Rgb factor, const Used& texture) {
        if (texture.index < 0) return set_rgb(parent, name, factor);
        add_child(parent, textures_.scaled(textures_.bitmap(texture, false), factor), name);
    }
    void set_base(Object& parent, const char* name) {
        if (!colors_.varies) return set_color_or_texture(parent, name, base_, base_texture_);
        add_child(parent, textures_.scaled(attribute("vertex_color"), base_), name);
    }

    void set_number_or_texture(Object& parent, const char* name, double factor, const Used& texture,
                               const char* channel) {
        if (texture.index < 0) return set_number(parent, name, factor);
        add_child(parent, textures_.scaled(textures_.bitmap(texture, true, channel), splat(float(factor))), name);
    }

    /// 0 stands for a Fresnel term of 1.
    double ior() {
        const double n = number(extension(m_.extensions, "KHR_materials_ior"), "ior", 1.5);
        return n == 0 ? 1000 : n;
    }

    /// Mean of a texture that has no place here, or 1.
    Rgb mean_of(const tinygltf::Value* of, const char* name, bool raw) {
        const Used texture = textures_.with_image(used(of, name));
        if (texture.index < 0) return splat(1);
        c_.note(std::string(name) + " counts by its mean");
        return textures_.mean(texture, raw);
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
        if (specular->Has("specularTexture")) c_.note("specularTexture is left out: its factor counts");
        const Rgb tint =
            color_in(*specular, "specularColorFactor", splat(1)) * mean_of(specular, "specularColorTexture", false);
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
        const float most =
            max_component(color_in(*sheen, "sheenColorFactor", splat(0)) * mean_of(sheen, "sheenColorTexture", false));
        if (!(most > 0)) return;
        set_number(out, "sheen", std::clamp(double(most), 0.0, 1.0));
        c_.note("sheen is approximated by that of the principled BSDF, which is white");
    }

    /// glTF's roughness along the tangent is mix(a, 1, strength²), across it a, the square of what it calls roughness.
    /// The principled BSDF has a²/s and a²·s with s² = 1 - 0.9·anisotropic.
    bool set_anisotropy(Object& out) {
        const tinygltf::Value* given = extension(m_.extensions, "KHR_materials_anisotropy");
        const double strength = std::clamp(number(given, "anisotropyStrength", 0), 0.0, 1.0);
        if (!(strength > 0)) return false;
        if (given->Has("anisotropyTexture")) c_.note("anisotropyTexture is left out: the strength counts");
        if (number(given, "anisotropyRotation", 0) != 0)
            c_.note("anisotropy follows the texture coordinates; its rotation is ignored");
        const double mean = rough_texture_.index >= 0 ? double(textures_.mean(rough_texture_, true).y) : 1,
                     rough = rough_ * mean, across = std::max(rough * rough, 1e-3),
                     along = across + (1 - across) * strength * strength, anisotropic = (1 - across / along) / 0.9;
        if (anisotropic > 1) c_.note("the ratio of the two roughnesses of an anisotropic surface is 10 at most");
        set_number(out, "anisotropic", std::min(anisotropic, 1.0));
        set_number_or_texture(out, "roughness", std::pow(along * across, 0.25) / mean, rough_texture_, "g");
        return true;
    }

    const Object& principled() {
        Object& out = object("bsdf", "principled");
        set_base(out, "base_color");
        set_number_or_texture(out, "metallic", metallic_, rough_texture_, "b");
        if (!set_anisotropy(out)) set_number_or_texture(out, "roughness", rough_, rough_texture_, "g");
        set_number(out, "eta", opaque_ior());
        set_sheen(out);
        c_.note("metallic-roughness materials are Mitsuba's principled BSDF, whose diffuse lobe is Burley's");
        const tinygltf::Value* coat = extension(m_.extensions, "KHR_materials_clearcoat");
        if (number(coat, "clearcoatFactor", 0) > 0) {
            const double factor =
                             number(coat, "clearcoatFactor", 0) * double(mean_of(coat, "clearcoatTexture", true).x),
                         rough = number(coat, "clearcoatRoughnessFactor", 0) *
                                 double(mean_of(coat, "clearcoatRoughnessTexture", true).y);
            if (coat->Has("clearcoatNormalTexture")) c_.note("clearcoats have the normals of the base");
            set_number(out, "clearcoat", std::clamp(factor, 0.0, 1.0));
            set_number(out, "clearcoat_gloss", std::clamp((0.1 - rough * rough) / 0.099, 0.0, 1.0));
            c_.note("clearcoats are approximated by those of the principled BSDF");
        }
        return out;
    }

    /// What is left behind one of the two boundaries that light crosses.
    Rgb attenuation_at_boundary(const tinygltf::Value& volume) {
        const double distance = number(&volume, "attenuationDistance", INFINITY);
        const Rgb color = color_in(volume, "attenuationColor", splat(1));
        if (!(distance > 0 && distance < 1e30) || color == splat(1)) return splat(1);
        c_.note("attenuation in a volume uses the thickness of the file, half of it at each boundary");
        const double passed =
            number(&volume, "thicknessFactor", 0) * double(mean_of(&volume, "thicknessTexture", true).y) / distance / 2;
        Rgb out;
        for (int k = 0; k < 3; ++k) out[k] = float(std::pow(std::clamp(double(color[k]), 0.0, 1.0), passed));
        return out;
    }

    /// Of both sides of what is opaque, and of what lets light pass.
    const Object& blend_of(Object& blend, const Object& opaque, const Object& through) {
        Object& both = object("bsdf", "twosided");
        add_child(both, opaque);
        add_child(blend, both);
        add_child(blend, through);
        return blend;
    }

    /// A share of the light that is scattered passes; that share reflects nothing.
    const Object* with_diffuse_transmission(const Object& opaque) {
        const tinygltf::Value* given = extension(m_.extensions, "KHR_materials_diffuse_transmission");
        const double weight = number(given, "diffuseTransmissionFactor", 0);
        if (!(weight > 0)) return nullptr;
        transmits_ = true;
        c_.note("KHR_materials_diffuse_transmission also weakens the highlight");
        Object &blend = object("bsdf", "blendbsdf"), &through = object("bsdf", "difftrans");
        set_number_or_texture(blend, "weight", std::min(weight, 1.0),
                              textures_.with_image(used(given, "diffuseTransmissionTexture")), "a");
        set_color_or_texture(
            through, "transmittance",
            at_most_1(color_in(*given, "diffuseTransmissionColorFactor", splat(1)), "diffuseTransmissionColorFactor"),
            textures_.with_image(used(given, "diffuseTransmissionColorTexture")));
        return &blend_of(blend, opaque, through);
    }

    /// Light passes with the weight of the transmission: through a thin pane, or with a thickness into a volume.
    const Object& with_transmission() {
        const Object& opaque = principled();
        const tinygltf::Value* transmission = extension(m_.extensions, "KHR_materials_transmission");
        const Used texture = textures_.with_image(used(transmission, "transmissionTexture"));
        const double weight = number(transmission, "transmissionFactor", 0);
        if (weight <= 0) {
            const Object* leaf = with_diffuse_transmission(opaque);
            return leaf ? *leaf : opaque;
        }
        transmits_ = true;
        const tinygltf::Value* volume = extension(m_.extensions, "KHR_materials_volume");
        const bool thick = number(volume, "thicknessFactor", 0) > 0;
        const double alpha = rough_ * rough_;
        const bool smooth = !thick || alpha < 1e-3 || ior() == 1;
        if (!thick && alpha >= 1e-3) c_.note("thin panes that transmit are smooth");
        if (!smooth && rough_texture_.index >= 0) c_.note("rough glass has one roughness, without a texture");
        Object& glass = object("bsdf", !thick ? "thindielectric" : smooth ? "dielectric" : "roughdielectric");
        set_number(glass, "int_ior", ior());
        set_number(glass, "ext_ior", 1);
        const Rgb base = base_;
        if (thick) base_ *= attenuation_at_boundary(*volume);
        set_base(glass, "specular_transmittance");
        base_ = base;
        if (!smooth) {
            set_text(glass, "distribution", "ggx");
            set_number(glass, "alpha", alpha);
        }
        if (weight >= 1 && texture.index < 0 && metallic_ == 0) return glass;
        if (metallic_ > 0) c_.note("metallic materials that transmit are blended by their transmission alone");
        Object& blend = object("bsdf", "blendbsdf");
        set_number_or_texture(blend, "weight", std::min(weight, 1.0), texture, "r");
        return blend_of(blend, opaque, glass);
    }

    const Object& with_normals(const Object& inner) {
        Object& out = object("bsdf", "normalmap");
        set_boolean(out, "flip_invalid_normals", true);  // else steep maps are black at silhouettes
        set_boolean(out, "use_shadowing_function", false);
        add_child(out, textures_.normals(normal_texture_, m_.normalTexture.scale, use_.mirrored, !use_.tangents));
        add_child(out, inner);
        if (use_.tangents) c_.note("tangents of normal maps follow the texture coordinates, not those of the file");
        return out;
    }

    /// Alpha of a surface that is not opaque: a number, or a texture where it varies.
    struct Opacity {
        double number = 1;
        const Object* texture = nullptr;
    };

    Opacity opacity() {
        const bool cut = m_.alphaMode == "MASK";
        if (colors_.alpha_varies) {
            if (cut) c_.note("alpha of vertices is not cut off");
            return {1, &textures_.scaled(attribute("vertex_alpha"), splat(float(alpha_)))};
        }
        if (base_texture_.index < 0) return {cut ? double(alpha_ >= m_.alphaCutoff) : std::clamp(alpha_, 0.0, 1.0)};
        if (!cut)
            return {1,
                    &textures_.scaled(textures_.bitmap(base_texture_, true, "a"), splat(float(std::min(alpha_, 1.0))))};
        c_.note("alpha is cut off texel by texel");
        return {1, &textures_.cut_alpha(base_texture_, alpha_, m_.alphaCutoff)};
    }

    const Object& with_opacity(const Object& inner) {
        Object& mask = object("bsdf", "mask");
        opacity_ = opacity();
        if (opacity_.texture)
            add_child(mask, *opacity_.texture, "opacity");
        else
            set_number(mask, "opacity", opacity_.number);
        add_child(mask, inner);
        return mask;
    }

    /// Alpha covers what a surface emits, too; a mask leaves that alone.
    const Object* emitter() {
        const double strength =
            number(extension(m_.extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
        const Rgb radiance = color_of(m_.emissiveFactor, splat(0)) * float(strength * opacity_.number);
        if (!(max_component(radiance) > 0)) return nullptr;
        const Used texture = textures_.with_image(used(m_.emissiveTexture));
        // Exporters write one for every material.
        if (texture.index >= 0 && !(max_component(textures_.mean(texture, false) * radiance) > 0)) return nullptr;
        Object& out = object("emitter", "area");
        if (opacity_.texture && texture.index < 0 && !colors_.alpha_varies) {
            add_child(out, textures_.scaled(*opacity_.texture, radiance), "radiance");
        } else {
            if (opacity_.texture) c_.note("surfaces whose light or alpha varies shine where their alpha is 0 too");
            set_color_or_texture(out, "radiance", radiance, texture);
        }
        c_.emits = true;
        return &out;
    }

    Context& c_;
    const tinygltf::Material& m_;
    std::string what_;
    VertexColors colors_;
    Use use_;
    TextureMaker textures_;
    Rgb base_{};
    double alpha_ = 1, rough_ = 1, metallic_ = 1;
    Used base_texture_, rough_texture_, normal_texture_;
    bool transmits_ = false;
    Opacity opacity_;
};

}  // namespace

bool has_colored_textures(const Context& context, int index, const VertexColors& colors) {
    if (index < 0 || size_t(index) >= context.model.materials.size()) return false;
    const tinygltf::Material& m = context.model.materials[size_t(index)];
    if (!colors.varies && !(colors.alpha_varies && m.alphaMode != "OPAQUE")) return false;
    const auto& pbr = m.pbrMetallicRoughness;
    for (const int texture : {pbr.baseColorTexture.index, pbr.metallicRoughnessTexture.index, m.normalTexture.index,
                              m.emissiveTexture.index})
        if (texture >= 0) return true;
    for (const auto& [of, name] :
         {std::pair{"KHR_materials_transmission", "transmissionTexture"},
          std::pair{"KHR_materials_diffuse_transmission", "diffuseTransmissionTexture"},
          std::pair{"KHR_materials_diffuse_transmission", "diffuseTransmissionColorTexture"},
          std::pair{kGlossiness, "diffuseTexture"}, std::pair{kGlossiness, "specularGlossinessTexture"}})
        if (used(extension(m.extensions, of), name).index >= 0) return true;
    return false;
}

Context::Surface surface(Context& context, int index, const Use& use) {
    const VertexColors& colors = use.colors;
    const std::string key =
        fmt::format("{}|{}|{}|{}|{}|{}|{}|{}|{}", index, colors.color.x, colors.color.y, colors.color.z, colors.alpha,
                    colors.varies, colors.alpha_varies, use.mirrored, use.tangents);
    const auto known = context.materials.find(key);
    if (known != context.materials.end()) return known->second;
    static const tinygltf::Material plain;
    if (index >= 0 && size_t(index) >= context.model.materials.size())
        context.fail("there is no material " + std::to_string(index));
    const tinygltf::Material& material = index < 0 ? plain : context.model.materials[size_t(index)];
    const std::string what =
        "material " + std::to_string(index) + (material.name.empty() ? "" : " '" + material.name + "'");
    return context.materials[key] = MaterialMaker(context, index, material, use, what).make();
}

}  // namespace ambilux::gltf
