// libs: ambilux_integrators ambilux_core
// Which light strategies cannot find, whatever the samples: from types of emitters and BSDFs and from the depth alone.
#include "integrators/reachability.h"
#include "integrators/settings.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("what strategies cannot reach follows from emitters, BSDFs and depth") {
    constexpr uint32_t kPath = kHitStrategies | kNextEventStrategies, kPlain = kPath | kLightStrategies;
    const auto lost = [](Features f, uint32_t strategies, int max_depth = -1) {
        return unreachable_path(f, strategies, kAllStrategies, max_depth);
    };
    // Every pair of an emitter and a BSDF beside diffuse surfaces.
    EmitterModels::for_each([&](auto emitter) {
        using E = typename decltype(emitter)::type;
        BsdfModels::for_each([&](auto bsdf) {
            using B = typename decltype(bsdf)::type;
            const Features f = {
                bit(BsdfType::diffuse) | bit(kBsdfType<B>), bit(kEmitterType<E>), 1, false, false, false};
            if (is_beam(kEmitterType<E>)) {
                // Light subpaths alone begin there.
                CHECK(lost(f, kPath) == "Lb D E");
                CHECK(lost(f, kPath, 1).empty());
                CHECK(lost(f, kPlain) == (B::delta ? "Lb D D S E" : ""));
                CHECK(lost(f, kLightStrategies) == (B::delta ? "Lb D D S E" : ""));
                CHECK(lost(f, kConnectionStrategies) == "Lb D E");
                CHECK(unreachable_path(f, kAllStrategies, -1) == (B::delta ? "Lb S E" : ""));
                return;
            }
            const bool chain = is_delta(kEmitterType<E>) && B::delta;
            INFO(name_of(kEmitterType<E>) << ", " << name_of(kBsdfType<B>));
            CHECK(lost(f, kPath) == (chain ? "Ld S D E" : ""));
            CHECK(lost(f, kPath, 2).empty());
            CHECK(lost(f, kPlain) == (chain ? "Ld S D D S E" : ""));
            CHECK(lost(f, kPlain, 4).empty());
            CHECK(lost(f, kAllStrategies).empty());
            CHECK(unreachable_path(f, kAllStrategies, -1) == (chain ? "Ld S E" : ""));
            CHECK(unreachable_path(f, kAllStrategies, 1).empty());
            CHECK(lost(f, kHitStrategies) == (is_delta(kEmitterType<E>) ? "Ld D E" : ""));
            CHECK(lost(f, kLightStrategies) == (!is_delta(kEmitterType<E>) && B::delta ? "L S E"
                                                : chain                                ? "Ld D S E"
                                                                                       : ""));
        });
    });
    // Mirrors alone: nothing can be connected, and nobody finds the lamp.
    const Features mirrors = {bit(BsdfType::conductor), bit(EmitterType::point), 1, false, false, false};
    CHECK(lost(mirrors, kPath).empty());
    CHECK(unreachable_path(mirrors, kAllStrategies, -1) == "Ld S E");
}

TEST_CASE("what single strategies do not find is said") {
    const auto lost = [](uint32_t bsdfs, uint32_t emitters, const char* strategies, int max_depth) {
        Features f{};
        f.bsdfs = bsdfs;
        f.emitters = emitters;
        RenderSettings s;
        s.integrator = "bdpt";
        s.max_depth = max_depth;
        apply_setting(s, "strategies", strategies);
        const std::string text = missing_light(f, s);
        if (text.empty()) return text;
        CHECK(text.find("these single strategies do not find") != std::string::npos);
        const size_t begin = text.find("such as ") + 8;
        return text.substr(begin, text.find(" (L: ") - begin);
    };
    const uint32_t diffuse = bit(BsdfType::diffuse), glass = bit(BsdfType::dielectric) | diffuse,
                   area = 1u << uint32_t(EmitterType::area), point = 1u << uint32_t(EmitterType::point);
    CHECK(lost(diffuse, area, "s1t2+s2t2", 3) == "L E");  // none for lamps that the camera sees
    CHECK(lost(diffuse, area, "s0t2+s1t2", 3) == "L D D E");
    CHECK(lost(diffuse, area, "s0t2+s1t2+s2t2", 3).empty());
    CHECK(lost(diffuse, area, "s0t2+s1t2+s3t1", 3).empty());
    CHECK(lost(glass, area, "s0t2+s1t2", 2) == "L S E");
    CHECK(lost(glass, area, "s0t2+s0t3", 2).empty());
    CHECK(lost(glass, area, "s0t2+s0t3+s2t2", 3) == "L S D E");
    CHECK(lost(glass, point, "s1t2", 2).empty());  // by way of glass no strategy finds a point: no matter of these
    CHECK(lost(glass, point, "s0t3", 2) == "Ld D E");
}
