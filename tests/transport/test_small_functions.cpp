// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// Small functions of transport/ whose errors whole images hide: approximations against their definition, seeds, starts.
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <random>
#include <set>

#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/bsdf.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/rules.h"
#include "transport/subpath/start.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("the inverse error function is right over both of its ranges") {
    for (int i = -2000; i <= 2000; ++i) {
        // Evenly spaced, and crowded towards 1.
        const float even = float(i) / 2001.0f,
                    x = i % 2 ? even : std::copysign(1 - std::exp2(-23.0f * std::fabs(even)), even);
        const double truth = boost::math::erf_inv(double(x));
        INFO(x);
        // 7e-7 is what Giles states for the centre, 3e-6 what rounding of 1 - x² leaves in the tail.
        CHECK(double(inverse_erf(x)) == Approx(truth).epsilon(3e-6).margin(1e-9));
    }
}

TEST_CASE("rough diffuse is the qualitative model of Oren and Nayar with interreflection") {
    // Oren and Nayar 1994, equations 30 and 31, in double precision and in angles.
    const auto oren_nayar = [](double albedo, double sigma, Vec3f wi, Vec3f wo) {
        const double ti = std::acos(double(wi.z)), to = std::acos(double(wo.z)), s2 = sigma * sigma, pi = M_PI;
        const double a = std::max(ti, to), b = std::min(ti, to),
                     cos_phi =
                         std::cos(std::atan2(double(wi.y), double(wi.x)) - std::atan2(double(wo.y), double(wo.x)));
        const double c1 = 1 - 0.5 * s2 / (s2 + 0.33),
                     c2 = 0.45 * s2 / (s2 + 0.09) * (std::sin(a) - (cos_phi >= 0 ? 0.0 : std::pow(2 * b / pi, 3))),
                     c3 = 0.125 * s2 / (s2 + 0.09) * std::pow(4 * a * b / (pi * pi), 2);
        const double single = c1 + cos_phi * c2 * std::tan(b) + (1 - std::fabs(cos_phi)) * c3 * std::tan((a + b) / 2);
        const double twice = 0.17 * s2 / (s2 + 0.13) * (1 - cos_phi * std::pow(2 * b / pi, 2));
        return std::max(albedo * single + albedo * albedo * twice, 0.0) / pi * double(wo.z);
    };
    std::mt19937 rng(3);
    std::uniform_real_distribution<float> u;
    for (const float alpha : {0.1f, 0.4f, 1.0f}) {
        Resolved<RoughDiffuse> parameters{};
        parameters.reflectance = {0.8f, 0.5f, 0.2f};
        parameters.alpha = alpha;
        const Bsdf bsdf = bsdf_of(parameters);
        // Mitsuba's convention: sigma = alpha / sqrt(2), as for a Beckmann distribution of slopes.
        const double sigma = double(alpha) / std::sqrt(2.0);
        for (int i = 0; i < 2000; ++i) {
            const auto direction = [&] {
                const float z = 0.02f + 0.97f * u(rng), phi = 2 * kPi * u(rng), r = std::sqrt(1 - z * z);
                return Vec3f{r * std::cos(phi), r * std::sin(phi), z};
            };
            const Vec3f wi = direction(), wo = direction();
            const BsdfValue f = bsdf_evaluate<kAllFeatures>(bsdf, wi, wo, TransportMode::radiance);
            for (int c = 0; c < 3; ++c) {
                const double truth = oren_nayar(double(parameters.reflectance[c]), sigma, wi, wo);
                INFO("alpha " << alpha << ": " << f.value[c] << " for " << truth);
                REQUIRE(std::fabs(double(f.value[c]) - truth) <= 2e-4 * truth + 1e-5);
            }
        }
    }
}

TEST_CASE("a mirror of a metal scatters with certainty, and changes no index") {
    Resolved<Conductor> parameters{};
    parameters.specular_reflectance = {1, 1, 1};
    BsdfSample s;
    REQUIRE(bsdf_sample<kAllFeatures>(bsdf_of(parameters), normalize(Vec3f{0.3f, 0.4f, 0.5f}), {0.1f, 0.2f, 0.3f},
                                      TransportMode::radiance, s));
    CHECK(s.pdf_sa == 1.0f);
    CHECK(s.eta == 1.0f);
}

TEST_CASE("glass reflects and refracts with the probabilities that it states") {
    Resolved<Dielectric> parameters{};
    parameters.specular_reflectance = parameters.specular_transmittance = {1, 1, 1};
    parameters.ior = 1.5f;
    for (const float z : {0.9f, 0.3f, -0.8f}) {
        const Vec3f wi = {std::sqrt(1 - z * z), 0, z};
        const float r = fresnel_dielectric(z, 1.5f).reflectance;
        constexpr uint32_t kSteps = 1000;
        float reflected = 0;
        for (uint32_t i = 0; i < kSteps; ++i) {
            BsdfSample s;
            REQUIRE(bsdf_sample<kAllFeatures>(bsdf_of(parameters), wi, {(float(i) + 0.5f) / kSteps, 0.5f, 0.5f},
                                              TransportMode::importance, s));
            const bool reflects = !(s.flags & kScatterTransmission);
            reflected += reflects;
            REQUIRE(s.pdf_sa == (reflects ? r : 1 - r));
            REQUIRE(s.weight.x == Approx(1));
        }
        CHECK(std::fabs(reflected - r * kSteps) <= 1);
    }
}

