#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stress/answers.h"
#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

/// The spot looks straight down on a floor of which the camera sees what the cone reaches and a margin.
Family spot_cutoff() {
    Family family{"spot-cutoff", "degrees from the axis of a spot to its rim", {}};
    for (const double cutoff : {20.0, 45.0, 5.0, 1.0, 0.1, 0.05, 0.02, 0.01, 0.005, 0.001}) {
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
        cell.quick = cutoff == 20 || cutoff == 0.1 || cutoff == 0.001;
        if (cutoff <= 0.001) cell.limit = "Narrow cones and lobes";
        family.cells.push_back(cell);
    }
    return family;
}

Family grazing_light() {
    Family family{"grazing-light", "degrees between parallel light and the normal", {}};
    for (const double degrees : {0.0, 60.0, 80.0, 89.0, 89.9, 89.99, 89.999}) {
        const double a = degrees * M_PI / 180;
        const Plate plate;
        // The direction is a float: its cosine has an error of 6e-8 of the sine.
        const Answer answer{AnswerKind::closed_form, plate.reflectance / M_PI, true, "rho/pi E cos; E = 1/cos",
                            std::max(2e-5, 2e-7 * std::tan(a))};
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
    for (const int k : {0, -15, -6, 2, 4, 6, 8, 12, 15}) {
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

std::vector<Family> direction_families() { return {spot_cutoff(), grazing_light(), hot_pixel(), far_stone()}; }

}  // namespace ambilux::stress
