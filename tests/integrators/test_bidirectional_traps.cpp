// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Traps that need a scene built for them: roulette that ends most subpaths (B25), caches with few light vertices or
// none (B26, B27), families of strategies cut off by glass (B31), scale and place (B33), seeds of single strategies
// (G7).
#include <cmath>

#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

Method variant(const char* name, MisHeuristic heuristic = MisHeuristic::balance) { return {"all", heuristic, name}; }

double sum_of(const FilmMoments& film) {
    double sum = 0;
    for (const double v : film.sum) sum += v;
    return sum;
}

/// Largest difference of two images' values, relative to the larger of the value and the image's mean.
double difference(const FilmMoments& a, const FilmMoments& b) {
    const double mean = sum_of(b) / double(b.sum.size());
    double worst = 0;
    for (size_t i = 0; i < a.sum.size(); ++i)
        worst = std::max(worst, std::fabs(a.sum[i] - b.sum[i]) / std::max(std::fabs(b.sum[i]), mean));
    return worst;
}

}  // namespace

TEST_CASE("B25: roulette that ends nine of ten subpaths leaves the mean, by every family and every variant",
          "[bidirectional]") {
    // A dark sphere that radiates inwards, dimly: subpaths of either side are left with a tenth at every vertex.
    constexpr Rgb kDark = {0.1f, 0.08f, 0.05f}, kDim = {0.003f, 0.005f, 0.002f};
    Scene scene = scene_from_text(
        scene_xml(5, "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>" +
                         lookat("origin='0.2,-0.1,0.3' target='-0.4,0.3,-0.7' up='0,1,0'") + film(8) +
                         "</sensor><shape type='sphere'><boolean name='flip_normals' value='true'/>" + diffuse(kDark) +
                         area_light(kDim) + "</shape>"));
    const auto light = [&](int first) {
        Rgb sum{};
        for (int c = 0; c < 3; ++c)
            for (int k = first; k < 5; ++k) sum[c] += kDim[c] * float(std::pow(double(kDark[c]), k));
        return constant_image(8, 8, sum);
    };
    for (const int rr_depth : {0, 1}) {
        const auto check = [&](const Method& m, int first) {
            INFO(m.name << " " << m.variant << ", rr_depth " << rr_depth);
            RenderSettings s = method_settings(scene, m, uint64_t(3 + rr_depth));
            s.rr_depth = rr_depth;
            check_image(scene, s, light(first), 1u << 16);
        };
        check({"next_event"}, 1);
        check({"light"}, 0);
        for (const char* name : {"wavefront", "lvc", "streaming", "megakernel"}) check(variant(name), 0);
    }
}

TEST_CASE("B26: one, two or four connections, with a cache of few light vertices", "[bidirectional]") {
    // A lamp that sends nearly all of its light past the floor and the wall: one light subpath in twenty has a vertex.
    const Scene scene = scene_from_text(scene_xml(
        4, orthographic(film(12)) + kPlane +
               "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><translate y='1.5' "
               "z='1'/></transform><bsdf type='twosided'>" +
               diffuse({0.7f, 0.6f, 0.5f}) + "</bsdf></shape>" +
               "<shape type='rectangle'><transform name='to_world'><scale x='0.3' y='0.3'/><rotate y='1' "
               "angle='105'/><translate x='-1.6' z='1.1'/></transform>" +
               diffuse({0, 0, 0}) + area_light({20, 30, 10}) + "</shape>"));
    const Estimate paired = render_batches(scene, method_settings(scene, kAll, 71), 2048);
    for (const auto& [light_paths, connections] : {std::pair{"0.015625", 4u}, {"0.0625", 1u}, {"1", 2u}, {"2", 4u}}) {
        INFO("light_paths " << light_paths << ", connections " << connections);
        RenderSettings s = method_settings(scene, variant("lvc"), 72);
        apply_setting(s, "light_paths", light_paths);
        s.connections = connections;
        check_agreement(scene, s, 2048, paired, 0.05);
    }
}

