// libs: ambilux_core ambilux_transport
// timeout: 60
// BSDFs against double precision over grazing and random directions, roughness 1e-4 to 1: Fresnel terms, microfacet
// densities and areas, and that what sampling states of a direction is what evaluation says of it.
#include <cmath>
#include <cstdio>

#include "tests/support/bounds.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::bounds;
using namespace ambilux::test;

namespace {

/// 1, cosines next to it, in the middle, and down to the horizon.
std::vector<float> cosines() {
    std::vector<float> all = {1.0f, kOneMinusEpsilon, 0.999f, 0.7f, 0.3f};
    for (int e = -1; e >= -44; --e) all.push_back(std::pow(10.0f, float(e)));
    return all;
}

/// Reflectance of a dielectric at cosine c > 0 towards relative index eta, in double (Born and Wolf, 1.5.2).
double true_dielectric(double c, double eta) {
    const double cos2_t = 1 - (1 - c) * (1 + c) / (eta * eta);
    if (cos2_t <= 0) return 1;
    const double t = std::sqrt(cos2_t), s = (c - eta * t) / (c + eta * t), p = (eta * c - t) / (eta * c + t);
    return 0.5 * (s * s + p * p);
}

/// Reflectance of a conductor by complex numbers.
double true_conductor(double c, double eta, double k) {
    // cos of the refracted angle times the index, a - ib, whose square is (eta - ik)² - sin².
    const double sin2 = (1 - c) * (1 + c), re = eta * eta - k * k - sin2, im = 2 * eta * k;
    const double m = std::hypot(re, im);
    const double a = re > 0 ? std::sqrt(0.5 * (m + re)) : im > 0 ? im / std::sqrt(2 * (m - re)) : 0;
    const double b2 = m - a * a;
    const double s = ((c - a) * (c - a) + b2) / ((c + a) * (c + a) + b2), t = c > 0 ? sin2 / c : 0;
    if (c == 0) return 1;
    return 0.5 * s * (1 + ((a - t) * (a - t) + b2) / ((a + t) * (a + t) + b2));
}

}  // namespace

TEST_CASE("Fresnel terms are those of a cosine that is off by 8 roundings, within bounds, and lie in [0,1]") {
    Numbers numbers(1);
    Worst dielectric, conductor, refraction;
    std::vector<float> all = cosines();
    for (int i = 0; i < 3000; ++i) all.push_back(numbers.uniform());
    for (const float ior : {1.5f, 1.0001f, 1.33f, 0.75f, 0.4f, 3.0f, 1.0f / 1.5f}) {
        std::vector<float> asked = all;
        // Next to total reflection.
        const float critical = ior < 1 ? std::sqrt(1 - ior * ior) : 0;
        for (float c = critical, k = 0; ior < 1 && k < 20; ++k, c = next_float_up(c)) asked.push_back(c);
        for (float c = critical, k = 0; ior < 1 && k < 20; ++k, c = next_float_down(c)) asked.push_back(c);
        for (const float c : asked)
            for (const float sign : {1.0f, -1.0f}) {
                const FresnelDielectric f = fresnel_dielectric(sign * c, ior);
                REQUIRE((f.reflectance >= 0 && f.reflectance <= 1));
                const double eta = sign > 0 ? double(ior) : 1 / double(ior);
                // The root next to total reflection turns roundings of its square into many more of its own.
                double low = 2, high = -1;
                for (const double by : {-8.0, 0.0, 8.0}) {
                    const double r =
                        true_dielectric(std::min(double(c) * (1 + by * kUnit), 1.0), eta * (1 + by / 2 * kUnit));
                    const double q =
                        true_dielectric(std::min(double(c) * (1 + by * kUnit), 1.0), eta * (1 - by / 2 * kUnit));
                    low = std::min({low, r, q}), high = std::max({high, r, q});
                }
                const double r = f.reflectance;
                dielectric.add(std::max({low - r, r - high, 0.0}), 12 * kUnit);
                if (f.cos_t == 0 || c < 1e-37f) continue;
                const Vec3f wi = direction(sign * c), wo = refract(wi, f);
                refraction.add(std::fabs(norm(Exact3(wo)) - norm(Exact3(wi))),
                               8 * kUnit + 8 * kUnit / std::max(double(eta), 1e-3));
            }
    }
    for (const float eta : {0.05f, 0.2f, 0.92f, 1.0f, 1.5f, 3.0f, 5.0f})
        for (const float k : {0.0f, 1e-4f, 0.5f, 2.4f, 3.9f, 8.0f})
            for (const float c : all) {
                const float r = fresnel_conductor(c, eta, k);
                REQUIRE((r >= 0 && r <= 1));
                if (k == 0 && eta <= 1) continue;  // no conductor: total reflection, as above
                double low = 2, high = -1;
                for (const double by : {-8.0, 0.0, 8.0}) {
                    const double t = true_conductor(std::min(double(c) * (1 + by * kUnit), 1.0),
                                                    double(eta) * (1 + by * kUnit), double(k));
                    low = std::min(low, t), high = std::max(high, t);
                }
                // Below an index of 1 with little absorption next to total reflection, where real and imaginary parts
                // cancel, half of the digits are left.
                conductor.add(std::max({low - double(r), double(r) - high, 0.0}), k >= 0.5f ? 4e-6 : 4e-4);
            }
    std::printf("Fresnel: dielectric %.2f, conductor %.2f, length of refracted directions %.2f of the bounds\n",
                dielectric.share, conductor.share, refraction.share);
    CHECK(dielectric.share <= 1);
    CHECK(conductor.share <= 1);
    CHECK(refraction.share <= 1);
}

