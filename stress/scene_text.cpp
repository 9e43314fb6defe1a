#include "stress/scene_text.h"

#include <fmt/format.h>

#include <cmath>

namespace ambilux::stress {
namespace {

std::string film_xml(const Film& film) {
    return fmt::format(
        "<film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/><integer name=\"height\" value=\"{}\"/>"
        "<rfilter type=\"box\"/></film><sampler type=\"independent\"><integer name=\"sample_count\" value=\"64\"/>"
        "</sampler>",
        film.width, film.height);
}

std::string look_at(const Frame& frame, Point o, Point t, Point up) {
    const double s = frame.scale;
    return fmt::format(
        "<lookat origin=\"{:.17g}, {:.17g}, {:.17g}\" target=\"{:.17g}, {:.17g}, {:.17g}\" up=\"{:.17g}, {:.17g}, "
        "{:.17g}\"/>",
        s * o.x, s * o.y, s * o.z, s * t.x, s * t.y, s * t.z, up.x, up.y, up.z);
}

std::string clips(const Frame& frame, double near) {
    return fmt::format("<float name=\"near_clip\" value=\"{:.9g}\"/><float name=\"far_clip\" value=\"{:.9g}\"/>",
                       frame.scale * near, frame.scale * near * 1e5);
}

}  // namespace

std::string Frame::place(const std::string& elements) const {
    const std::string scaled = scale == 1 ? "" : fmt::format("<scale value=\"{:.17g}\"/>", scale);
    return "<transform name=\"to_world\">" + elements + mirror + scaled + rigid + "</transform>";
}

std::string scale_xyz(double x, double y, double z) {
    return fmt::format("<scale x=\"{:.17g}\" y=\"{:.17g}\" z=\"{:.17g}\"/>", x, y, z);
}
std::string translate(double x, double y, double z) {
    return fmt::format("<translate x=\"{:.17g}\" y=\"{:.17g}\" z=\"{:.17g}\"/>", x, y, z);
}
std::string rotate(double x, double y, double z, double degrees) {
    // Mitsuba takes the length of an axis for a scale.
    const double l = std::sqrt(x * x + y * y + z * z);
    return fmt::format("<rotate x=\"{:.17g}\" y=\"{:.17g}\" z=\"{:.17g}\" angle=\"{:.17g}\"/>", x / l, y / l, z / l,
                       degrees);
}

std::string diffuse(double reflectance) {
    return fmt::format("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{:.9g}\"/></bsdf>", reflectance);
}
std::string radius(double value) { return fmt::format("<float name=\"radius\" value=\"{:.17g}\"/>", value); }
std::string center(Point p) {
    return fmt::format("<point name=\"center\" x=\"{:.17g}\" y=\"{:.17g}\" z=\"{:.17g}\"/>", p.x, p.y, p.z);
}
std::string area_emitter(double radiance) {
    return fmt::format("<emitter type=\"area\"><rgb name=\"radiance\" value=\"{:.9g}\"/></emitter>", radiance);
}

std::string shape(const std::string& type, const Frame& frame, const std::string& elements, const std::string& inside) {
    return fmt::format("<shape type=\"{}\">{}{}</shape>\n", type, frame.place(elements), inside);
}

std::string rectangle(const Frame& frame, double half_x, double half_y, double height, bool down,
                      const std::string& inside) {
    const std::string turned = down ? rotate(1, 0, 0, 180) : "";
    return shape("rectangle", frame, scale_xyz(half_x, half_y, 1) + turned + translate(0, 0, height), inside);
}

std::string perspective(const Frame& frame, Point origin, Point target, Point up, double fov, double near,
                        const Film& film) {
    return fmt::format(
        "<sensor type=\"perspective\"><float name=\"fov\" value=\"{:.17g}\"/>{}<transform name=\"to_world\">{}{}"
        "</transform>{}</sensor>\n",
        fov, clips(frame, near), look_at(frame, origin, target, up), frame.rigid, film_xml(film));
}

std::string orthographic(const Frame& frame, Point origin, Point target, Point up, double half, double near,
                         const Film& film) {
    return fmt::format("<sensor type=\"orthographic\">{}<transform name=\"to_world\">{}{}{}</transform>{}</sensor>\n",
                       clips(frame, near), scale_xyz(half * frame.scale, half * frame.scale, 1),
                       look_at(frame, origin, target, up), frame.rigid, film_xml(film));
}

std::string scene_xml(int max_depth, const std::string& inside, int rr_depth) {
    return fmt::format(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<scene version=\"3.0.0\">\n<integrator type=\"path\"><integer "
        "name=\"max_depth\" value=\"{}\"/><integer name=\"rr_depth\" value=\"{}\"/></integrator>\n{}</scene>\n",
        max_depth, rr_depth, inside);
}

}  // namespace ambilux::stress
