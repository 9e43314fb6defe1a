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
               share(third, value, textured) + share("anisotropic", anisotropic, textured);
    };
    return scene_from_text(scene_xml(
        4, room_in_view(16) + ceiling_lamp() +
               "<shape type='sphere'><point name='center' x='0.6' y='0.4' z='0.5'/><float name='radius' "
               "value='0.5'/><bsdf type='principled'>" +
               all("metallic", 0.75) +
               "</bsdf></shape><shape type='rectangle'><transform name='to_world'><scale value='0.6'/><rotate x='1' "
               "angle='70'/><translate x='-0.5' y='0.3' z='0.7'/></transform><bsdf type='principledthin'>" +
               all("spec_trans", 0.5) + "</bsdf></shape>"));
}

}  // namespace

TEST_CASE("all three numbers of the principled BSDFs come from textures, in every variant") {
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