namespace {

/// D in double.
double true_d(const MicrofacetDistribution& m, Vec3f n, double& exponent) {
    const double x = n.x / double(m.alpha_u), y = n.y / double(m.alpha_v), z2 = double(n.z) * n.z, r2 = x * x + y * y;
    const double scale = 1 / (M_PI * double(m.alpha_u) * double(m.alpha_v));
    exponent = 0;
    if (m.type == Microfacets::ggx) return scale / ((r2 + z2) * (r2 + z2));
    exponent = r2 / z2;
    return scale * std::exp(-exponent) / (z2 * z2);
}

double true_sigma(const MicrofacetDistribution& m, Vec3f v) {
    const double t = std::hypot(double(v.x) * double(m.alpha_u), double(v.y) * double(m.alpha_v)), z = v.z;
    if (m.type == Microfacets::ggx) return 0.5 * (z + std::hypot(z, t));
    if (t == 0) return z;
    return 0.5 * (z * (1 + std::erf(z / t)) + t * std::exp(-(z / t) * (z / t)) / std::sqrt(M_PI));
}

/// Directions above the horizon: grazing ones at any azimuth, next to the normal, and anywhere.
std::vector<Vec3f> upper_directions(uint32_t seed, int count) {
    std::vector<Vec3f> all;
    for (const float c : cosines())
        for (const float phi : {0.0f, 0.3f, kPiOver2, 3.0f}) all.push_back(direction(c, phi));
    Numbers numbers(seed);
    for (int i = 0; i < count; ++i) {
        Vec3f v = numbers.unit();
        if (i % 3 == 0) v = unit_of({v.x * numbers.magnitude(-6, 0), v.y * numbers.magnitude(-6, 0), 1});
        v.z = fabsf(v.z);
        if (v.z > 0) all.push_back(v);
    }
    return all;
}

}  // namespace

