// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// long: tagged
// seconds: 35
// How many light subpaths there are (light_paths): the image stays what it is, whatever their number, and more of them
// find more.
#include <cmath>

#include "core/error.h"
#include "integrators/bdpt/shared/policy.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

RenderSettings with_light_paths(RenderSettings s, const std::string& light_paths) {
    apply_setting(s, "light_paths", light_paths);
    return s;
}

const Method kLvc = {"all", MisHeuristic::balance, "lvc"}, kLvcPower = {"all", MisHeuristic::power, "lvc"},
             kWithoutConnections = {"hits+next_event+light"};

}  // namespace

TEST_CASE("light subpaths lie evenly in tiles, and every tile has some") {
    for (uint32_t per_tile = 1; per_tile <= kMostLightRounds * kTilePixels; ++per_tile) {
        uint32_t sum = 0, most = 0;
        for (uint32_t slot = kTilePixels; slot < 2 * kTilePixels; ++slot) {
            const uint32_t subpaths = light_subpaths_of(slot, per_tile);
            sum += subpaths;
            most = std::max(most, subpaths);
            const double even = double(slot - kTilePixels + 1) * per_tile / kTilePixels;
            if (std::fabs(double(sum) - even) >= 1.0)
                FAIL("slot " << slot << ", " << per_tile << " per tile: " << sum << " so far");
        }
        WavePolicy policy{};
        policy.light_subpaths_per_tile = per_tile;
        if (sum != per_tile || most != policy.light_rounds() || light_subpaths_of(0, per_tile) < 1)
            FAIL(per_tile << " per tile: " << sum << ", at most " << most);
    }
}

TEST_CASE("light subpaths of a film are counted as they begin, also in the tiles along its edges") {
    for (const auto& [width, height] : {std::pair{64u, 32u}, {1u, 1u}, {9u, 7u}, {61u, 43u}}) {
        const Scene scene = project_scene("cornell", width, height);
        Wave wave = shape_wave(scene, 0, kTilePixels, 1);
        WaveState state{};
        state.samples = 1;
        wave.state = &state;
        wave.tiles = tile_count(wave);
        for (const uint32_t per_tile : {1u, 5u, 16u, 63u, 64u, 65u, 192u, 1024u}) {
            uint32_t subpaths = 0;
            for (uint32_t slot = 0; slot < wave.slot_count(); ++slot)
                subpaths += wave.locate(slot).active ? light_subpaths_of(slot, per_tile) : 0;
            INFO(width << "x" << height << ", " << per_tile << " per tile");
            CHECK(light_subpaths_in(wave, 0, wave.tiles, per_tile) == subpaths);
            CHECK(subpaths >= wave.tiles);
            RenderSettings s = method_settings(scene, kLvc, 1);
            s.light_subpaths_per_tile = per_tile;
            CHECK(plan_bdpt(scene, s).rules.mis.light_subpaths == float(subpaths));
            // A render starts as many, once per sample.
            const RenderResult r = render_scene(scene, s, 2);
            uint32_t stages = 0;
            for (const StageStats& stage : r.stats.stages) {
                if (stage.name != "light_extend") continue;
                ++stages;
                CHECK(stage.items_by_depth[1] == 2 * subpaths);
            }
            CHECK(stages == 1);
        }
    }
}

TEST_CASE("any number of light subpaths gives the image of one for every pixel", "[bidirectional]") {
    // Paired subpaths have less noise than the path tracer, with which they agree (test_bidirectional_images).
    for (const auto& [name, spp] :
         first_or_all<std::pair<const char*, uint32_t>>(1, {{"cornell", 512}, {"lights", 1536}})) {
        const Scene scene = project_scene(name, 45, 27);
        const Estimate paired = render_batches(scene, method_settings(scene, kAll, 1001), spp);
        for (const auto& [light_paths, m] :
             first_or_all<std::pair<const char*, Method>>(2, {{"0.015625", kLvc},
                                                              {"2.5", kWithoutConnections},
                                                              {"0.015625", kWithoutConnections},
                                                              {"0.25", kLvcPower},
                                                              {"2.5", kLvc}})) {
            INFO(name << " " << m.name << " " << m.variant << " light_paths=" << light_paths);
            const uint32_t samples =
                light_paths == std::string("0.015625") ? spp * 3 / 2 : spp;  // fewer light subpaths
            check_agreement(scene, with_light_paths(method_settings(scene, m, 5), light_paths), samples, paired, 0.02);
        }
    }
}

TEST_CASE("any number of light subpaths gives the direct light of a lamp, by t = 1 alone and by all strategies",
          "[bidirectional]") {
    const Image expected =
        plane_image(kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); });
    const Scene scene = plane_under(lamp(0.6, 0.4, 0.2, 0.1, 1.2));
    for (const char* light_paths : {"0.03125", "0.5", "2", "2.25"})
        for (const Method& m : {kLightTracer, kWithoutConnections, kLvc}) {
            INFO(m.name << " " << m.variant << " light_paths=" << light_paths);
            check_image(scene, with_light_paths(method_settings(scene, m, 11), light_paths), expected);
        }
}

