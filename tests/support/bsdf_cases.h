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

inline bool is_transmissive(const Bsdf& b) {
    return b.type == BsdfType::dielectric || b.type == BsdfType::thin_dielectric ||
           b.type == BsdfType::rough_dielectric;
}

/// Transmittance table that lives as long as the test.
inline const float* cached_table(Microfacets m, float alpha, float ior) {
    static std::map<std::tuple<int, float, float>, std::array<float, kTransmittanceTableSize>> tables;
    auto [it, fresh] = tables.try_emplace({int(m), alpha, ior});
    if (fresh) rough_transmittance_table(m, alpha, ior, it->second.data());
    return it->second.data();
}

inline Bsdf make_bsdf(BsdfType type) {
    Bsdf b = {};
    b.type = type;
    b.microfacets = Microfacets::ggx;
    b.sample_visible = true;
    b.specular_reflectance = b.transmittance_or_k = b.reflectance_or_eta = {1, 1, 1};
    b.ior = 1.5f;
    return b;
}

inline Bsdf rough(BsdfType type, Microfacets m, bool visible, float alpha_u, float alpha_v, float ior = 1.5f) {
    Bsdf b = make_bsdf(type);
    b.microfacets = m;
    b.sample_visible = visible;
    b.alpha_u = alpha_u;
    b.alpha_v = alpha_v;
    b.ior = ior;
    if (type == BsdfType::rough_conductor) {
        b.reflectance_or_eta = {0.2f, 0.92f, 1.1f};
        b.transmittance_or_k = {3.9f, 2.45f, 2.14f};
    }
    if (type == BsdfType::rough_plastic) {
        b.reflectance_or_eta = {0.8f, 0.5f, 0.1f};
        b.fdr_internal = rough_internal_reflectance(m, alpha_u, ior);
        b.specular_sampling_weight = 0.6f;
        b.transmittance_table = cached_table(m, alpha_u, ior);
    }
    return b;
}

inline Bsdf plastic(float ior, bool nonlinear, Rgb diffuse) {
    Bsdf b = make_bsdf(BsdfType::plastic);
    b.ior = ior;
    b.nonlinear = nonlinear;
    b.reflectance_or_eta = diffuse;
    b.fdr_internal = fresnel_diffuse_reflectance(ior);
    b.specular_sampling_weight = 0.55f;
    return b;
}

/// Every BSDF type over roughness 0.01 to 1, isotropic and not, both distributions and both ways to sample them, ior
/// below and above 1.
inline std::vector<BsdfCase> bsdf_cases() {
    std::vector<BsdfCase> cases;
    const auto add = [&](std::string name, Bsdf b) { cases.push_back({std::move(name), b}); };
    Bsdf b = make_bsdf(BsdfType::diffuse);
    b.reflectance_or_eta = {0.9f, 0.5f, 0.0f};
    add("diffuse", b);
    for (float alpha : {0.2f, 1.0f}) {
        b = make_bsdf(BsdfType::rough_diffuse);
        b.reflectance_or_eta = {0.9f, 0.5f, 0.1f};
        b.alpha_u = alpha;
        add("rough_diffuse " + std::to_string(alpha), b);
    }
    b = make_bsdf(BsdfType::conductor);
    b.reflectance_or_eta = {0.2f, 0.92f, 1.1f};
    b.transmittance_or_k = {3.9f, 2.45f, 2.14f};
    add("conductor", b);
    for (float ior : {1.5f, 0.75f}) {
        for (BsdfType t : {BsdfType::dielectric, BsdfType::thin_dielectric}) {
            b = make_bsdf(t);
            b.ior = ior;
            add(std::string(t == BsdfType::dielectric ? "dielectric" : "thin_dielectric") + " ior " +
                    std::to_string(ior),
                b);
        }
        add("plastic ior " + std::to_string(ior), plastic(ior, false, {0.8f, 0.5f, 0.1f}));
        add("plastic nonlinear ior " + std::to_string(ior), plastic(ior, true, {0.8f, 0.5f, 0.1f}));
    }
    for (Microfacets m : {Microfacets::beckmann, Microfacets::ggx})
        for (bool visible : {true, false}) {
            const std::string suffix =
                std::string(m == Microfacets::ggx ? " ggx" : " beckmann") + (visible ? " visible" : " all");
            for (auto [au, av] :
                 {std::pair{0.01f, 0.01f}, {0.1f, 0.1f}, {0.5f, 0.5f}, {1.0f, 1.0f}, {0.05f, 0.4f}, {0.6f, 0.1f}}) {
                char alpha[32];
                std::snprintf(alpha, sizeof alpha, " %g,%g", double(au), double(av));
                add("rough_conductor" + suffix + alpha, rough(BsdfType::rough_conductor, m, visible, au, av));
                for (float ior : {1.5f, 0.75f})
                    add("rough_dielectric" + suffix + alpha + " ior " + std::to_string(ior),
                        rough(BsdfType::rough_dielectric, m, visible, au, av, ior));
            }
            for (float alpha : {0.02f, 0.3f, 1.0f}) {
                Bsdf p = rough(BsdfType::rough_plastic, m, visible, alpha, alpha);
                p.nonlinear = alpha == 0.3f;
                add("rough_plastic" + suffix + " " + std::to_string(alpha), p);
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
