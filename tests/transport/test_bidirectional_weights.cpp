// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Weights of bidirectional path tracing (transport/mis/bidirectional.h, transport/subpath/) against
// tests/support/bidirectional_oracle.h, over paths that the subpaths themselves find: every BSDF, emitter and sensor,
// every strategy, all masks, both heuristics.
#include "tests/support/bidirectional_paths.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("Recursive weights equal those of all strategies enumerated, and those of a path sum to one") {
    const std::map<std::string, uint64_t> seen = compare_weights(1.0, settings);
    const auto require = [&](const std::string& name) {
        INFO(name);
        const auto it = seen.find(name);
        CHECK((it == seen.end() ? 0 : it->second) >= 100);
    };
    const std::vector<std::string> all = {"hit",        "escape",        "next event",
                                          "connection", "light tracing", "visible light"};
    for (const std::string& kind : all) {
        for (const char* sensor : {"perspective", "thinlens", "orthographic", "spherical"})
            require(kind + ", " + sensor);
        if (kind != "escape")
            for (const char* shape : {"mesh", "sphere", "disk", "cylinder"}) require(kind + ", " + shape);
        if (kind == "visible light") continue;
        for (const char* bsdf :
             {"diffuse", "roughdiffuse", "conductor, delta", "roughconductor", "dielectric, delta",
              "thindielectric, delta", "roughdielectric", "plastic", "plastic, delta", "roughplastic"})
            require(kind + ", " + bsdf);
        if (kind == "hit") continue;
        for (const char* light : {"constant", "envmap"}) require(kind + ", " + light);
        if (kind == "escape") continue;
        const bool samples = kind != "next event";
        for (const char* light : {"point", "spot", "directional"}) require(kind + ", " + light);
        for (const char* beam : {"collimated", "directional_area"})
            if (samples)
                require(kind + ", " + beam);
            else
                CHECK(!seen.contains(kind + ", " + beam));
    }
}

TEST_CASE("The way back over a refraction counts by the solid angles on both sides") {
    for (const bool bumped : {false, true})
        for (const float ior : {1.5f, 0.7f})
            for (const float mu : {0.95f, 0.8f, -0.9f, -0.85f}) {
                Scattering s{};
                s.frame = frame_from_normal(normalize(Vec3f{0.2f, 0.5f, bumped ? 0.7f : -0.4f}));
                s.ng = s.frame.n;
                s.bsdf = bsdf_of(Resolved<Dielectric>{{{1, 1, 1}, {1, 1, 1}}, {ior}});
                float eta = 0;
                const auto refracted = [&](Vec3f wi_local) {
                    s.wi = normalize(wi_local);
                    s.wi_world = s.frame.to_world(s.wi);
                    ScatterSample out;
                    REQUIRE(scatter_sample<kOracleFeatures>(s, {kOneMinusEpsilon, 0.5f, 0.5f}, TransportMode::radiance,
                                                            out));
                    REQUIRE((out.flags & kScatterTransmission));
                    eta = out.eta;
                    return out.wo;
                };
                const Vec3f wi = {0.6f * std::sqrt(1 - mu * mu), 0.8f * std::sqrt(1 - mu * mu), mu};
                // Area of the image of a small square of directions.
                const Frame around = frame_from_normal(wi);
                const float h = 4e-3f;
                const Vec3f a = refracted(wi + around.s * h) - refracted(wi - around.s * h),
                            b = refracted(wi + around.t * h) - refracted(wi - around.t * h);
                const Vec3f wo = refracted(wi);
                const double spread = double(length(cross(a, b))) / (4.0 * h * h);  // dwo / dwi
                CHECK(double(delta_reverse_pdf(s, wo, eta)) == Approx(spread).epsilon(1e-3));
            }
}
