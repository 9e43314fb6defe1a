#include <algorithm>
#include <cmath>

#include "formats/document/named_media.h"
#include "formats/document/plugins.h"
#include "formats/pbrt/coating.h"
#include "formats/pbrt/names.h"
#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

constexpr double kSmooth = 1e-3;  // alpha below which pbrt takes a surface for smooth

struct Roughness {
    Texture u, v;
    bool remap = true;

    double alpha(double r) const { return remap ? std::sqrt(std::max(r, 0.0)) : r; }
    bool is_smooth() const {
        return u.is_constant() && v.is_constant() && std::max(alpha(u.color.x), alpha(v.color.x)) < kSmooth;
    }
};

class MaterialMaker {
public:
    MaterialMaker(SceneMaker& scene, const Described& material, Surface surface)
        : scene_(scene), in_(material.in), space_(material.space), surface_(surface), uv_(uv_map(surface)) {}

    const Object* make() {
        const std::string& type = in_.type;
        if (type == "interface" || type.empty() || type == "none") return finish(bsdf("null"), true);
        if (type == "diffuse") return finish(diffuse(), false);
        if (type == "coateddiffuse") return finish(coated_diffuse(), false);
        if (type == "conductor") return finish(bare_conductor(), false);
        if (type == "coatedconductor") return finish(coated_conductor(), false);
        if (type == "dielectric") return finish(dielectric(), true);
        if (type == "thindielectric") return finish(thin_dielectric(), true);
        if (type == "diffusetransmission") return finish(diffuse_transmission(), true);
        if (type == "mix") return mix();
        scene_.report.refuse(in_.where, not_supported("material", type),
                             "a diffuse surface of reflectance 0.5 is used");
        for (const Parameter& p : in_.list) p.used = true;
        Object& grey = bsdf("diffuse");
        set_rgb(grey, "reflectance", splat(0.5f));
        return finish(grey, false);
    }

private:
    Object& bsdf(const std::string& type) { return add_object(scene_.document, "bsdf", type, in_.where); }
    Textures& textures() { return scene_.textures; }
    Texture reflectance(const char* name, double fallback) {
        return textures().color(in_, name, splat(float(fallback)), ColorUse::reflectance, space_);
    }

    /// Without Mitsuba's rules for normals that face away.
    Object& map_of(const char* type) {
        Object& object = bsdf(type);
        set_boolean(object, "flip_invalid_normals", false);
        set_boolean(object, "use_shadowing_function", false);
        return object;
    }

    /// With maps and, unless light passes, for both sides.
    const Object* finish(Object& object, bool transmits) {
        const Object* out = &object;
        const std::string map = in_.text("normalmap", "");
        const Parameter* bumps = in_.find("displacement");
        if (bumps && !map.empty())
            scene_.report.refuse(bumps->where, "displacement and a normal map on one material are not supported",
                                 "the displacement is left out");
        if (!map.empty()) {
            const Where at = in_.where_of("normalmap");
            const Texture texture = texture_of_file(resolve(scene_.folder, map, at), at);
            texture.image->gamma = 1;
            Object& outer = map_of("normalmap");
            add_child(outer, textures().object(texture, uv_));
            add_child(outer, object);
            out = &outer;
        } else if (bumps) {
            Object& outer = map_of("bumpmap");
            Texture heights = textures().number(in_, "displacement", 0);
            if (heights.kind == Texture::Kind::image) {
                set_number(outer, "scale", heights.color.x);
                heights.color = splat(1);
            }
            add_child(outer, textures().object(heights, uv_));
            add_child(outer, object);
            out = &outer;
        }
        in_.finish(scene_.report);
        if (transmits) return out;
        Object& both = bsdf("twosided");
        add_child(both, *out);
        return &both;
    }