namespace {

/// Four times as many light subpaths have a quarter of the variance.
void check_quarter(const char* few, const char* many, uint32_t samples) {
    const Scene scene = project_scene("cornell", 32, 32);
    const auto variance = [&](const char* light_paths, uint64_t seed, uint32_t spp) {
        const FilmMoments film =
            render_scene(scene, with_light_paths(method_settings(scene, kLightTracer, seed), light_paths), spp).film;
        double sum = 0;
        for (size_t i = 0; i < film.sum.size(); ++i) sum += film.variance(i);
        return sum;
    };
    double ratio = 0, square = 0;
    constexpr int kSeeds = 8;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
        const double r = variance(few, seed, samples) / variance(many, seed + 100, samples);
        ratio += r / kSeeds;
        square += r * r / kSeeds;
    }
    const double error = std::sqrt(std::max(0.0, square - ratio * ratio) / (kSeeds - 1));
    INFO(few << " against " << many << ": " << ratio << " +- " << error);
    CHECK(std::fabs(ratio - 4) < 4.5 * error + 0.004);
    CHECK(error < 0.1);
}

}  // namespace

TEST_CASE("light subpaths of one slot differ: four times as many have a quarter of the variance") {
    check_quarter("1", "4", 16);
    check_quarter("0.25", "1", 32);
}

TEST_CASE("light subpaths of one slot differ, sixteen too", "[long]") { check_quarter("4", "16", 32); }

TEST_CASE("rounds of light subpaths use queues again: where items lie and which stages are fused changes no bit") {
    for (const char* name : {"glass", "textured"}) {
        const Scene scene = project_scene(name, 45, 27);
        for (const Method& m : {kLightTracer, kWithoutConnections}) {
            RenderSettings s = with_light_paths(method_settings(scene, m, 7), "2.5");
            s.deterministic = true;
            const FilmMoments first = render_scene(scene, s, 2).film;
            RenderSettings all_features = s;  // which stages of their own hold
            all_features.specialise = false;
            const FilmMoments fused = render_scene(scene, all_features, 2).film;
            for (const auto& [key, value] : {std::pair{"fuse", "none"},
                                             {"compaction", "select"},
                                             {"compaction", "none"},
                                             {"ordering", "material"},
                                             {"ordering", "morton"}}) {
                INFO(name << " " << m.name << " " << key << "=" << value);
                RenderSettings other = s;
                apply_setting(other, key, value);
                CHECK(render_scene(scene, other, 2).film.sum == (other.fuse == Fuse::none ? fused : first).sum);
            }
        }
    }
}

TEST_CASE("images of single strategies add up to the image, whatever the number of light subpaths") {
    const Scene scene = project_scene("cornell", 24, 16);
    for (const char* light_paths : {"0.25", "3"}) {
        RenderSettings s = with_light_paths(method_settings(scene, kLvc, 3), light_paths);
        s.max_depth = s.technique_depth = 5;
        const auto renderer = make_renderer(scene, s);
        renderer->render(0, 16);
        const FilmMoments film = renderer->film();
        std::vector<double> sum(film.sum.size());
        for (const StrategyImage& image : renderer->strategy_images())
            for (size_t i = 0; i < sum.size(); ++i) sum[i] += double(image.weighted[i]);
        for (size_t i = 0; i < sum.size(); ++i)
            if (std::fabs(sum[i] - film.mean(i)) > 1e-4 * film.mean(i) + 1e-6)
                FAIL(light_paths << " value " << i << ": " << sum[i] << " " << film.mean(i));
    }
}

TEST_CASE("numbers of light subpaths that cannot be are refused by name") {
    RenderSettings s;
    for (const char* value : {"0", "-1", "17", "0.3", "x", "1.001", ""}) {
        INFO(value);
        try {
            apply_setting(s, "light_paths", value);
            FAIL("not refused");
        } catch (const Error& error) {
            CHECK(error.code == ExitCode::usage);
            CHECK(std::string(error.what()).find(std::string("light_paths=") + value) == 0);
        }
    }
    const Scene scene = project_scene("cornell", 16, 16);
    for (const char* variant : {"wavefront", "megakernel", "streaming"}) {
        INFO(variant);
        const RenderSettings other =
            with_light_paths(method_settings(scene, {"all", MisHeuristic::balance, variant}, 1), "0.5");
        try {
            make_renderer(scene, other);
            FAIL("not refused");
        } catch (const Error& error) {
            CHECK(error.code == ExitCode::usage);
            const std::string text = error.what();
            CHECK(text.find("light_paths=0.5") != std::string::npos);
            CHECK(text.find(variant) != std::string::npos);
            CHECK(text.find("lvc") != std::string::npos);
        }
    }
}
