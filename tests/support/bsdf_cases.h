// BSDFs with the parameters that the tests run through.
#pragma once

#include <array>
#include <cstdio>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "core/rng.h"
#include "transport/bsdf.h"
#include "transport/bsdf/precompute.h"

namespace ambilux::test {

struct BsdfCase {
    std::string name;
    Bsdf bsdf;
};

inline bool is_transmissive(const Bsdf& b) { return bsdf_transmits(b.type); }

/// op(parameters) with those of b's model; what it changes is changed in b.
template <class Op>
void edit_parameters(Bsdf& b, Op op) {
    BsdfModels::visit<BsdfModels::kAll>(uint32_t(b.type), false, [&](auto model) {
        auto parameters = b.as<typename decltype(model)::type>();
        op(parameters);
        const float32* coat = b.coat;
        b = bsdf_of(parameters, b.tables);
        b.coat = coat;
        return true;
    });
}
template <class Model, class Op>
Bsdf edited(const Bsdf& b, Op op) {
    Resolved<Model> parameters = b.as<Model>();
    op(parameters);
    return bsdf_of(parameters, b.tables);
}

/// Index of refraction; 0 for a BSDF without one.
inline float ior_of(Bsdf b) {
    float ior = 0;
    edit_parameters(b, [&](auto& p) {
        if constexpr (requires { p.ior; }) ior = p.ior;
    });
    return ior;
}
/// The smaller roughness of a microfacet distribution, which the others have not: 0.
inline float least_alpha(Bsdf b) {
    float alpha = 0;
    edit_parameters(b, [&](auto& p) {
        if constexpr (requires { p.alpha_u; })
            alpha = std::min(p.alpha_u, p.alpha_v);
        else if constexpr (requires { p.alpha, p.distribution; })
            alpha = p.alpha;
        else if constexpr (requires { p.through; }) {
            const MicrofacetDistribution narrow = BsdfAt<PrincipledThin>{p}.microfacets(false);
            alpha = p.specular > 0 ? std::min(narrow.alpha_u, narrow.alpha_v) : 0;
        }
    });
    return alpha;
}

/// Transmittance table that lives as long as the test.
inline const float* cached_table(Microfacets m, float alpha, float ior) {
    static std::map<std::tuple<int, float, float>, std::array<float, kTransmittanceTableSize>> tables;
    auto [it, fresh] = tables.try_emplace({int(m), alpha, ior});
    if (fresh) rough_transmittance_table(m, alpha, ior, it->second.data());
    return it->second.data();
}

/// `b` under a coating that lives as long as the test; smooth for alpha 0.
inline Bsdf coated(Bsdf b, float ior, float alpha, Rgb absorption) {
    static std::vector<std::vector<float>> coats;
    std::vector<float> coat = {ior, alpha, 1, 0.6f, 0.9f, 1, 0.8f, absorption.x, absorption.y, absorption.z, 0, 0};
    if (alpha > 0) {
        const float* table = cached_table(Microfacets::ggx, alpha, ior);
        coat.insert(coat.end(), table, table + kTransmittanceTableSize);
    }
    coats.push_back(std::move(coat));
    b.coat = coats.back().data();
    return b;
}

constexpr Microfacets kMicrofacets[] = {Microfacets::beckmann, Microfacets::ggx, Microfacets::phong};
constexpr const char* kMicrofacetNames[] = {"beckmann", "ggx", "phong"};

/// Distributions with the ways to sample them: visible normals, or all.
inline std::vector<std::pair<Microfacets, bool>> sampled_microfacets() {
    using enum Microfacets;
    return {{beckmann, true}, {beckmann, false}, {ggx, true}, {ggx, false}, {phong, false}};
}

/// All colours 1, index 1.5.
template <class Model>
Resolved<Model> white() {
    Resolved<Model> p = resolved<Model>({{splat(1), splat(1)}, {}}, {});
    if constexpr (requires { p.ior; }) p.ior = 1.5f;
    return p;
}
inline Bsdf conductor(Rgb eta, Rgb k) {
    Resolved<Conductor> p = white<Conductor>();
    p.eta = eta;
    p.k = k;
    return bsdf_of(p);
}
template <class Model>
Bsdf smooth_dielectric(float ior = 1.5f) {
    Resolved<Model> p = white<Model>();
    p.ior = ior;
    return bsdf_of(p);
}

inline Bsdf rough_conductor(Microfacets m, bool visible, float alpha_u, float alpha_v) {
    Resolved<RoughConductor> p = white<RoughConductor>();
    p.distribution = m;
    p.sample_visible = visible;
    p.alpha_u = alpha_u;
    p.alpha_v = alpha_v;
    p.eta = {0.2f, 0.92f, 1.1f};
    p.k = {3.9f, 2.45f, 2.14f};
    return bsdf_of(p);
}
inline Bsdf rough_dielectric(Microfacets m, bool visible, float alpha_u, float alpha_v, float ior = 1.5f) {
    Resolved<RoughDielectric> p = white<RoughDielectric>();
    p.distribution = m;
    p.sample_visible = visible;
    p.alpha_u = alpha_u;
    p.alpha_v = alpha_v;
    p.ior = ior;
    return bsdf_of(p);
}
inline Bsdf rough_plastic(Microfacets m, bool visible, float alpha, float ior = 1.5f) {
    Resolved<RoughPlastic> p = white<RoughPlastic>();
    p.distribution = m;
    p.sample_visible = visible;
    p.alpha = alpha;
    p.ior = ior;
    p.reflectance = {0.8f, 0.5f, 0.1f};
    p.fdr_internal = rough_internal_reflectance(m, alpha, ior);
    p.specular_sampling_weight = 0.6f;
    return bsdf_of(p, cached_table(m, alpha, ior));
}

inline Bsdf plastic(float ior, bool nonlinear, Rgb diffuse) {
    Resolved<Plastic> p = white<Plastic>();
    p.ior = ior;
    p.nonlinear = nonlinear;
    p.reflectance = diffuse;
    p.fdr_internal = fresnel_diffuse_reflectance(ior);
    p.specular_sampling_weight = 0.55f;
    return bsdf_of(p);
}

inline Bsdf phong(float exponent, Rgb diffuse, Rgb specular) {
    Resolved<Phong> p = white<Phong>();
    p.reflectance = diffuse;
    p.specular_reflectance = specular;
    p.exponent = exponent;
    p.specular_sampling_weight = 0.4f;
    return bsdf_of(p);
}
inline Bsdf ward(WardVariant variant, float alpha_u, float alpha_v, Rgb diffuse, Rgb specular) {
    Resolved<Ward> p = white<Ward>();
    p.reflectance = diffuse;
    p.specular_reflectance = specular;
    p.alpha_u = alpha_u;
    p.alpha_v = alpha_v;
    p.variant = variant;
    p.specular_sampling_weight = 0.4f;
    return bsdf_of(p);
}
/// Without coating and sheen.
inline Bsdf principled(float roughness, float metallic, float anisotropic = 0) {
    Resolved<Principled> p = white<Principled>();
    p.base_color = {0.8f, 0.5f, 0.1f};
    p.roughness = roughness;
    p.metallic = metallic;
    p.anisotropic = anisotropic;
    p.clearcoat_alpha = 0.1f;
    return bsdf_of(p);
}
inline Bsdf principled_with_all(float roughness, float metallic) {
    return edited<Principled>(principled(roughness, metallic, 0.5f), [](auto& p) {
        p.specular_tint = 0.3f;
        p.sheen = 0.6f;
        p.sheen_tint = 32768;
        p.flatness = 13107;
        p.clearcoat = 0.8f;
        p.clearcoat_alpha = 0.05f;
    });
}

/// `specular`, `through` and roughness set; with a tint, sheen and all else if `all`.
inline Bsdf principled_thin(float roughness, float specular, float through, bool all = false) {
    Resolved<PrincipledThin> p = white<PrincipledThin>();
    p.base_color = {0.8f, 0.5f, 0.1f};
    p.roughness = roughness;
    p.specular = specular;
    p.through = through;
    p.anisotropic = 0;
    if (all) {
        p.anisotropic = 0.5f;
        p.specular_tint = 0.3f;
        p.sheen = 0.6f;
        p.sheen_tint = 32768;
        p.flatness = 13107;
    }
    return bsdf_of(p);
}

/// Every BSDF type over roughness 0.01 to 1, isotropic and not, all distributions and ways to sample them, ior below
/// and above 1.
inline std::vector<BsdfCase> bsdf_cases() {
    std::vector<BsdfCase> cases;
    const auto add = [&](std::string name, Bsdf b) { cases.push_back({std::move(name), b}); };
    add("diffuse", bsdf_of(Resolved<Diffuse>{{{0.9f, 0.5f, 0.0f}}, {}}));
    for (float alpha : {0.2f, 1.0f})
        add("rough_diffuse " + std::to_string(alpha), bsdf_of(Resolved<RoughDiffuse>{{{0.9f, 0.5f, 0.1f}, alpha}, {}}));
    for (float exponent : {0.0f, 5.0f, 200.0f})
        add("phong " + std::to_string(exponent), phong(exponent, {0.5f, 0.3f, 0.0f}, {0.4f, 0.5f, 0.9f}));
    for (WardVariant variant : {WardVariant::ward, WardVariant::duer, WardVariant::balanced})
        for (auto [au, av] : {std::pair{0.1f, 0.1f}, {0.5f, 0.5f}, {0.05f, 0.3f}})
            add("ward " + std::to_string(int(variant)) + " " + std::to_string(au) + " " + std::to_string(av),
                ward(variant, au, av, {0.5f, 0.3f, 0.0f}, {0.4f, 0.5f, 0.9f}));
    add("diffuse_transmitter", bsdf_of(Resolved<DiffuseTransmitter>{{{0.9f, 0.5f, 0.0f}}, {}}));
    for (float metallic : {0.0f, 0.4f, 1.0f})
        for (float roughness : {0.15f, 0.5f, 1.0f}) {
            const std::string suffix = std::to_string(metallic) + " " + std::to_string(roughness);
            add("principled " + suffix, principled(roughness, metallic));
            add("principled with all " + suffix, principled_with_all(roughness, metallic));
        }
    for (float roughness : {0.2f, 0.7f})
        for (auto [specular, through] : {std::pair{1.0f, 0.0f}, {0.0f, 0.4f}, {0.6f, 0.3f}, {0.0f, 1.0f}}) {
            const std::string suffix =
                std::to_string(roughness) + " " + std::to_string(specular) + " " + std::to_string(through);
            add("principled_thin " + suffix, principled_thin(roughness, specular, through));
            add("principled_thin with all " + suffix, principled_thin(roughness, specular, through, true));
        }
    for (float alpha : {0.0f, 0.2f}) {
        const std::string suffix = " " + std::to_string(alpha);
        add("coated diffuse" + suffix,
            coated(bsdf_of(Resolved<Diffuse>{{{0.9f, 0.5f, 0.0f}}, {}}), 1.5f, alpha, {0.1f, 0.0f, 0.5f}));
        add("coated rough conductor" + suffix,
            coated(rough_conductor(Microfacets::ggx, true, 0.3f, 0.3f), 1.3f, alpha, {0, 0, 0}));
    }
    add("conductor", conductor({0.2f, 0.92f, 1.1f}, {3.9f, 2.45f, 2.14f}));
    for (float ior : {1.5f, 0.75f}) {
        const std::string suffix = " ior " + std::to_string(ior);
        add("dielectric" + suffix, smooth_dielectric<Dielectric>(ior));
        add("thin_dielectric" + suffix, smooth_dielectric<ThinDielectric>(ior));
        add("plastic" + suffix, plastic(ior, false, {0.8f, 0.5f, 0.1f}));
        add("plastic nonlinear" + suffix, plastic(ior, true, {0.8f, 0.5f, 0.1f}));
    }
    for (const auto& [m, visible] : sampled_microfacets()) {
        const std::string suffix = std::string(" ") + kMicrofacetNames[uint32_t(m)] + (visible ? " visible" : " all");
        for (auto [au, av] :
             {std::pair{0.01f, 0.01f}, {0.1f, 0.1f}, {0.5f, 0.5f}, {1.0f, 1.0f}, {0.05f, 0.4f}, {0.6f, 0.1f}}) {
            char alpha[32];
            std::snprintf(alpha, sizeof alpha, " %g,%g", double(au), double(av));
            add("rough_conductor" + suffix + alpha, rough_conductor(m, visible, au, av));
            for (float ior : {1.5f, 0.75f})
                add("rough_dielectric" + suffix + alpha + " ior " + std::to_string(ior),
                    rough_dielectric(m, visible, au, av, ior));
        }
        for (float alpha : {0.02f, 0.3f, 1.0f}) {
            add("rough_plastic" + suffix + " " + std::to_string(alpha),
                edited<RoughPlastic>(rough_plastic(m, visible, alpha),
                                     [alpha](auto& p) { p.nonlinear = alpha == 0.3f; }));
        }
    }
    return cases;
}

/// Unit direction of cosine `mu` at an azimuth along no axis.
inline Vec3f direction(float mu, float phi = 0.7f) {
    const float s = safe_sqrt((1 - mu) * (1 + mu));
    return {s * std::cos(phi), s * std::sin(phi), mu};
}

/// Cosines of incidence, the inside too where the BSDF has one.
inline std::vector<float> incident_cosines(const Bsdf& b, std::vector<float> cosines) {
    if (is_transmissive(b))
        for (size_t i = 0, n = cosines.size(); i < n; ++i) cosines.push_back(-cosines[i]);
    return cosines;
}

/// Four uniform floats, the i-th of a numbered sequence.
inline Vec4f uniform(uint32_t sequence, uint32_t i) { return random_floats({0x5eed, sequence, i, Stream::test}, 0); }
inline Vec3f uniform3(uint32_t sequence, uint32_t i) {
    const Vec4f u = uniform(sequence, i);
    return {u.x, u.y, u.z};
}

}  // namespace ambilux::test