    Roughness roughness(const std::string& prefix, double fallback) {
        Roughness r;
        const Texture both = textures().number(in_, prefix + "roughness", fallback);
        const auto along = [&](const char* axis) {
            const std::string name = prefix + axis + "roughness";
            return in_.find(name) ? textures().number(in_, name, fallback) : both;
        };
        r.u = along("u"), r.v = along("v");
        r.remap = in_.boolean("remaproughness", true);
        for (const Texture& t : {r.u, r.v})
            if (t.is_constant() && !(t.color.x >= 0)) fail(t.where, "roughness must not be negative");
        return r;
    }

    void set_roughness(Object& object, const Roughness& r, bool isotropic = false) {
        set_text(object, "distribution", "ggx");
        const auto alpha = [&r](double x) { return r.alpha(x); };
        scene_.report.note(in_.where,
                           "masking and shadowing are uncorrelated, as in Mitsuba; pbrt "
                           "correlates them by height");
        if (isotropic) {
            const double u = alpha(textures().mean(r.u)), v = alpha(textures().mean(r.v));
            if (!r.u.is_constant() || !r.v.is_constant() || u != v)
                scene_.report.note(in_.where,
                                   "a coating has the mean of its roughness everywhere and in all directions");
            return set_number(object, "alpha", std::sqrt(std::max(u * v, 1e-6)));
        }
        const bool textured = !r.u.is_constant() || !r.v.is_constant();
        const auto value = [&](double x) { return textured ? std::max(alpha(x), 1e-4) : alpha(x); };
        textures().set_number(object, "alpha_u", r.u, uv_, value);
        textures().set_number(object, "alpha_v", r.v, uv_, value);
    }

    Object& diffuse() {
        Object& object = bsdf("diffuse");
        textures().set_color(object, "reflectance", reflectance("reflectance", 0.5), uv_);
        return object;
    }

    /// What the layers of a coating have beside roughness.
    Coating coating(const char* eta) {
        const Parameter* albedo = in_.find("albedo");
        bool absorbs = albedo && albedo->is_texture();
        for (double a : albedo ? albedo->numbers : std::vector<double>{}) absorbs |= a != 0;
        if (absorbs)
            scene_.report.refuse(albedo->where, "a medium inside of a coating is not supported", "it is left out");
        in_.ignore({"nsamples", "g"});  // how pbrt walks at random; of the medium
        const Texture thickness = textures().number(in_, "thickness", 0.01);
        if (!thickness.is_constant())
            scene_.report.note(thickness.where, "a coating has the mean of its thickness everywhere");
        const int64_t depth = in_.integer("maxdepth", 10);
        if (depth < 1) fail(in_.where_of("maxdepth"), "the maxdepth of a coating must be positive");
        return {scene_.spectra().ior(in_, eta, 1.5), std::max(textures().mean(thickness), 0.0), depth};
    }

    /// The reflectance of a diffuse surface below a coating: that of a texture is scaled as its mean is.
    Texture below(const Coating& coating, Texture texture) {
        if (texture.is_constant()) {
            texture.color = coating.diffuse_below(texture.color);
            return texture;
        }
        const double mean = std::clamp(textures().mean(texture), 1e-3, 1.0);
        const float scale = float(double(coating.diffuse_below(splat(float(mean))).x) / mean);
        texture.color *= scale;
        if (texture.kind == Texture::Kind::checkerboard) texture.odd *= scale;
        return texture;
    }

    Object& coated_diffuse() {
        const Roughness r = roughness("", 0);
        const Coating coat = coating("eta");
        Object& object = bsdf(r.is_smooth() ? "plastic" : "roughplastic");
        scene_.report.note(in_.where, "coateddiffuse is approximated by " + object.type +
                                          ": layers in closed form instead of random walks");
        textures().set_color(object, "diffuse_reflectance", below(coat, reflectance("reflectance", 0.5)), uv_);
        set_number(object, "int_ior", coat.eta);
        set_number(object, "ext_ior", 1);
        set_boolean(object, "nonlinear", true);
        if (!r.is_smooth()) set_roughness(object, r, true);
        return object;
    }