TEST_CASE("Microfacet densities and projected areas are right to 14 roundings, Beckmann's to its exponent times 6") {
    const std::vector<Vec3f> directions = upper_directions(2, 3000);
    for (const Microfacets type : {Microfacets::beckmann, Microfacets::ggx}) {
        Worst density, area;
        for (const auto& [u, v] :
             {std::pair{1e-4f, 1e-4f}, {1e-4f, 1.0f}, {1e-3f, 1e-3f}, {0.01f, 0.1f}, {0.3f, 0.3f}, {1.0f, 1.0f}}) {
            const MicrofacetDistribution m = MicrofacetDistribution::of(type, u, v);
            for (const Vec3f n : directions) {
                double exponent;
                const double d = true_d(m, n, exponent);
                // Beyond the range of floats the density is 0.
                if (d > 1e-30 && n.z > 1e-15f)
                    density.add(std::fabs(m.d(n) - d) / d, (14 + 6 * exponent) * kUnit);
                else
                    REQUIRE((m.d(n) >= 0 && m.d(n) < kInfinity));
                const double s = true_sigma(m, n);
                if (s > 1e-15) area.add(std::fabs(m.sigma(n) - s) / s, 14 * kUnit);
            }
        }
        std::printf("microfacets %d: density %.2f, area %.2f of the bounds\n", int(type), density.share, area.share);
        CHECK(density.share <= 1);
        CHECK(area.share <= 1);
    }
}

namespace {

/// All BSDFs, and those of the least roughness and of one axis.
std::vector<BsdfCase> all_cases() {
    std::vector<BsdfCase> cases = bsdf_cases();
    for (const auto& [m, visible] : sampled_microfacets())
        for (const auto& [u, v] : {std::pair{1e-4f, 1e-4f}, {1e-3f, 1e-3f}, {1e-4f, 1.0f}}) {
            cases.push_back({"rough conductor", rough_conductor(m, visible, u, v)});
            for (const float ior : {1.5f, 0.75f, 1.01f})
                cases.push_back({"rough dielectric", rough_dielectric(m, visible, u, v, ior)});
            cases.push_back({"rough plastic", rough_plastic(m, visible, u)});
        }
    return cases;
}

}  // namespace

TEST_CASE(
    "B24: a sampled direction has the density, the way back and the weight that evaluation gives it, bit for bit") {
    Numbers numbers(3);
    const std::vector<float> corners = corner_numbers();
    int sampled = 0, different = 0, invalid = 0, below = 0;
    std::string where;
    for (const BsdfCase& c : all_cases())
        for (const float mu : incident_cosines(c.bsdf, cosines()))
            for (const TransportMode mode : {TransportMode::radiance, TransportMode::importance})
                for (int i = 0; i < 12; ++i) {
                    const auto number = [&] {
                        return i % 2 ? numbers.uniform() : corners[numbers.index(uint32_t(corners.size()))];
                    };
                    const Vec3f wi = direction(mu, 7 * numbers.uniform());
                    BsdfSample s;
                    if (!bsdf_sample<kAllFeatures>(c.bsdf, wi, {number(), number(), number()}, mode, s)) continue;
                    ++sampled;
                    const bool ok = is_finite(s.wo) && std::fabs(norm(Exact3(s.wo)) - 1) <= 16 * kUnit &&
                                    is_finite(s.weight) && min_component(s.weight) >= 0 && s.pdf_sa > 0 &&
                                    s.pdf_sa < kInfinity && s.pdf_reverse_sa >= 0;
                    if (!ok) ++invalid, where = c.name;
                    if (s.flags & kScatterDelta) continue;
                    const BsdfValue v = bsdf_evaluate<kAllFeatures>(c.bsdf, wi, s.wo, mode);
                    if (v.pdf_sa != s.pdf_sa || v.pdf_reverse_sa != s.pdf_reverse_sa) ++different, where = c.name;
                    for (int k = 0; k < 3; ++k) {
                        const double value = v.value[k], product = double(s.weight[k]) * s.pdf_sa;
                        if (std::fabs(value - product) > 4 * kUnit * value + 0x1p-145 * double(s.pdf_sa))
                            ++different, where = c.name;
                    }
                    below += s.wo.z == 0;
                }
    INFO(where << ", " << sampled << " samples");
    std::printf("%d samples\n", sampled);
    CHECK(sampled > 50000);
    CHECK(invalid == 0);
    CHECK(different == 0);
    CHECK(below == 0);
}