TEST_CASE("B26, B27: an empty cache, and light subpaths that meet nothing, leave what hits and next event find",
          "[bidirectional]") {
    // The camera looks at the front of a lamp, whose light meets nothing.
    const Scene lonely = scene_from_text(scene_xml(
        6, orthographic() + "<shape type='rectangle'><transform name='to_world'><scale value='1.5'/></transform>" +
               diffuse({0, 0, 0}) + area_light(kLight) + "</shape>"));
    // A floor under a sky without radiance: no light subpath begins at all.
    const Scene dark = plane_under("<emitter type='constant'>" + rgb("radiance", {0, 0, 0}) + "</emitter>");
    for (const char* name : {"wavefront", "lvc", "streaming", "megakernel"})
        for (const MisHeuristic heuristic : {MisHeuristic::balance, MisHeuristic::power}) {
            INFO(name << ", heuristic " << int(heuristic));
            const Method m = variant(name, heuristic);
            const RenderResult seen = render_scene(lonely, method_settings(lonely, m, 1), 64);
            CHECK(seen.stats.invalid.total() == 0);
            check_image(lonely, method_settings(lonely, m, 1), constant_image(kSize, kSize, kLight));
            check_black(render_scene(dark, method_settings(dark, m, 1), 4));
        }
}

TEST_CASE("B31: glass panes that each stop one family of strategies leave the image of the path tracer",
          "[bidirectional]") {
    // Two matte planes at right angles, a lamp, and panes of thin glass: before the lamp (stops next event estimation
    // and hits without a delta), between the planes (stops their connections), before the camera (stops light tracing).
    const auto pane = [](const std::string& transform) {
        return "<shape type='rectangle'><transform name='to_world'>" + transform +
               "</transform><bsdf type='thindielectric'/></shape>";
    };
    const std::string panes[3] = {pane("<scale value='0.9'/><translate x='0.6' y='0.4' z='1.55'/>"),
                                  pane("<scale x='3' y='3'/><rotate x='1' angle='45'/><translate y='1' z='0.6'/>"),
                                  pane("<scale value='2'/><rotate x='1' angle='-50'/><translate y='-1.6' z='1.5'/>")};
    for (const double distance : {0.5, 2.0})
        for (int which = 0; which < 8; ++which) {
            INFO("panes " << which << ", distance " << distance);
            std::string body =
                "<sensor type='perspective'><float name='fov' value='45'/><float name='near_clip' value='1e-3'/>" +
                lookat("origin='0,-2.4,2.2' target='0,0.3,0.3' up='0,0,1'") + film(8) + "</sensor>" + kPlane +
                "<shape type='rectangle'><transform name='to_world'><scale x='1.5'/><rotate x='1' "
                "angle='90'/><translate y='1.5' z='1'/></transform><bsdf type='twosided'>" +
                diffuse({0.7f, 0.6f, 0.5f}) + "</bsdf></shape>" + lamp(0.6, 0.6, 0.6, 0.4, 1.55 + 0.4 * distance);
            for (int k = 0; k < 3; ++k)
                if (which >> k & 1) body += panes[k];
            Scene scene = scene_from_text(scene_xml(6, body));
            scene.integrator.hide_emitters = true;
            agree(scene, {kAll, variant("lvc", MisHeuristic::power)}, 3072, 1536, 0.1);
        }
}

