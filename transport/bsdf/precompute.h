// Host-side integrals that plastics need before rendering: mean Fresnel reflectance and transmittance tables. In
// double.
#pragma once

#include <algorithm>
#include <array>
#include <boost/math/special_functions/legendre.hpp>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/parallel.h"
#include "scene/view.h"

namespace ambilux {
namespace precompute {

constexpr double kPiD = 3.14159265358979323846;

/// Gauss-Legendre nodes and weights on [0,1].
struct Quadrature {
    std::vector<double> node, weight;

    explicit Quadrature(int n) {
        for (const double zero : boost::math::legendre_p_zeros<double>(n)) {  // those that are not negative
            const double slope = boost::math::legendre_p_prime(n, zero);
            const double w = 1 / ((1 - zero * zero) * slope * slope);
            add(0.5 * (1 + zero), w);
            if (zero > 0) add(0.5 * (1 - zero), w);
        }
    }

private:
    void add(double x, double w) {
        node.push_back(x);
        weight.push_back(w);
    }
};

/// Fresnel reflectance of unpolarised light at cos_i > 0 into relative index eta; `cos_t` is 0 on total reflection.
inline double fresnel(double cos_i, double eta, double& cos_t) {
    const double cos2_t = 1 - (1 - cos_i * cos_i) / (eta * eta);
    cos_t = 0;
    if (cos2_t <= 0) return 1;
    cos_t = std::sqrt(cos2_t);
    const double s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t), p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return 0.5 * (s * s + p * p);
}

/// Smith's masking for one direction, cos > 0 (Walter et al. 2007, equations 34 and exact form of 27).
inline double smith_g1(Microfacets type, double alpha, double cosine) {
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    if (sine <= 0) return 1;
    const double a = cosine / (alpha * sine);
    if (type == Microfacets::ggx) return 2 / (1 + std::sqrt(1 + 1 / (a * a)));
    if (type == Microfacets::phong)
        return a >= 1.6 ? 1 : std::min(a * (3.535 + 2.181 * a) / (1 + a * (2.276 + 2.577 * a)), 1.0);  // PhongFacets
    const double lambda = a > 6 ? 0.0 : 0.5 * (std::exp(-a * a) / (a * std::sqrt(kPiD)) - std::erfc(a));
    return 1 / (1 + lambda);
}

/// Squared tangent of a normal sampled in proportion to D·cos.
inline double squared_slope(Microfacets type, double alpha, double u) {
    if (type == Microfacets::phong) return std::expm1(-std::min(alpha * alpha, 1.0) * std::log(u));
    return alpha * alpha * (type == Microfacets::ggx ? (1 - u) / u : -std::log(u));
}

struct Albedo {
    double reflection, transmission;
};

/// Directional albedo of a rough dielectric boundary, single scattering, seen at cosine `mu` from the side where the
/// other side has relative index `eta`. Integral over microfacet normals: slopes are sampled in proportion to D·cos,
/// the azimuth is cut where normals turn away, so that the integrand is smooth.
inline Albedo rough_dielectric_albedo(Microfacets type, double alpha, double eta, double mu, const Quadrature& q) {
    mu = std::max(mu, 1e-6);
    const double sin_i = std::sqrt(std::max(0.0, 1 - mu * mu));
    const double g_i = smith_g1(type, alpha, mu) / mu;
    Albedo sum = {0, 0};
    for (size_t a = 0; a < q.node.size(); ++a) {
        // u = 1-(1-v)^2 concentrates nodes at steep normals, where 1/cos of the normal is integrably singular.
        const double rest = 1 - q.node[a], u1 = rest * rest;
        const double tan2 = squared_slope(type, alpha, u1);
        const double cos_m = 1 / std::sqrt(1 + tan2), sin_m = std::sqrt(tan2) * cos_m;
        const double horizon = sin_i * sin_m > 0 ? -mu * cos_m / (sin_i * sin_m) : -2;
        const double phi_max = horizon <= -1 ? kPiD : std::acos(std::min(horizon, 1.0));
        for (size_t b = 0; b < q.node.size(); ++b) {
            const double cos_phi = std::cos(phi_max * q.node[b]);
            const double i_dot_m = sin_i * sin_m * cos_phi + mu * cos_m;
            if (i_dot_m <= 0) continue;
            double cos_t;
            const double f = fresnel(i_dot_m, eta, cos_t);
            const double weight = q.weight[a] * 2 * rest * q.weight[b] * phi_max / kPiD * g_i * i_dot_m / cos_m;
            const double reflected_z = 2 * i_dot_m * cos_m - mu;
            if (reflected_z > 0) sum.reflection += weight * f * smith_g1(type, alpha, reflected_z);
            const double refracted_z = (i_dot_m / eta - cos_t) * cos_m - mu / eta;
            if (f < 1 && refracted_z < 0) sum.transmission += weight * (1 - f) * smith_g1(type, alpha, -refracted_z);
        }
    }
    return sum;
}

/// 2·∫ f(mu)·mu dmu over [0,1]; `mu_c` is where f has a square-root kink from above, or 0.
template <typename Function>
double cosine_mean(double mu_c, const Quadrature& q, Function f) {
    double sum = 0;
    for (size_t i = 0; i < q.node.size(); ++i) {
        const double t = q.node[i], below = mu_c * t, above = mu_c + (1 - mu_c) * t * t;
        if (mu_c > 0) sum += q.weight[i] * mu_c * below * f(below);
        sum += q.weight[i] * (1 - mu_c) * 2 * t * above * f(above);
    }
    return 2 * sum;
}

/// Cosine of the critical angle inside a medium of index `ior` over the outside, 0 where there is none.
inline double critical_cosine(double ior) { return ior > 1 ? std::sqrt(1 - 1 / (ior * ior)) : 0.0; }

}  // namespace precompute

