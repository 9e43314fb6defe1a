// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 120
// Textures of one value give the image of that number: what vertices in queues keep of a BSDF's inputs is all of them.
#include "tests/support/film_difference.h"
#include "tests/support/small_room.h"

using namespace ambilux;

namespace {

/// `value`, as a number or as a texture of it.
std::string share(const char* name, double value, bool textured) {
    const std::string v = std::to_string(value);
    if (!textured) return std::string("<float name='") + name + "' value='" + v + "'/>";
    return std::string("<texture name='") + name + "' type='checkerboard'><rgb name='color0' value='" + v +
           "'/><rgb name='color1' value='" + v + "'/></texture>";
}

/// The room with a principled ball and a principled sheet, whose highlights are `anisotropic`.
Scene room(double anisotropic, bool textured) {
    const auto all = [&](const char* third, double value) {
        return "<rgb name='base_color' value='0.8,0.6,0.3'/>" + share("roughness", 0.4, textured) +
               share(third, value, textured) + share("anisotropic", anisotropic, textured) +
               share("spec_tint", 0.4, textured) + share("sheen", 0.7, textured) + share("sheen_tint", 0.6, textured) +
               share("flatness", 0.3, textured);
    };
    return scene_from_text(scene_xml(
        4, room_in_view(16) + ceiling_lamp() +
               "<shape type='sphere'><point name='center' x='0.6' y='0.4' z='0.5'/><float name='radius' "
               "value='0.5'/><bsdf type='principled'>" +
               all("metallic", 0.5) + share("clearcoat", 0.8, textured) + share("clearcoat_gloss", 0.5, textured) +
               "</bsdf></shape><shape type='rectangle'><transform name='to_world'><scale value='0.6'/><rotate x='1' "
               "angle='70'/><translate x='-0.5' y='0.3' z='0.7'/></transform><bsdf type='principledthin'>" +
               all("spec_trans", 0.5) + share("diff_trans", 0.8, textured) + share("eta", 1.4, textured) +
               "</bsdf></shape>"));
}

/// A square that fills the film, lit from one point, of a BSDF with `slot`: `a` and `b` in turns, or one of them.
Scene square(const std::string& bsdf, const std::string& slot, double a, double b) {
    const auto value = [](double v) { return std::to_string(v); };
    const std::string of = a == b ? "<float name='" + slot + "' value='" + value(a) + "'/>"
                                  : "<texture type='checkerboard' name='" + slot + "'><rgb name='color0' value='" +
                                        value(a) + "'/><rgb name='color1' value='" + value(b) + "'/></texture>";
    return scene_from_text(scene_xml(
        2,
        "<sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,3' target='0,0,0' up='0,1,0'/>"
        "</transform>" +
            square_film(8) +
            "</sensor><emitter type='point'><point name='position' x='3' y='0.5' z='0.5'/><rgb "
            "name='intensity' value='9'/></emitter><shape type='rectangle'><bsdf type='" +
            bsdf.substr(0, bsdf.find(' ')) + "'>" + bsdf.substr(bsdf.find(' ') + 1) + of + "</bsdf></shape>"));
}

}  // namespace

TEST_CASE("all numbers of the principled BSDFs come from textures, in every variant") {
    const Scene numbers = room(0.95, false), textures = room(0.95, true), isotropic = room(0, false);
    for (const auto& [integrator, variant, fuse] : {std::tuple{"path", "wavefront", "all"},
                                                    {"path", "wavefront", "none"},
                                                    {"bdpt", "wavefront", "all"},
                                                    {"bdpt", "wavefront", "none"},
                                                    {"bdpt", "lvc", "all"},
                                                    {"bdpt", "streaming", "all"},
                                                    {"bdpt", "megakernel", "all"}}) {
        INFO(integrator << ' ' << variant << ' ' << fuse);
        RenderSettings s = cpu_settings(numbers, Estimator::mis, 3);
        s.integrator = integrator;
        s.variant = variant;
        if (std::string(fuse) == "none") apply_setting(s, "fuse", fuse);
        const FilmMoments a = render_scene(numbers, s, 8).film;
        CHECK(relative_difference(a, render_scene(textures, s, 8).film) < 1e-4);
        CHECK(relative_difference(a, render_scene(isotropic, s, 8).film) > 2e-3);
    }
}

TEST_CASE("a checkerboard in a slot shows the image of the one value or of the other") {
    const std::string base = "<rgb name='base_color' value='0.8,0.6,0.3'/><float name='roughness' value='0.5'/>",
                      lobes =
                          "<float name='spec_tint' value='0.2'/><float name='sheen' value='0.6'/><float "
                          "name='sheen_tint' value='0.5'/><float name='clearcoat' value='0.7'/>",
                      opaque = "principled " + base,
                      thin = "principledthin " + base +
                             "<float name='spec_trans' "
                             "value='0.5'/>";
    for (const auto& [bsdf, slot, a, b] :
         {std::tuple{opaque, "spec_tint", 0.2, 0.9},
          {opaque, "sheen", 0.1, 0.8},
          {opaque + "<float name='sheen' value='0.5'/>", "sheen_tint", 0.1, 0.9},
          {opaque, "flatness", 0.1, 0.9},
          {opaque, "clearcoat", 0.2, 0.9},
          {opaque + "<float name='clearcoat' value='1'/>", "clearcoat_gloss", 0.2, 0.6},
          {opaque + lobes, "spec_trans", 0.2, 0.6},
          {opaque + lobes + "<float name='spec_trans' value='0.5'/>", "metallic", 0.2, 0.7},
          {thin, "spec_tint", 0.2, 0.9},
          {thin, "sheen", 0.1, 0.8},
          {thin + "<float name='sheen' value='0.5'/>", "sheen_tint", 0.1, 0.9},
          {thin, "flatness", 0.1, 0.9},
          {thin, "diff_trans", 0.2, 1.6},
          {thin, "eta", 1.2, 1.8}}) {
        INFO(bsdf << ' ' << slot);
        const auto render = [&](double first, double second) {
            const Scene s = square(bsdf, slot, first, second);
            return render_scene(s, cpu_settings(s, Estimator::mis, 2), 4).film;
        };
        const FilmMoments low = render(a, a), high = render(b, b), both = render(a, b);
        int different = 0, of_low = 0, of_high = 0;
        for (uint32_t i = 0; i < 64; ++i) {
            const double l = low.mean(3 * i), h = high.mean(3 * i), x = both.mean(3 * i);
            if (!(std::fabs(l - h) > 1e-4 * h)) continue;
            ++different;
            of_low += std::fabs(x - l) < 1e-5 * l;
            of_high += std::fabs(x - h) < 1e-5 * h;
        }
        CHECK(different > 50);
        CHECK(of_low + of_high == different);
        CHECK(std::min(of_low, of_high) > 20);
    }
}