TEST_CASE("light at infinity has exact places") {
    Scene s;
    add_emitter(s, EmitterType::directional, splat(1)).direction = {0, 0, -1};
    complete(s);
    EmitterSample e;
    REQUIRE(sample_emitter_direct<kAllFeatures>(view_of(s), {0.1f, 0.2f, 0.3f}, {0.5f, 0.5f, 0.5f, 0.5f}, e));
    CHECK(e.p_error == Vec3f{0, 0, 0});
    CHECK(e.distance == kInfinity);
}

TEST_CASE("a spot projects its texture over the square around its cutoff circle, both axes alike") {
    // Brightness x + 2y over the image; the middle of texels of a linear ramp is that of the ramp.
    constexpr uint32_t kSide = 64;
    std::vector<Rgb> ramp;
    for (uint32_t y = 0; y < kSide; ++y)
        for (uint32_t x = 0; x < kSide; ++x)
            ramp.push_back(splat((float(x) + 0.5f) / kSide + 2 * (float(y) + 0.5f) / kSide));
    Scene s;
    add_spot(s, {0, 0, 0}, {0, 0, 1}, 40, 39.9f, splat(1));
    const int32_t texture = add_texture(s, kSide, kSide, ramp);
    s.emitters[0].radiance.texture = texture;
    complete(s);
    const float tangent = std::tan(40 * float(M_PI) / 180);
    for (const float x : {-0.6f, -0.1f, 0.0f, 0.4f})
        for (const float y : {-0.5f, 0.0f, 0.3f, 0.6f}) {
            const Vec3f local = normalize(Vec3f{x * tangent, y * tangent, 1});
            const Rgb seen =
                spot_intensity<kAllFeatures>(view_of(s), s.emitters[0], s.emitters[0].to_world.vector(local));
            // Image coordinates (0.5 + x/2, 0.5 + y/2); rows may run up or down.
            const float u = 0.5f + x / 2, v = 0.5f + y / 2;
            INFO(x << "," << y << ": " << seen.x);
            CHECK(std::min(std::fabs(seen.x - (u + 2 * v)), std::fabs(seen.x - (u + 2 * (1 - v)))) < 2e-3f);
        }
}

TEST_CASE("seeds of opacity differ between the rays of a subpath, its shadow rays and other subpaths") {
    std::set<uint32_t> seeds;
    size_t made = 0;
    for (const uint32_t number : {0u, 1u, 2u, 9u}) {
        const RandomNumbers numbers{{7, 11, 3, Stream::light}, number};
        for (uint32_t depth = 1; depth <= 60; ++depth, ++made) seeds.insert(numbers.opacity_seed(depth));
    }
    const RandomNumbers numbers{{7, 11, 3, Stream::light}};
    for (uint32_t depth = 1; depth <= 30; ++depth)
        for (uint32_t light = 0; light <= 30; ++light, ++made)
            seeds.insert(numbers.shadow_seed(connection_ray(depth, light)));
    // 32 bits: one pair among 1170 numbers meets by chance once in 6000 trials.
    CHECK(seeds.size() == made);
}

TEST_CASE("light subpaths start beside the lamp's surface, on the side that it sends light to") {
    Scene s;
    add_area(s, add_rectangle(s, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 5), splat(3));
    complete(s);
    for (uint32_t i = 0; i < 1000; ++i) {
        EmissionSample e{};
        const Vec4f a = random(6, i), b = random(6, i, 1);
        REQUIRE(sample_emission<kAllFeatures>(view_of(s), a, {b.x, b.y}, e));
        const BidirectionalMis mis{MisHeuristic::balance, kAllStrategies, 1.0f, 1.0f};
        const Subpath<BidirectionalMis> path = start_light(mis, e);
        const Vec3f moved = path.origin - e.p;
        REQUIRE(dot(moved, e.ng) > 0);
        REQUIRE(length(moved) < 1e-4f);
        // Radiance per projected density, which is pi for a cosine lobe: the flux of a uniform lamp.
        REQUIRE(path.throughput.x == Approx(3 * M_PI * 4).epsilon(1e-4));
    }
}

TEST_CASE("a subpath has no segment that brings nothing") {
    for (const bool hits : {false, true}) {
        Rules<BidirectionalMis> r{};
        r.mis = {MisHeuristic::balance, kAllStrategies, 1.0f, 1.0f};
        r.max_depth = 5;
        r.count_hits = hits;
        CHECK(r.longest(Side::light) == 4);
        CHECK(r.longest(Side::eye) == (hits ? 5 : 4));
        r.count_environment = true;
        CHECK(r.longest(Side::light) == 4);
        CHECK(r.longest(Side::eye) == 5);
        r.mis.strategies = kAllStrategies & ~kHitStrategies;
        CHECK(r.longest(Side::eye) == (hits ? 5 : 4));
    }
}