/// Share of diffuse light arriving from inside that a smooth boundary reflects back inside; `eta` is interior over
/// exterior index (BsdfRecord::ior). Mitsuba's fdr_int = fresnel_diffuse_reflectance(1/eta), by quadrature instead of a
/// fit.
inline float fresnel_diffuse_reflectance(float eta) {
    static const precompute::Quadrature q(64);
    const double ior = eta;
    return float(precompute::cosine_mean(precompute::critical_cosine(ior), q, [&](double mu) {
        double cos_t;
        return precompute::fresnel(std::max(mu, 1e-12), 1 / ior, cos_t);
    }));
}

/// Fills `out` with kTransmittanceTableSize values of the share of light from outside at cosine i/(size-1) that passes
/// a rough boundary (single scattering; Mitsuba's roughplastic external transmittance). `ior` is interior over exterior
/// index.
inline void rough_transmittance_table(Microfacets type, float alpha, float ior, float* out) {
    static const precompute::Quadrature q(80);
    parallel_for(kTransmittanceTableSize, [&](uint32_t i) {
        const double mu = double(i) / (kTransmittanceTableSize - 1);
        const auto albedo = precompute::rough_dielectric_albedo(type, std::max(double(alpha), 1e-4), ior, mu, q);
        out[i] = float(std::min(albedo.transmission, 1.0));  // phong's facets gain light
    });
}

/// As fresnel_diffuse_reflectance for a rough boundary, single scattering (Mitsuba's roughplastic internal
/// reflectance). The mean over angles is Mitsuba's plain sum over the table's cosines, 1.6 % below the integral: the
/// exact value would make rough plastics 2 % brighter than in the renders we compare with.
inline float rough_internal_reflectance(Microfacets type, float alpha, float ior) {
    static const precompute::Quadrature q(64);
    const uint32_t n = kTransmittanceTableSize;
    std::array<double, kTransmittanceTableSize> terms{};
    parallel_for(n - 1, [&](uint32_t before) {
        const uint32_t i = before + 1;
        const double mu = double(i) / (n - 1);
        terms[i] =
            mu * precompute::rough_dielectric_albedo(type, std::max(double(alpha), 1e-4), 1.0 / ior, mu, q).reflection;
    });
    return float(2 * std::accumulate(terms.begin(), terms.end(), 0.0) / n);
}

}  // namespace ambilux
