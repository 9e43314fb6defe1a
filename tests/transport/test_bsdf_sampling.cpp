// libs: ambilux_core ambilux_transport
// labels: statistical
// timeout: 300
// seconds: 50
// long: tagged
// Sampling of every BSDF follows the density that it states.
#include <array>
#include <cstdio>

#include "tests/support/bsdf_cases.h"
#include "tests/support/catch.h"
#include "tests/support/chi_square.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr int kSamples = 200000;

/// Angular width of the lobes.
double lobe_width(const Bsdf& b) {
    const float alpha = least_alpha(b);
    return alpha == 0 ? 0.3f : std::min(0.3f, 2 * alpha);
}

struct Outcome {
    ChiSquare chi;
    double integral;  ///< of the density
    double accepted;  ///< share of samples from smooth lobes
};

/// Chi-square over cells around mirror direction and refracted direction, plus one cell for what is rejected or taken
/// by delta lobes.
Outcome test_sampling(const Bsdf& b, Vec3f wi, uint32_t sequence) {
    const FresnelDielectric f = fresnel_dielectric(wi.z, ior_of(b));
    const Vec3f refracted = b.type == BsdfType::principled_thin ? -wi
                            : f.cos_t != 0                      ? normalize(refract(wi, f))
                                                                : Vec3f{0, 0, std::copysign(1.0f, -wi.z)};
    const bool through = is_transmissive(b);
    const LobeGrid mirror(reflect(wi), lobe_width(b), 16, 16), behind(refracted, lobe_width(b), 16, 16);
    const int n = mirror.size();
    std::vector<double> observed(2 * n + 1), expected(2 * n + 1);
    int accepted = 0;
    for (int i = 0; i < kSamples; ++i) {
        BsdfSample s;
        if (!bsdf_sample<kAllFeatures>(b, wi, uniform3(sequence, i), TransportMode::radiance, s) ||
            (s.flags & kScatterDelta)) {
            observed[2 * n] += 1;
            continue;
        }
        ++accepted;
        const bool same_side = s.wo.z * wi.z > 0;
        observed[same_side ? mirror.cell(s.wo) : n + behind.cell(s.wo)] += 1;
    }
    double integral = 0;
    for (int side = 0; side < (through ? 2 : 1); ++side) {
        const auto density = [&](Vec3f wo) {
            return (wo.z * wi.z > 0) == (side == 0) ? bsdf_pdf<kAllFeatures>(b, wi, wo, TransportMode::radiance) : 0.0f;
        };
        const std::vector<double> counts =
            (side ? behind : mirror).expected_counts(observed, side * n, kSamples, density);
        std::copy(counts.begin(), counts.end(), expected.begin() + side * n);
        for (double c : counts) integral += c / kSamples;
    }
    expected[2 * n] = std::max(0.0, 1 - integral) * kSamples;
    return {chi_square(observed, expected), integral, double(accepted) / kSamples};
}

/// From inside too: the second cosine of boundaries.
std::array<float, 3> cosines_of(const Bsdf& b) { return {0.97f, is_transmissive(b) ? -0.5f : 0.5f, 0.04f}; }

/// Chi-square of smooth BSDFs, at the angles that `at` takes for case number k.
template <class AnglesOf>
void check_sampling(AnglesOf at) {
    const auto cases = bsdf_cases();
    double tests = 0;
    for (size_t k = 0; k < cases.size(); ++k)
        if (bsdf_is_smooth(cases[k].bsdf)) tests += 2 * double(at(k, cases[k].bsdf).size());
    const double level = sidak_level(0.01, tests);
    double worst_p = 1, worst_mass = 0;
    uint32_t sequence = 100;
    for (size_t k = 0; k < cases.size(); ++k) {
        const auto& c = cases[k];
        if (!bsdf_is_smooth(c.bsdf)) continue;
        for (const float mu : at(k, c.bsdf)) {
            const Outcome o = test_sampling(c.bsdf, direction(mu), sequence++);
            INFO(c.name << " at cosine " << mu << ": chi2 " << o.chi.statistic << " of " << o.chi.degrees << ", p "
                        << o.chi.p_value << ", integral " << o.integral << ", accepted " << o.accepted);
            CHECK(o.chi.p_value > level);
            // The density integrates to the share that is accepted: binomial, plus 1e-4 of quadrature.
            const double sd = std::sqrt(o.accepted * (1 - o.accepted) / kSamples) + 1e-4;
            CHECK(normal_two_sided((o.integral - o.accepted) / sd) > level);
            CHECK(o.integral < 1 + 2e-4);
            worst_p = std::min(worst_p, o.chi.p_value);
            worst_mass = std::max(worst_mass, std::fabs(o.integral - o.accepted));
        }
    }
    std::printf("%.0f tests at level %.2g: smallest p %.2g, largest |integral - accepted| %.2g\n", tests, level,
                worst_p, worst_mass);
}

}  // namespace

