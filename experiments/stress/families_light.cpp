#include <fmt/format.h>

#include <array>
#include <cmath>

#include "experiments/stress/answers.h"
#include "experiments/stress/families.h"
#include "experiments/stress/scenes.h"

namespace ambilux::stress {
namespace {

std::string point_light(double x, double y, double z, double intensity) {
    return fmt::format(
        "<emitter type=\"point\"><point name=\"position\" x=\"{:.17g}\" y=\"{:.17g}\" z=\"{:.17g}\"/><rgb "
        "name=\"intensity\" value=\"{:.9g}\"/></emitter>\n",
        x, y, z, intensity);
}

/// Radiance of the plate's floor under a point of that intensity at its height; a sphere that lies above the floor
/// as a whole gives the same for intensity = pi r² L.
Answer point_answer(const Plate& p, double intensity) {
    return {AnswerKind::closed_form,
            p.reflectance / M_PI * intensity * square_solid_angle(p.seen, p.height) / (4 * p.seen * p.seen), false,
            "rho/pi I W/A; W: solid angle of the seen square A"};
}

Family light_size() {
    Family family{"light-size", "radius of a spherical lamp of constant power; 0: a point", {}};
    for (const double radius : {0.3, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0}) {
        const Plate plate;
        Cell cell{family.name, decade(radius), radius, point_answer(plate, 1), [plate, radius] {
                      const std::string lamp =
                          radius == 0
                              ? point_light(0, 0, plate.height, 1)
                              : shape("sphere", {}, "",
                                      fmt::format("<point name=\"center\" x=\"0\" y=\"0\" z=\"{:.17g}\"/><float "
                                                  "name=\"radius\" value=\"{:.17g}\"/>",
                                                  plate.height, radius) +
                                          diffuse(0) + area_emitter(1 / (M_PI * radius * radius)));
                      return SceneFiles{plate_scene(plate, {}, lamp)};
                  }};
        cell.benign = radius == 0.3;
        cell.quick = cell.benign || radius == 1e-3 || radius == 1e-6 || radius == 0;
        if (radius < 0.1) cell.rare = "path-naive";
        family.cells.push_back(cell);
    }
    return family;
}

/// The lamp of the plate, cut into strips that are lamps of their own.
Family light_count() {
    Family family{"light-count", "emitters that a rectangular lamp is cut into", {}};
    for (const int n : {1, 10, 100, 1000, 10000, 100000}) {
        const Plate plate;
        Cell cell{family.name, decade(n), double(n), plate_answer(plate), [plate, n] {
                      const double half = plate.lamp_half / n;
                      std::string lamps =
                          "<bsdf type=\"diffuse\" id=\"black\"><rgb name=\"reflectance\" "
                          "value=\"0\"/></bsdf>\n";
                      for (int i = 0; i < n; ++i)
                          lamps += shape("rectangle", {},
                                         scale_xyz(half, plate.lamp_half, 1) + rotate(1, 0, 0, 180) +
                                             translate(-plate.lamp_half + (2 * i + 1) * half, 0, plate.height),
                                         "<ref id=\"black\"/>" + area_emitter(plate.radiance));
                      return SceneFiles{plate_scene(plate, {}, lamps)};
                  }};
        cell.benign = n == 1;
        cell.quick = n == 1 || n == 1000;
        family.cells.push_back(cell);
    }
    return family;
}

Family light_count_points() {
    Family family{"light-count-points", "point lights at one place", {}};
    for (const int n : {1, 100, 10000, 100000, 1000000}) {
        const Plate plate;
        Cell cell{family.name, decade(n), double(n), point_answer(plate, 1), [plate, n] {
                      std::string lights;
                      for (int i = 0; i < n; ++i) lights += point_light(0, 0, plate.height, 1.0 / n);
                      return SceneFiles{plate_scene(plate, {}, lights)};
                  }};
        cell.benign = n == 1;
        cell.quick = n == 1 || n == 100000;
        if (n == 1000000) cell.not_mitsuba = "a million emitters take minutes to load";
        family.cells.push_back(cell);
    }
    return family;
}

/// A second lamp that lights nothing has `value` times the power of the one that lights the floor.
Family emission_range(const std::string& name, bool strong_first) {
    Family family{name, "radiance of a lamp that lights nothing over that of the other", {}};
    for (const int k : {0, -15, -6, 1, 2, 3, 4, 6, 9, 12, 15}) {
        const Plate plate;
        const double ratio = std::pow(10.0, k);
        Cell cell{family.name, decade(ratio), ratio, plate_answer(plate), [plate, ratio, strong_first] {
                      const double h = plate.lamp_half;
                      const std::string weak = rectangle({}, h, h, 1, true, diffuse(0) + area_emitter(1)),
                                        strong = rectangle({}, h, h, 1.5, false, diffuse(0) + area_emitter(ratio));
                      return SceneFiles{plate_scene(plate, {}, strong_first ? strong + weak : weak + strong)};
                  }};
        cell.benign = k == 0;
        cell.quick = k == 0 || k == -15 || k == 2 || (k == 12 && !strong_first);
        if (k >= 3) cell.rare = "path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

/// Three lamps whose powers are 1 : 70 : 900 light the floor alike, in all orders.
Family emitter_order() {
    struct Lamp {
        double x, y, z, half;
    };
    constexpr std::array<Lamp, 3> lamps = {Lamp{-0.8, 0, 1, 0.2}, Lamp{8, 0, 10, 1}, Lamp{0, 30, 30, 5}};
    constexpr int orders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    Family family{"emitter-order", "number of a permutation of three lamps", {}};
    const Plate plate;
    std::array<double, 3> radiance;
    double sum = 0;
    for (size_t i = 0; i < 3; ++i) {
        const Lamp& l = lamps[i];
        radiance[i] = 0.1 / rectangle_form_factor(-l.x, -l.y, l.half, l.half, l.z);
        const auto along_y = [&](double x) {
            return integral([&](double y) { return rectangle_form_factor(x - l.x, y - l.y, l.half, l.half, l.z); },
                            -plate.seen, plate.seen);
        };
        sum += radiance[i] * integral(along_y, -plate.seen, plate.seen) / (4 * plate.seen * plate.seen);
    }
    const Answer answer{AnswerKind::closed_form, plate.reflectance * sum, false, "rho sum L F (Howell B-4)"};
    for (int k = 0; k < 6; ++k) {
        Cell cell{family.name, decade(k), double(k), answer, [=] {
                      std::string text;
                      for (const int i : orders[k]) {
                          const Lamp& l = lamps[size_t(i)];
                          text += shape("rectangle", {},
                                        scale_xyz(l.half, l.half, 1) + rotate(1, 0, 0, 180) + translate(l.x, l.y, l.z),
                                        diffuse(0) + area_emitter(radiance[size_t(i)]));
                      }
                      return SceneFiles{plate_scene(plate, {}, text)};
                  }};
        cell.benign = k == 0;
        cell.quick = k == 0 || k == 5;
        family.cells.push_back(cell);
    }
    return family;
}

/// The spot looks straight down on a floor of which the camera sees what the cone reaches and a margin.
Family spot_cutoff() {
    Family family{"spot-cutoff", "degrees from the axis of a spot to its rim", {}};
    for (const double cutoff : {45.0, 20.0, 5.0, 1.0, 0.1, 0.02, 0.001}) {
        const double c = cutoff * M_PI / 180, beam = 0.75 * c, intensity = 1 / (c * c), reflectance = 0.5;
        Plate plate;
        plate.reflectance = reflectance;
        plate.seen = 1.25 * std::tan(c);
        plate.frame.rigid = rotate(1, 2, 3, 37);
        // 1 - cos without its cancellation.
        const double inside = 2 * std::pow(std::sin(beam / 2), 2),
                     rim = integral([&](double t) { return (c - t) / (c - beam) * std::sin(t); }, beam, c),
                     area = 4 * plate.seen * plate.seen;
        const Answer answer{AnswerKind::closed_form, reflectance / M_PI * intensity * 2 * M_PI * (inside + rim) / area,
                            false, "rho/pi flux/A; flux: integral of I over the cone"};
        Cell cell{family.name, decade(cutoff), cutoff, answer, [plate, cutoff, intensity] {
                      const std::string spot = fmt::format(
                          "<emitter type=\"spot\"><rgb name=\"intensity\" value=\"{:.9g}\"/><float "
                          "name=\"cutoff_angle\" value=\"{:.9g}\"/><float name=\"beam_width\" value=\"{:.9g}\"/>"
                          "<transform name=\"to_world\"><lookat origin=\"0, 0, 1\" target=\"0, 0, 0\" up=\"0, 1, "
                          "0\"/>{}</transform></emitter>\n",
                          intensity, cutoff, 0.75 * cutoff, plate.frame.rigid);
                      return SceneFiles{plate_scene(plate, {}, spot)};
                  }};
        cell.benign = cutoff == 20;
        cell.quick = cutoff == 20 || cutoff == 0.1 || cutoff == 0.02;
        family.cells.push_back(cell);
    }
    // The benign cell comes first: the others are compared with it.
    std::swap(family.cells[0], family.cells[1]);
    return family;
}

Family grazing_light() {
    Family family{"grazing-light", "degrees between parallel light and the normal", {}};
    for (const double degrees : {0.0, 60.0, 80.0, 89.0, 89.9, 89.99, 89.999}) {
        const double a = degrees * M_PI / 180;
        const Plate plate;
        const Answer answer{AnswerKind::closed_form, plate.reflectance / M_PI, true, "rho/pi E cos; E = 1/cos"};
        Cell cell{family.name, decade(degrees), degrees, answer, [plate, a] {
                      const std::string sun = fmt::format(
                          "<emitter type=\"directional\"><vector name=\"direction\" x=\"{:.17g}\" y=\"0\" "
                          "z=\"{:.17g}\"/><rgb name=\"irradiance\" value=\"{:.9g}\"/></emitter>\n",
                          std::sin(a), -std::cos(a), 1 / std::cos(a));
                      return SceneFiles{plate_scene(plate, {}, sun)};
                  }};
        cell.benign = degrees == 0;
        cell.quick = degrees == 0 || degrees == 89.9;
        if (degrees > 89.5) cell.rare = "light";
        family.cells.push_back(cell);
    }
    return family;
}

const char* const kEnvironmentUp = "<rotate x=\"1\" angle=\"90\"/>";  // of the map's +y to +z

/// One pixel of the sky over a floor is `value` times as bright as the others. Rows of Mitsuba's maps reach from pole
/// to pole, columns are periodic, both interpolate linearly.
Family hot_pixel() {
    constexpr uint32_t width = 64, height = 32, x = 37, y = 8;
    Family family{"hot-pixel", "radiance of one pixel of an environment over that of the others", {}};
    for (const int k : {0, 2, 4, 6, 8}) {
        const double ratio = std::pow(10.0, k), row = M_PI / (height - 1);
        const auto hat = [&](double theta) {
            return std::max(0.0, 1 - std::abs(theta / row - y)) * std::cos(theta) * std::sin(theta);
        };
        const double hot =
            2 * M_PI / width * (integral(hat, (y - 1) * row, y * row) + integral(hat, y * row, (y + 1) * row));
        const Plate plate;
        const Answer answer{AnswerKind::closed_form, plate.reflectance * (1 + (ratio - 1) * hot / M_PI), true,
                            "rho/pi (pi + (v-1) 2 pi/w integral of the row's hat times cos sin)"};
        Cell cell{family.name, decade(ratio), ratio, answer, [plate, ratio] {
                      Image image{width, height, std::vector<float>(size_t(width) * height * 3, 1.0f)};
                      for (size_t c = 0; c < 3; ++c) image.rgb[(size_t(y) * width + x) * 3 + c] = float(ratio);
                      const std::string file = "hot-pixel_" + decade(ratio) + ".exr";
                      return SceneFiles{plate_scene(plate, {},
                                                    "<emitter type=\"envmap\"><string name=\"filename\" value=\"" +
                                                        file + "\"/><transform name=\"to_world\">" + kEnvironmentUp +
                                                        "</transform></emitter>\n"),
                                        {{file, "", image}}};
                  }};
        cell.benign = k == 0;
        cell.quick = k == 0 || k == 6;
        family.cells.push_back(cell);
    }
    return family;
}

/// A closed room under a sky that nothing in it sees; a stone far away makes the scene, and the sky's power, large.
Family far_stone() {
    Family family{"far-stone", "distance of a stone outside of a closed room under a sky", {}};
    for (const double distance : {4.0, 10.0, 1e2, 1e3, 1e4, 1e6}) {
        const Cavity cavity;
        Cell cell{family.name, decade(distance), distance, cavity_answer(cavity), [cavity, distance] {
                      std::string scene = cavity_scene(cavity);
                      const std::string end = "</scene>\n";
                      scene.resize(scene.size() - end.size());
                      return SceneFiles{scene + stone({}, {distance, 0, 0}) +
                                        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1\"/></emitter>\n" +
                                        end};
                  }};
        cell.benign = distance == 4;
        cell.quick = distance == 4 || distance == 100;
        if (distance > 10) cell.rare = "path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> light_families() {
    return {light_size(),
            light_count(),
            light_count_points(),
            emission_range("emission-range", false),
            emission_range("emission-range-strong-first", true),
            emitter_order(),
            spot_cutoff(),
            grazing_light(),
            hot_pixel(),
            far_stone()};
}

}  // namespace ambilux::stress