TEST_CASE("B4: no BSDF gives a negative value, an infinite one or none, for cosines of 0 and from 1e-30 to 1") {
    Numbers numbers(4);
    int invalid = 0;
    std::string where;
    for (const BsdfCase& c : all_cases())
        for (int i = 0; i < 3000; ++i) {
            const Vec3f wi = numbers.unit(-30);
            // Anywhere, the mirror direction, its neighbours, opposite, and those of grazing facets.
            Vec3f wo = numbers.unit(-30);
            if (i % 5 == 1) wo = reflect(wi);
            if (i % 5 == 2) wo = unit_of(reflect(wi) + wo * numbers.magnitude(-8, -2));
            if (i % 5 == 3) wo = unit_of(-wi + wo * numbers.magnitude(-8, -2));
            const BsdfValue v = bsdf_evaluate<kAllFeatures>(
                c.bsdf, wi, wo, i % 2 ? TransportMode::radiance : TransportMode::importance);
            const bool ok = is_finite(v.value) && min_component(v.value) >= 0 && v.pdf_sa >= 0 &&
                            v.pdf_sa < kInfinity && v.pdf_reverse_sa >= 0 && v.pdf_reverse_sa < kInfinity;
            if (ok) continue;
            if (!invalid++) {
                std::printf("%s: wi %a %a %a wo %a %a %a: %g %g %g\n", c.name.c_str(), double(wi.x), double(wi.y),
                            double(wi.z), double(wo.x), double(wo.y), double(wo.z), double(v.value.x), double(v.pdf_sa),
                            double(v.pdf_reverse_sa));
                where = c.name;
            }
        }
    INFO(where);
    CHECK(invalid == 0);
}

TEST_CASE("Densities of narrow lobes are right to 40 roundings and what 3 of the half vector are of the roughness") {
    Numbers numbers(5);
    for (const Microfacets type : {Microfacets::beckmann, Microfacets::ggx})
        for (const float alpha : {1e-4f, 1e-3f, 0.01f, 0.1f, 1.0f}) {
            const Bsdf bsdf = rough_conductor(type, true, alpha, alpha);
            const MicrofacetDistribution m = MicrofacetDistribution::of(type, alpha, alpha);
            Worst worst;
            for (int i = 0; i < 20000; ++i) {
                const Vec3f wi =
                    direction(numbers.chance(0.3f) ? numbers.magnitude(-3, -1) : 0.05f + 0.95f * numbers.uniform(),
                              7 * numbers.uniform());
                BsdfSample s;
                if (!bsdf_sample<kAllFeatures>(bsdf, wi, {0.5f, numbers.uniform(), numbers.uniform()},
                                               TransportMode::radiance, s))
                    continue;
                // The half vector in double, and what the densities of visible normals are at it.
                const double h[3] = {double(wi.x) + s.wo.x, double(wi.y) + s.wo.y, double(wi.z) + s.wo.z};
                const double l = std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
                const double x = h[0] / l / double(m.alpha_u), y = h[1] / l / double(m.alpha_v),
                             z2 = h[2] / l * h[2] / l, r2 = x * x + y * y;
                const double norm_d = 1 / (M_PI * double(m.alpha_u) * double(m.alpha_v));
                const double d = type == Microfacets::ggx ? norm_d / ((r2 + z2) * (r2 + z2))
                                                          : norm_d * std::exp(-r2 / z2) / (z2 * z2);
                const double pdf = d / (4 * true_sigma(m, wi));
                if (!(pdf > 1e-25)) continue;
                // Of r², which is the exponent or the base: 2 sqrt(r²) slopes over alpha; components of m near 0.
                const double slope = std::sqrt(r2) / double(alpha);
                const double steep = type == Microfacets::ggx ? 4 * slope / (r2 + z2) : 2 * slope / z2 + r2 / z2 * 6;
                worst.add(std::fabs(s.pdf_sa - pdf) / pdf, (40 + 6 * steep + 8 / std::sqrt(z2)) * kUnit);
            }
            std::printf("lobe %d of %g: %.2f of the bound\n", int(type), double(alpha), worst.share);
            CHECK(worst.share <= 1);
        }
}
