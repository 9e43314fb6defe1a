#include "stress/scenes.h"

#include <fmt/format.h>

#include <cmath>

#include "stress/answers.h"

namespace ambilux::stress {

std::string decade(double value) { return fmt::format("{:.6g}", value); }
std::string whole(double value) { return fmt::format("{:.0f}", value); }

std::string cavity_scene(const Cavity& c) {
    // Parameters of the sphere and not of its transform: quadrics are scaled by the frame alone.
    const std::string wall = shape("sphere", c.frame, "",
                                   "<boolean name=\"flip_normals\" value=\"true\"/>" + diffuse(c.reflectance)),
                      lamp =
                          shape("sphere", c.frame, "", radius(c.lamp_radius) + diffuse(0) + area_emitter(c.radiance));
    const std::string camera = perspective(c.frame, {0.1, 0.2, 0.55}, {0.3, 0.3, 1}, {0, 1, 0}, 50, 1e-3, c.film);
    return scene_xml(c.max_depth, camera + wall + lamp);
}

Answer cavity_answer(const Cavity& c) {
    return {AnswerKind::closed_form, c.radiance * integrating_sphere(c.reflectance, c.lamp_radius, c.max_depth), true,
            "rho L f sum (rho (1-f))^k; f = (r/R)^2; k < depth - 1"};
}

std::string plate_camera(const Plate& p) {
    const double z = 0.5 * p.height, fov = 2 * std::atan(p.seen / z) * 180 / M_PI;
    return perspective(p.frame, {0, 0, z}, {0, 0, 0}, {0, 1, 0}, fov, 1e-2 * z, p.film);
}

std::string plate_floor(const Plate& p) { return rectangle(p.frame, 2, 2, 0, false, diffuse(p.reflectance)); }

std::string plate_scene(const Plate& p, const std::string& floor, const std::string& lamp) {
    return scene_xml(p.max_depth, plate_camera(p) + (floor.empty() ? plate_floor(p) : floor) +
                                      (lamp.empty() ? rectangle(p.frame, p.lamp_half, p.lamp_half, p.height, true,
                                                                diffuse(0) + area_emitter(p.radiance))
                                                    : lamp));
}

Answer plate_answer(const Plate& p) {
    return {AnswerKind::closed_form,
            p.reflectance * p.radiance * mean_rectangle_form_factor(p.seen, p.lamp_half, p.lamp_half, p.height), false,
            "rho L F; F: mean form factor of a parallel rectangle (Howell B-4)"};
}

std::string stone(const Frame& frame, Point at) {
    return shape("sphere", frame, "", center(at) + radius(0.5) + diffuse(0));
}

std::string obj_text(const std::vector<Point>& vertices, const std::vector<unsigned>& faces,
                     const std::vector<Point>& normals) {
    std::string text;
    for (const Point& v : vertices) text += fmt::format("v {:.9g} {:.9g} {:.9g}\n", v.x, v.y, v.z);
    for (const Point& n : normals) text += fmt::format("vn {:.9g} {:.9g} {:.9g}\n", n.x, n.y, n.z);
    const auto corner = [&](unsigned i) {
        return normals.empty() ? fmt::format("{}", i) : fmt::format("{}//{}", i, i);
    };
    for (size_t i = 0; i + 2 < faces.size(); i += 3)
        text += fmt::format("f {} {} {}\n", corner(faces[i]), corner(faces[i + 1]), corner(faces[i + 2]));
    return text;
}

std::string obj_shape(const Frame& frame, const std::string& file, const std::string& elements,
                      const std::string& inside) {
    return shape("obj", frame, elements, "<string name=\"filename\" value=\"" + file + "\"/>" + inside);
}

std::string furnace_scene(const Furnace& f) {
    const std::string walls =
        shape("cube", f.frame, "",
              "<boolean name=\"flip_normals\" value=\"true\"/>" + diffuse(f.reflectance) + area_emitter(f.radiance));
    return scene_xml(f.max_depth, perspective(f.frame, f.origin, f.target, {0, 0, 1}, f.fov, 1e-3, f.film) + walls,
                     f.rr_depth);
}

Answer furnace_answer(const Furnace& f) {
    return {AnswerKind::closed_form, f.radiance * furnace(f.reflectance, f.max_depth), true, "L sum rho^k; k < depth"};
}

}  // namespace ambilux::stress
