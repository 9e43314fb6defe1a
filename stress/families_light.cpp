#include <fmt/format.h>

#include <array>
#include <cmath>

#include "stress/answers.h"
#include "stress/families.h"
#include "stress/scenes.h"

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
                      const std::string lamp = radius == 0
                                                   ? point_light(0, 0, plate.height, 1)
                                                   : shape("sphere", {}, "",
                                                           center({0, 0, plate.height}) + stress::radius(radius) +
                                                               diffuse(0) + area_emitter(1 / (M_PI * radius * radius)));
                      return SceneFiles{plate_scene(plate, {}, lamp)};
                  }};
        cell.benign = radius == 0.3;
        cell.quick = cell.benign || radius == 1e-3 || radius == 1e-6 || radius == 0;
        if (radius < 0.1) cell.rare = "path-naive";
        if (radius > 0 && radius <= 1e-5) cell.limit = "Small lamps";
        family.cells.push_back(cell);
    }
    return family;
}

Family light_size_rectangle() {
    Family family{"light-size-rectangle", "half side of a square lamp of constant power", {}};
    for (const double half : {0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7}) {
        Plate plate;
        plate.lamp_half = half;
        plate.radiance = 1 / (4 * half * half);
        // The sum of four corners of the form factor has lost its digits long before the lamp is a point.
        Answer answer = plate_answer(plate);
        if (half < 1e-3) {
            const double r2 = plate.height * plate.height;
            const auto cosines = [&](double x, double y) { return std::pow(r2 / (x * x + y * y + r2), 2) / r2; };
            const auto along_y = [&](double x) {
                return integral([&](double y) { return cosines(x, y); }, -plate.seen, plate.seen);
            };
            answer.value =
                plate.reflectance / M_PI * integral(along_y, -plate.seen, plate.seen) / (4 * plate.seen * plate.seen);
            answer.source = "rho/pi times the mean of cos^4/h^2: a small lamp of intensity cos";
        }
        Cell cell{family.name, decade(half), half, answer, [plate] { return SceneFiles{plate_scene(plate)}; }};
        cell.benign = half == 0.5;
        cell.quick = cell.benign || half == 1e-2 || half == 1e-6;
        if (half < 0.1) cell.rare = "path-naive";
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

/// Half of the lamp's texels are `value` times as bright as the others: each half lights a floor that lies
/// symmetrically under them with one half of what the whole would.
Family emission_within() {
    Family family{"emission-within", "radiance of one half of a lamp over that of the other", {}};
    for (const int k : {0, -15, -9, -6, -3, 3, 4, 6, 9, 12, 15}) {
        const Plate plate;
        const double ratio = std::pow(10.0, k);
        Answer answer = plate_answer(plate);
        answer.value *= (1 + ratio) / 2;
        answer.source = "(1+v)/2 " + answer.source;
        Cell cell{family.name, decade(ratio), ratio, answer, [plate, ratio, name = family.name] {
                      Image image{2, 1, std::vector<float>(6, 1.0f)};
                      for (size_t c = 3; c < 6; ++c) image.rgb[c] = float(ratio);
                      const std::string file = name + "_" + decade(ratio) + ".exr";
                      const std::string lamp =
                          "<emitter type=\"area\"><texture type=\"bitmap\" name=\"radiance\"><string "
                          "name=\"filename\" value=\"" +
                          file +
                          "\"/><string name=\"filter_type\" value=\"nearest\"/><boolean name=\"raw\" "
                          "value=\"true\"/></texture></emitter>";
                      return SceneFiles{plate_scene(plate, {},
                                                    rectangle({}, plate.lamp_half, plate.lamp_half, plate.height, true,
                                                              diffuse(0) + lamp)),
                                        {{file, "", image}}};
                  }};
        cell.benign = k == 0;
        cell.quick = k == 0 || k == -9 || k == 3 || k == 12;
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

}  // namespace

std::vector<Family> light_families() {
    return {light_size(),
            light_size_rectangle(),
            light_count(),
            light_count_points(),
            emission_range("emission-range", false),
            emission_range("emission-range-strong-first", true),
            emission_within(),
            emitter_order()};
}

}  // namespace ambilux::stress
