#include <algorithm>
#include <cmath>

#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

constexpr const char* kMerging = "vcm";

/// A room whose walls merge at any radius: the sphere bends away from a disk by a share of r^2 / 4.
Cell cavity_cell(const std::string& family, const std::string& label, double value, const Cavity& cavity) {
    Cell cell{family, label, value, cavity_answer(cavity), [cavity] { return SceneFiles{cavity_scene(cavity)}; }};
    cell.only = kMerging;
    return cell;
}

/// Settings for 2^k light subpaths an iteration, of 16 x 16 pixels, in as few samples as may be.
std::vector<std::pair<std::string, std::string>> subpaths_of(int k, const char* radius) {
    const int per_pixel = k - 8, in_a_sample = std::min(per_pixel, 4);
    return {{"light_paths", decade(std::exp2(in_a_sample))},
            {"merge_samples", whole(std::exp2(per_pixel - in_a_sample))},
            {"merge_radius", radius}};
}

Family radii() {
    Family family{"merge-radius", "radius of merges over that of a cavity", {}};
    for (const int k : {-3, -6, -5, -4, -2, -1}) {
        Cavity cavity;
        cavity.max_depth = 8;
        const double radius = std::pow(10.0, k);
        Cell cell = cavity_cell(family.name, decade(radius), radius, cavity);
        cell.benign = k == -3;
        cell.settings = {{"merge_radius", decade(radius)}};
        family.cells.push_back(cell);
    }
    return family;
}

/// Light subpaths of an iteration: pixels times light_paths times merge_samples. Each leaves some four vertices.
Family vertices() {
    Family family{"merge-vertices", "light subpaths of an iteration in a cavity", {}};
    for (const int k : {10, 4, 16, 22}) {
        Cavity cavity;
        cavity.max_depth = 8;
        const double subpaths = std::exp2(k);
        Cell cell = cavity_cell(family.name, whole(subpaths), subpaths, cavity);
        cell.benign = k == 10;
        cell.settings = subpaths_of(k, "0.003");
        cell.device_only = k > 20;
        cell.effort = std::exp2(std::min(0, 14 - k));
        family.cells.push_back(cell);
    }
    return family;
}

/// A beam to a spot on a floor that is smaller than the radius. Only merges find its light, and spread it over a disk
/// that the camera sees whole.
Family one_cell() {
    constexpr double kHalf = 1e-3, kSeen = 1, kReflectance = 0.5, kRadiance = 1e6;
    Family family{"merge-one-cell", "light subpaths of an iteration, whose vertices all lie in one cell", {}};
    for (const int k : {8, 12, 16, 20}) {
        const double subpaths = std::exp2(k);
        const auto scene = [] {
            return SceneFiles{scene_xml(
                2, orthographic({}, {0, 0, 0.5}, {0, 0, 0}, {0, 1, 0}, kSeen, 1e-3) +
                       rectangle({}, 2, 2, 0, false, diffuse(kReflectance)) +
                       rectangle({}, kHalf, kHalf, 1, true,
                                 diffuse(0) + "<emitter type=\"directionalarea\"><rgb name=\"radiance\" value=\"" +
                                     decade(kRadiance) + "\"/></emitter>"))};
        };
        const Answer answer{AnswerKind::closed_form, kReflectance / M_PI * kRadiance * std::pow(kHalf / kSeen, 2),
                            false, "rho/pi times the flux over the area that is seen"};
        Cell cell{family.name, whole(subpaths), subpaths, answer, scene};
        cell.only = kMerging;
        cell.benign = k == 8;
        cell.settings = subpaths_of(k, "0.1");
        cell.device_only = k > 16;  // every query looks at every vertex
        cell.not_mitsuba = "it has no method that finds this light";
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> merging_families() { return {radii(), vertices(), one_cell()}; }

}  // namespace ambilux::stress