    struct Metal {
        Rgb eta, k;
    };
    /// Index of reflectance R at normal incidence with eta = 1.
    static Metal metal_of(Rgb reflectance) {
        Metal metal{splat(1), {}};
        for (int i = 0; i < 3; ++i) {
            const double r = std::clamp(double(reflectance[i]), 0.0, 0.9999);
            metal.k[i] = float(2 * std::sqrt(r) / std::sqrt(1 - r));
        }
        return metal;
    }

    /// Sets a texture of the reflectance, if there is one: `is_textured`.
    Metal metal(const std::string& prefix, Object& object, bool& is_textured) {
        Metal metal;
        find_metal("Cu", metal.eta, metal.k);
        const Parameter *eta = in_.find(prefix + "eta"), *k = in_.find(prefix + "k");
        std::optional<Texture> colored;
        if (in_.find("reflectance")) colored = reflectance("reflectance", 0.5);
        if (colored && (eta || k)) fail(in_.where, "both a reflectance and eta or k are given");
        if (colored && colored->is_constant()) return metal_of(colored->color);
        is_textured = colored.has_value();
        if (colored) {
            scene_.report.note(in_.where, "a textured reflectance of a metal holds at all angles");
            textures().set_color(object, "specular_reflectance", *colored, uv_);
            return {splat(0), splat(1)};
        }
        for (const Parameter* p : {eta, k})
            if (p && p->is_texture()) fail(p->where, "textures of eta and k are not supported");
        if (eta) metal.eta = scene_.spectra().color(*eta, ColorUse::unbounded, space_);
        if (k) metal.k = scene_.spectra().color(*k, ColorUse::unbounded, space_);
        return metal;
    }

    Object& conductor(const std::string& prefix, Metal& m, bool& is_textured) {
        const Roughness r = roughness(prefix, 0);
        Object& object = bsdf(r.is_smooth() ? "conductor" : "roughconductor");
        if (!r.is_smooth()) set_roughness(object, r);
        m = metal(prefix, object, is_textured);
        set_rgb(object, "eta", m.eta);
        set_rgb(object, "k", m.k);
        return object;
    }

    Object& bare_conductor() {
        Metal m;
        bool is_textured = false;
        return conductor("", m, is_textured);
    }

    Object& coated_conductor() {
        roughness("interface.", 0);  // the coating is taken for smooth
        Metal m;
        bool is_textured = false;
        Object& object = conductor("conductor.", m, is_textured);
        const Coating coat = coating("interface.eta");
        scene_.report.note(in_.where, "coatedconductor is approximated by " + object.type +
                                          " with the reflectance that coating and metal have at normal incidence");
        if (is_textured) return object;
        // All orders of reflection between a smooth coating and the metal below it, over that of the metal alone.
        const auto fresnel = [](double n, double eta, double k) {
            return ((eta - n) * (eta - n) + k * k) / ((eta + n) * (eta + n) + k * k);
        };
        Rgb ratio;
        for (int i = 0; i < 3; ++i) {
            const double outer = fresnel(1, coat.eta, 0);
            const double inner = fresnel(coat.eta, m.eta[i], m.k[i]) * std::exp(-2 * coat.thickness);
            const double both = outer + (1 - outer) * (1 - outer) * inner / (1 - outer * inner);
            ratio[i] = float(std::min(both / std::max(fresnel(1, m.eta[i], m.k[i]), 1e-6), 1.0));
        }
        set_rgb(object, "specular_reflectance", ratio);
        return object;
    }

    Object& dielectric() {
        const Roughness r = roughness("", 0);
        const double eta = scene_.spectra().ior(in_, "eta", 1.5);
        const bool smooth = r.is_smooth() || eta == 1;
        Object& object = bsdf(smooth ? "dielectric" : "roughdielectric");
        set_number(object, "int_ior", eta);
        set_number(object, "ext_ior", 1);
        if (!smooth) set_roughness(object, r);
        return object;
    }

    Object& thin_dielectric() {
        Object& object = bsdf("thindielectric");
        set_number(object, "int_ior", scene_.spectra().ior(in_, "eta", 1.5));
        set_number(object, "ext_ior", 1);
        return object;
    }

