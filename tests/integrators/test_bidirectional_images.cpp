// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// seconds: 41
// Light tracing and bidirectional path tracing, all strategies together and by themselves, against the path tracer and
// against closed forms (B1-B34).
#include <sstream>

#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"
#include "transport/emitter.h"

using namespace ambilux;

namespace {

constexpr Rgb kAlbedo = {0.8f, 0.5f, 0.2f};

// ---- a furnace: closed body whose inner side reflects `albedo` and radiates kLight ----

Scene furnace(const std::string& shape, int max_depth, Rgb albedo = kAlbedo) {
    const std::string camera =
        "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>" +
        lookat("origin='0.2,-0.1,0.3' target='-0.4,0.3,-0.7' up='0,1,0'") + film(8) + "</sensor>";
    return scene_from_text(scene_xml(max_depth, camera + "<shape type='" + shape +
                                                    "'><boolean name='flip_normals' value='true'/>" + diffuse(albedo) +
                                                    area_light(kLight) + "</shape>"));
}

/// kLight times albedo^first + ... + albedo^(last-1).
Image furnace_image(int first, int last, Rgb albedo = kAlbedo) {
    Rgb sum{};
    for (int c = 0; c < 3; ++c)
        for (int k = first; k < last; ++k) sum[c] += kLight[c] * float(std::pow(double(albedo[c]), k));
    return constant_image(8, 8, sum);
}

}  // namespace

// ---- against the path tracer ----

TEST_CASE("bdpt agrees with the path tracer on the project's scenes", "[bidirectional]") {
    struct Case {
        const char* name;
        uint32_t spp;
        double sees;
    };
    for (auto [name, spp, sees] : first_or_all<Case>(3, {{"textured", 64, 0.05},
                                                         {"materials", 96, 0.08},
                                                         {"lights", 64, 0.08},
                                                         {"glass", 512, 0.2},
                                                         {"furnace", 64, 0.02},
                                                         {"cornell", 64, 0.05}})) {
        INFO(name);
        agree(project_scene(name, 48, 32), {kAll, kPower}, 4 * spp, spp, sees);
    }
}

TEST_CASE("Light tracing agrees with the path tracer where the camera sees no delta", "[bidirectional]") {
    struct Case {
        const char* name;
        uint32_t spp;
        double sees;
    };
    for (auto [name, spp, sees] : {Case{"furnace", 128, 0.05}, {"lights", 128, 0.1}, {"cornell", 128, 0.05}}) {
        INFO(name);
        agree(project_scene(name, 48, 32), {kLightTracer}, 512, spp, sees);
    }
}

// ---- furnaces ----

TEST_CASE("B30: furnaces by every family of strategies, length by length", "[bidirectional]") {
    for (int depth : {1, 2, 3, 5}) {
        INFO("max_depth " << depth);
        const Scene scene = furnace("sphere", depth);
        for (const Method& m : {kAll, kPower, Method{"hits"}, kLightTracer, Method{"hits+light"},
                                Method{"connections+hits", MisHeuristic::power}}) {
            INFO(m.name);
            check_image(scene, method_settings(scene, m, uint64_t(depth)), furnace_image(0, depth));
        }
        // Next event estimation sees no emitter directly, connections have three segments at least.
        if (depth >= 2) check_image(scene, method_settings(scene, {"next_event"}, 3), furnace_image(1, depth));
        if (depth >= 2)
            check_image(scene, method_settings(scene, {"next_event+connections"}, 3), furnace_image(1, depth));
        if (depth >= 3) check_image(scene, method_settings(scene, {"connections"}, 3), furnace_image(2, depth));
    }
    const Scene box = furnace("cube", 4);
    for (const Method& m : {kAll, kPower, Method{"light"}}) {
        INFO("cube, " << m.name);
        check_image(box, method_settings(box, m, 5), furnace_image(0, 4));
    }
}