TEST_CASE("BSDF sampling matches its density: chi-square over every type and roughness, at one angle of each") {
    check_sampling([](size_t k, const Bsdf& b) { return std::array{cosines_of(b)[k % 3]}; });
}

TEST_CASE("BSDF sampling matches its density: chi-square over every type, roughness and angle", "[long]") {
    check_sampling([](size_t, const Bsdf& b) { return cosines_of(b); });
}

TEST_CASE("Visible Beckmann and GGX normals fill the hemisphere at grazing angles") {
    // Masses to 0.1 %: an approximate masking function (0.35 % off) does not pass.
    for (Microfacets m : {Microfacets::beckmann, Microfacets::ggx})
        for (float mu : {0.9f, 0.3f, 0.01f, 0.0001f}) {
            const MicrofacetDistribution d = {m, 0.4f, 0.7f};
            const Vec3f wi = direction(mu);
            const LobeGrid grid({1, 0, 0}, 1, 24, 24);  // cells end at the horizon
            double mass = 0;
            for (int c = 0; c < grid.size(); ++c)
                mass += grid.integrate(c, [&](Vec3f n) { return d.d(n) * max(dot(wi, n), 0.0f) / d.sigma(wi); });
            INFO(int(m) << " " << mu << " mass " << mass);
            CHECK(std::fabs(mass - 1) < 3e-4);
        }
}

TEST_CASE("Delta BSDFs choose lobes with the probability they state") {
    uint32_t sequence = 5000;
    for (const auto& c : bsdf_cases()) {
        if (bsdf_is_smooth(c.bsdf) && c.bsdf.type != BsdfType::plastic) continue;
        for (float mu : incident_cosines(c.bsdf, {1.0f, 0.5f, 0.04f})) {
            std::map<uint32_t, std::pair<int, float>> lobes;  // flags: count, stated probability
            int refused = 0;
            for (int i = 0; i < kSamples; ++i) {
                BsdfSample s;
                if (!bsdf_sample<kAllFeatures>(c.bsdf, direction(mu), uniform3(sequence, i), TransportMode::radiance,
                                               s))
                    ++refused;
                else if (s.flags & kScatterDelta) {
                    lobes[s.flags].first++;
                    lobes[s.flags].second = s.pdf_sa;
                }
            }
            CHECK(refused == 0);
            ++sequence;
            for (auto [flags, lobe] : lobes) {
                const double p = lobe.second, sd = std::sqrt(p * (1 - p) / kSamples) + 1e-6;
                INFO(c.name << " cosine " << mu << " flags " << flags << " stated " << p << " seen "
                            << double(lobe.first) / kSamples);
                CHECK(normal_two_sided((double(lobe.first) / kSamples - p) / sd) > sidak_level(0.01, 100));
            }
        }
    }
}

TEST_CASE("The chi-square test itself rejects a density that is 2 % off") {
    const Bsdf b = rough_conductor(Microfacets::ggx, true, 0.3f, 0.3f);
    const Bsdf wrong = edited<RoughConductor>(b, [](auto& p) { p.alpha_u = p.alpha_v = 0.3f * 1.02f; });
    const Vec3f wi = direction(0.5f);
    const LobeGrid grid(reflect(wi), 0.3, 16, 16);
    std::vector<double> observed(grid.size()), expected(grid.size());
    int n = 0;
    for (int i = 0; i < kSamples; ++i) {
        BsdfSample s;
        if (!bsdf_sample<kAllFeatures>(b, wi, uniform3(9, i), TransportMode::radiance, s)) continue;
        observed[grid.cell(s.wo)] += 1;
        ++n;
    }
    double mass = 0;
    for (int c = 0; c < grid.size(); ++c)
        mass += expected[c] =
            grid.integrate(c, [&](Vec3f wo) { return bsdf_pdf<kAllFeatures>(wrong, wi, wo, TransportMode::radiance); });
    for (double& e : expected) e *= n / mass;
    CHECK(chi_square(observed, expected).p_value < 1e-5);
}