    /// Of all places and channels.
    double largest(const Texture& texture) {
        double most = texture.kind == Texture::Kind::image ? 0 : 1;
        if (texture.kind == Texture::Kind::image)
            for (const Rgb& c : textures().texels_of(texture).texels) most = std::max(most, double(max_component(c)));
        const double odd = texture.kind == Texture::Kind::checkerboard ? max_component(texture.odd) : 0;
        return std::max(max_component(texture.color) * most, odd);
    }

    /// A blend of what reflects and what transmits, each divided by its weight.
    Object& diffuse_transmission() {
        Texture r = reflectance("reflectance", 0.25), t = reflectance("transmittance", 0.25);
        const double scale = in_.number("scale", 1);
        const double of_r = largest(r) * scale, of_t = largest(t) * scale;
        const double weight = of_r + of_t > 0 ? of_t / (of_r + of_t) : 0.5;
        // Each lobe of the blend takes its share of the light, and no surface may reflect more than what arrives.
        if (of_r + of_t > 1 + 1e-6) {
            const std::string problem =
                "the largest values of reflectance and transmittance of diffusetransmission "
                "add up to more than 1";
            if (r.is_constant() && t.is_constant())
                scene_.report.refuse(in_.where, problem + ", which is not supported", "both are clipped");
            else
                scene_.report.note(in_.where, problem + ": both are clipped");
        }
        const auto part = [&](const char* type, const char* name, Texture& texture, double share) -> Object& {
            Object& object = bsdf(type);
            texture.color *= float(share > 0 ? scale / share : 0);
            if (texture.kind == Texture::Kind::checkerboard) texture.odd *= float(share > 0 ? scale / share : 0);
            if (texture.is_constant()) texture.color = min(texture.color, splat(1));
            textures().set_color(object, name, texture, uv_);
            return object;
        };
        Object &blend = bsdf("blendbsdf"), &both = bsdf("twosided");
        set_number(blend, "weight", weight);
        add_child(both, part("diffuse", "reflectance", r, 1 - weight));
        add_child(blend, both);
        add_child(blend, part("difftrans", "transmittance", t, weight));
        return blend;
    }

    const Object* mix() {
        const Parameter* names = in_.find("materials");
        if (!names || names->strings.size() != 2) fail(in_.where, "a mix needs the names of two materials");
        Object& blend = bsdf("blendbsdf");
        const Texture amount = textures().number(in_, "amount", 0.5);
        textures().set_number(blend, "weight", amount, uv_);
        for (const std::string& name : names->strings) {
            const Shared& named = known_as(scene_.named_materials, name, names->where, "material");
            const Object* part = surface_material(scene_, named, surface_);
            if (!part) fail(names->where, "material '" + name + "' is a mix of itself");
            add_child(blend, *part);
        }
        in_.finish(scene_.report);
        return &blend;
    }

    SceneMaker& scene_;
    const Parameters& in_;
    ColorSpace space_;
    Surface surface_;
    UvMap uv_;
};

}  // namespace

UvMap uv_map(Surface surface) {
    switch (surface) {
        case Surface::sphere: return {{{1, 0, 0}, {0, -1, 1}}};
        case Surface::disk: return {{{0, 1, 0}, {-1, 0, 1}}};
        default: return {};
    }
}

const Object* surface_material(SceneMaker& scene, const Shared& material, Surface surface) {
    static const Shared plain = std::make_shared<const Described>(Described{{"Material", "diffuse", {}, {}}});
    const Shared& described = material ? material : plain;
    const auto known = scene.materials.find({described, surface});
    if (known != scene.materials.end()) return known->second;
    // A mix of itself comes back to it without a BSDF.
    scene.materials[{described, surface}] = nullptr;
    const Object* made = MaterialMaker(scene, *described, surface).make();
    return scene.materials[{described, surface}] = made;
}

}  // namespace ambilux::pbrt