TEST_CASE("B30: max_depth 0 is black and max_depth 1 shows emitters alone", "[bidirectional]") {
    for (const char* name : {"all", "hits", "next_event", "connections", "light", "-i light"}) {
        INFO(name);
        const Scene scene = furnace("sphere", 0);
        check_black(render_scene(scene, method_settings(scene, {name}, 1), 16));
    }
    for (const char* name : {"next_event", "connections", "next_event+connections"}) {
        const Scene scene = furnace("sphere", 1);
        check_black(render_scene(scene, method_settings(scene, {name}, 1), 16));
    }
}

TEST_CASE("B25: Russian roulette from the first vertex, later and never leave the mean", "[bidirectional]") {
    constexpr Rgb kGrey = {0.6f, 0.5f, 0.3f};
    const Scene scene = furnace("sphere", 12, kGrey);
    for (const char* name : {"all", "light"})
        for (int rr_depth : {0, 2, -1}) {
            INFO(name << ", rr_depth " << rr_depth);
            RenderSettings s = method_settings(scene, {name}, uint64_t(10 + rr_depth));
            s.rr_depth = rr_depth;
            check_image(scene, s, furnace_image(0, 12, kGrey));
        }
}

// ---- direct light of every emitter, by t = 1 alone and by all strategies ----

TEST_CASE("B8, B13, B14, B17: direct light of every emitter on a plane by t = 1 alone and by all strategies",
          "[bidirectional]") {
    struct Case {
        const char* name;
        std::string light;
        Image expected;
    };
    const std::vector<Case> cases = {
        {"sphere", kSphereLight, plane_image(kLight, sphere_irradiance)},
        {"rectangle", lamp(0.6, 0.4, 0.2, 0.1, 1.2),
         plane_image(kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); })},
        {"disk",
         "<shape type='disk'><transform name='to_world'><scale value='0.6'/><rotate x='1' angle='180'/><translate "
         "x='-0.1' y='0.3' z='1.1'/></transform>" +
             diffuse({0, 0, 0}) + area_light(kLight) + "</shape>",
         plane_image(kLight,
                     [](double x, double y) {
                         const double a2 = 0.36, h2 = 1.21, l2 = (x + 0.1) * (x + 0.1) + (y - 0.3) * (y - 0.3),
                                      s = l2 + h2 + a2;
                         return M_PI / 2 * (1 - (l2 + h2 - a2) / std::sqrt(s * s - 4 * a2 * l2));
                     })},
        {"point",
         "<emitter type='point'><point name='position' x='0.4' y='-0.3' z='0.8'/>" + rgb("intensity", kLight) +
             "</emitter>",
         plane_image(kLight,
                     [](double x, double y) {
                         return 0.8 / std::pow((x - 0.4) * (x - 0.4) + (y + 0.3) * (y + 0.3) + 0.64, 1.5);
                     })},
        {"spot",
         "<emitter type='spot'>" + rgb("intensity", kLight) +
             "<float name='cutoff_angle' value='55'/><float name='beam_width' value='10'/>" +
             lookat("origin='0.3,0.2,1.5' target='0.3,0.2,0' up='0,1,0'") + "</emitter>",
         plane_image(kLight,
                     [](double x, double y) {
                         const double d = std::sqrt((x - 0.3) * (x - 0.3) + (y - 0.2) * (y - 0.2) + 2.25),
                                      theta = std::acos(1.5 / d) * 180 / M_PI;
                         return std::clamp((55 - theta) / 45, 0.0, 1.0) * 1.5 / (d * d * d);
                     })},
        {"directional",
         "<emitter type='directional'><vector name='direction' x='1' y='-2' z='-2'/>" + rgb("irradiance", kLight) +
             "</emitter>",
         plane_image(kLight, [](double, double) { return 2.0 / 3; })},
        {"constant", "<emitter type='constant'>" + rgb("radiance", kLight) + "</emitter>",
         plane_image(kLight, [](double, double) { return M_PI; })},
        {"sphere and constant", kSphereLight + "<emitter type='constant'>" + rgb("radiance", kLight) + "</emitter>",
         plane_image(kLight, [](double, double) { return M_PI; })},
    };
    for (const Case& c : cases) {
        const Scene scene = plane_under(c.light);
        for (const Method& m : first_or_all<Method>(2, {kLightTracer, kAll, kPower})) {
            INFO(c.name << " " << m.name);
            check_image(scene, method_settings(scene, m, 2), c.expected);
        }
    }
}