TEST_CASE("B33: a scene that is a thousand times as large or as small, and one far from the origin, is the same image",
          "[bidirectional]") {
    // Powers of two change no bit of the numbers; the size of a light subpath's flux must not matter.
    const auto room = [](double scale, double shift) {
        std::ostringstream t;
        t << "<scale value='" << scale << "'/><translate x='" << shift << "' y='" << -shift << "' z='" << shift
          << "'/>";
        const auto rectangle = [&](const std::string& place, const std::string& what) {
            return "<shape type='rectangle'><transform name='to_world'>" + place + t.str() + "</transform>" + what +
                   "</shape>";
        };
        const std::string white = "<bsdf type='twosided'>" + diffuse({0.6f, 0.5f, 0.4f}) + "</bsdf>";
        std::ostringstream clip;
        clip << 1e-2 * scale;
        return scene_from_text(
            scene_xml(5, "<sensor type='perspective'><float name='fov' value='60'/><float name='near_clip' value='" +
                             clip.str() + "'/><float name='far_clip' value='" + std::to_string(100 * scale) +
                             "'/><transform name='to_world'><lookat origin='0,-2,1.5' target='0,0.3,0.4' up='0,0,1'/>" +
                             "<translate x='0'/>" + "</transform>" + film(16) + "</sensor>" +
                             rectangle("<scale value='2'/>", white) +
                             rectangle("<scale value='2'/><rotate x='1' angle='90'/><translate y='1.5'/>", white) +
                             rectangle("<scale value='0.5'/><rotate x='1' angle='180'/><translate z='2'/>",
                                       diffuse({0, 0, 0}) + area_light(kLight))));
    };
    const auto render = [](Scene scene, double scale, double shift, const Method& m, bool roulette) {
        // The camera moves with the room: its matrix is edited, since a look-at takes no scale.
        Affine& camera = scene.sensor.to_world;
        for (int i = 0; i < 3; ++i) camera.m[i][3] = float(double(camera.m[i][3]) * scale + (i == 1 ? -shift : shift));
        RenderSettings s = method_settings(scene, m, 9);
        s.rr_depth = roulette ? 3 : -1;
        const RenderResult r = render_scene(scene, s, 16);
        CHECK(r.stats.invalid.total() == 0);
        return r.film;
    };
    for (const Method& m : {kAll, kPower, variant("lvc"), variant("megakernel"), Method{"connections"}, kLightTracer}) {
        const FilmMoments benign = render(room(1, 0), 1, 0, m, false);
        for (const double scale : {0x1p-10, 0x1p10}) {
            INFO(m.name << " " << m.variant << ", scale " << scale);
            CHECK(difference(render(room(scale, 0), scale, 0, m, false), benign) < 1e-3);
        }
    }
    // Moved by a hundred times its size a room loses seven bits of its coordinates: rays meet other points, and no
    // more.
    const Scene near = room(1, 0);
    for (const Method& m : {kAll, kLightTracer}) {
        INFO(m.name);
        const double here = sum_of(render(near, 1, 0, m, true)), there = sum_of(render(room(1, 100), 1, 100, m, true));
        CHECK(std::fabs(there - here) < 2e-3 * here);
    }
}

TEST_CASE(
    "G7: another seed is another image of every strategy, and the mean over seeds has the variance of as many "
    "samples",
    "[bidirectional]") {
    const Scene scene = project_scene("cornell", 16, 16);
    constexpr uint32_t kSeeds = 24, kSamples = 16;
    std::vector<std::vector<std::vector<double>>> images;  // seed, strategy, value
    std::vector<Strategy> strategies;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
        RenderSettings s = method_settings(scene, kAll, seed);
        s.max_depth = s.technique_depth = 3;
        const auto renderer = make_renderer(scene, s);
        REQUIRE(renderer->render(0, kSamples) == kSamples);
        images.emplace_back();
        strategies.clear();
        for (const StrategyImage& image : renderer->strategy_images()) {
            images.back().emplace_back(image.weighted.begin(), image.weighted.end());
            strategies.push_back(Strategy::make(image.s, image.t));
        }
    }
    for (size_t k = 0; k < strategies.size(); ++k) {
        INFO("(" << strategies[k].s() << "," << strategies[k].t() << ")");
        // Products of the deviations of neighbouring seeds: uncorrelated, each within its scatter over pixels.
        const size_t n = images[0][k].size();
        std::vector<double> mean(n);
        for (const auto& image : images)
            for (size_t i = 0; i < n; ++i) mean[i] += image[k][i] / kSeeds;
        double product = 0, square = 0;
        std::vector<double> products;
        for (uint32_t seed = 0; seed + 1 < kSeeds; seed += 2) {
            double p = 0;
            for (size_t i = 0; i < n; i += 3) {
                const double u = images[seed][k][i] - mean[i], v = images[seed + 1][k][i] - mean[i];
                p += u * v;
                square += 0.5 * (u * u + v * v);
            }
            products.push_back(p), product += p;
        }
        if (square == 0) continue;  // emitters seen directly have no variance here
        // Deviations from the mean of K seeds are correlated by -1/(K-1) themselves.
        double scatter = 0;
        const double count = double(products.size());
        for (const double p : products) scatter += (p - product / count) * (p - product / count);
        const double error = std::sqrt(scatter / (count - 1) * count);
        INFO("correlation " << product / square << " +- " << error / square);
        CHECK(std::fabs(product / square + 1.0 / (kSeeds - 1)) < 5.5 * error / square + 1e-6);
        CHECK(error / square < 0.2);
    }
}