TEST_CASE("B8: rays never meet delta emitters", "[bidirectional]") {
    for (const std::string light :
         {"<emitter type='point'><point name='position' x='0.4' y='-0.3' z='0.8'/></emitter>",
          "<emitter type='directional'><vector name='direction' x='1' y='-2' z='-2'/></emitter>",
          "<emitter type='spot'><transform name='to_world'><lookat origin='0,0,1' target='0,0,0' "
          "up='0,1,0'/></transform></emitter>"}) {
        const Scene scene = plane_under(light);
        check_black(render_scene(scene, method_settings(scene, {"hits"}, 1), 32));
    }
}

// ---- cameras and films ----

TEST_CASE("B21: t = 1 through perspective and thin lens cameras", "[bidirectional]") {
    const std::string view =
        "<float name='fov' value='90'/>" + lookat("origin='0,0,1' target='0,0,0' up='0,1,0'") + film(kSize);
    const auto light = [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); };
    const std::string source = lamp(0.6, 0.4, 0.2, 0.1, 1.2);
    // In focus at twice the distance, a pixel sees a disk of radius 0.15 around its point.
    const auto blurred = [&](double x, double y) {
        double sum = 0;
        for (int i = 0; i < 12; ++i)
            for (int j = 0; j < 24; ++j) {
                const double r = 0.15 * std::sqrt((i + 0.5) / 12), phi = (j + 0.5) * M_PI / 12;
                sum += light(x + r * std::cos(phi), y + r * std::sin(phi));
            }
        return sum / 288;
    };
    for (const Method& m : {kLightTracer, kAll}) {
        INFO(m.name);
        const Scene pinhole = plane_under(source, "<sensor type='perspective'>" + view + "</sensor>");
        check_image(pinhole, method_settings(pinhole, m, 1), plane_image(kLight, light));
        const Scene sharp = plane_under(source,
                                        "<sensor type='thinlens'><float name='aperture_radius' value='0.3'/><float "
                                        "name='focus_distance' value='1'/>" +
                                            view + "</sensor>");
        check_image(sharp, method_settings(sharp, m, 2), plane_image(kLight, light));
        const Scene soft = plane_under(source,
                                       "<sensor type='thinlens'><float name='aperture_radius' value='0.3'/><float "
                                       "name='focus_distance' value='2'/>" +
                                           view + "</sensor>");
        check_image(soft, method_settings(soft, m, 3), plane_image(kLight, blurred));
    }
}

TEST_CASE("B15: emitters seen directly, by (1,1) and by hits, one-sided, and hidden", "[bidirectional]") {
    for (const SeenEmitter& c : emitters_seen_from_above(kLight)) {
        const Scene open = scene_from_text(scene_xml(1, orthographic() + c.body));
        Scene hidden = open;
        hidden.integrator.hide_emitters = true;
        for (const Method& m : {kLightTracer, kAll, Method{"hits"}}) {
            INFO(c.body << " " << m.name);
            if (c.visible)
                check_image(open, method_settings(open, m, 1), constant_image(kSize, kSize, kLight));
            else
                check_black(render_scene(open, method_settings(open, m, 1), 4), 1e-6);
            check_black(render_scene(hidden, method_settings(hidden, m, 1), 4), 1e-6);
        }
    }
}

TEST_CASE("B18, B19: every filter keeps a constant wall constant up to the border, by t = 1 alone", "[bidirectional]") {
    // Odd and even sizes; the wall goes on beyond the film, as far as filters reach.
    for (const char* filter : {"box", "tent", "gaussian"})
        for (uint32_t size : {15u, 16u}) {
            INFO(filter << " " << size);
            const Scene scene =
                plane_under("<emitter type='directional'><vector name='direction' x='0' y='0' z='-1'/>" +
                                rgb("irradiance", kLight) + "</emitter>",
                            orthographic(film(size, filter)));
            const Rgb color = kLight * kPlaneAlbedo * float(1 / M_PI);
            for (const Method& m : {kLightTracer, kAll})
                check_image(scene, method_settings(scene, m, size), constant_image(size, size, color));
        }
}

TEST_CASE("B19, B20: a sharp edge through every filter is the same for every strategy", "[bidirectional]") {
    // A lamp's own edge, oblique to the pixels, seen by hits and by (1,1); and the shadow-free edge of a plane by next
    // event estimation and t = 1.
    for (const char* filter : {"box", "tent", "gaussian"}) {
        const std::string turned =
            "<shape type='rectangle'><transform name='to_world'><scale x='0.63' y='0.41'/><rotate z='1' "
            "angle='17'/></transform>";
        const Scene edge =
            scene_from_text(scene_xml(1, orthographic(film(kSize, filter)) + turned + area_light(kLight) + "</shape>"));
        const Scene lit = scene_from_text(scene_xml(
            2, orthographic(film(kSize, filter)) + turned + diffuse(kPlaneAlbedo) +
                   "</shape><emitter type='directional'><vector name='direction' x='0.3' y='0' z='-1'/></emitter>"));
        INFO(filter);
        ZTestOptions pixels;
        pixels.block = 1;
        const Estimate hits = render_path(edge, 2048), next_event = render_path(lit, 2048);
        check_agreement(edge, method_settings(edge, kLightTracer, 1), 1024, hits, 0.03, pixels);
        check_agreement(edge, method_settings(edge, kAll, 2), 1024, hits, 0.03, pixels);
        check_agreement(lit, method_settings(lit, kLightTracer, 3), 1024, next_event, 0.03, pixels);
        check_agreement(lit, method_settings(lit, kAll, 4), 1024, next_event, 0.03, pixels);
    }
}

TEST_CASE("B16: a crop is that part of the whole image", "[bidirectional]") {
    struct Crop {
        uint32_t x, y, width, height;
    };
    const std::string source = lamp(0.6, 0.4, 0.2, 0.1, 1.2);
    const Image whole =
        plane_image(kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); });
    for (auto [x, y, w, h] : {Crop{0, 0, 8, 8}, {5, 3, 9, 6}, {12, 1, 4, 15}}) {
        std::ostringstream crop;
        crop << "<integer name='crop_offset_x' value='" << x << "'/><integer name='crop_offset_y' value='" << y
             << "'/><integer name='crop_width' value='" << w << "'/><integer name='crop_height' value='" << h << "'/>";
        const Scene scene = plane_under(source, orthographic(film(kSize, "box", crop.str())));
        Image part{w, h, {}};
        for (uint32_t py = 0; py < h; ++py)
            for (uint32_t px = 0; px < w; ++px)
                for (uint32_t c = 0; c < 3; ++c) part.rgb.push_back(whole.rgb[((y + py) * kSize + x + px) * 3 + c]);
        for (const Method& m : {kLightTracer, kAll}) {
            INFO("crop " << w << "x" << h << " at " << x << "," << y << ", " << m.name);
            check_image(scene, method_settings(scene, m, 1), part, 1u << 18);
        }
    }
}

TEST_CASE("B16: a crop of one pixel", "[bidirectional]") {
    const std::string crop =
        "<integer name='crop_offset_x' value='2'/><integer name='crop_offset_y' value='1'/><integer name='crop_width' "
        "value='1'/><integer name='crop_height' value='1'/>";
    const Scene scene = plane_under(lamp(0.6, 0.4, 0.2, 0.1, 1.2), orthographic(film(4, "box", crop)));
    const Image whole = image_of(4, 4, kLight * kPlaneAlbedo, [](double x, double y) {
        return rectangle_irradiance(-1 + x / 2, 1 - y / 2, -0.4, 0.8, -0.3, 0.5, 1.2) / M_PI;
    });
    for (const Method& m : {kLightTracer, kAll}) {
        INFO(m.name);
        const FilmMoments f = render_scene(scene, method_settings(scene, m, 1), 1u << 18).film;
        for (size_t c = 0; c < 3; ++c) {
            const double expected = double(whole.rgb[(1 * 4 + 2) * 3 + c]), error = f.standard_error(c);
            INFO(f.mean(c) << " +- " << error << " against " << expected);
            CHECK(std::abs(f.mean(c) - expected) < 4.5 * error);
            CHECK(error < 0.02 * expected);
        }
    }
}
