#include <fmt/format.h>

#include <cmath>

#include "stress/answers.h"
#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

const std::string kConstant = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1\"/></emitter>\n";

/// Share of light along the normal that a mirror of GGX roughness alpha reflects: D cos has the distribution u of
/// tan² = alpha² u/(1-u), and Smith's masking of the direction that leaves at twice the angle is left over.
double ggx_albedo(double alpha) {
    const auto masking = [&](double u) {
        const double tangent = alpha * std::sqrt(u / (1 - u)), t2 = std::tan(2 * std::atan(tangent));
        return 2 / (1 + std::sqrt(1 + alpha * alpha * t2 * t2));
    };
    return integral(masking, 0, 1 / (1 + alpha * alpha), 200);
}

Family roughness() {
    Family family{"roughness", "GGX roughness of a mirror under a uniform sky", {}};
    for (const double alpha : {0.5, 1.0, 0.1, 1e-2, 1e-3, 1e-4}) {
        const Answer answer{AnswerKind::closed_form, ggx_albedo(alpha), true,
                            "integral of Smith's masking over the distribution of normals"};
        Cell cell{family.name, decade(alpha), alpha, answer, [alpha] {
                      const std::string mirror = fmt::format(
                          "<bsdf type=\"roughconductor\"><string name=\"material\" value=\"none\"/><string "
                          "name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\"{:.9g}\"/></bsdf>",
                          alpha);
                      return SceneFiles{scene_xml(2, orthographic({}, {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 0.5, 1e-3) +
                                                         rectangle({}, 1, 1, 0, false, mirror) + kConstant)};
                  }};
        cell.benign = alpha == 0.5;
        cell.quick = alpha == 0.5 || alpha == 1e-2 || alpha == 1e-4;
        // Narrow lobes are not met by sampling the sky.
        if (alpha < 0.1) cell.rare = "path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

std::string glass(double excess) {
    return fmt::format(
        "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"{:.17g}\"/><float name=\"ext_ior\" value=\"1\"/>"
        "</bsdf>",
        1 + excess);
}

/// Glass under a uniform sky cannot be seen: what it does not let through it reflects.
Family ior() {
    Family family{"ior-near-1", "index of refraction of a sphere, less 1", {}};
    for (const double excess : {0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7}) {
        const Answer answer{AnswerKind::closed_form, 1, true, "L: a lossless body under a uniform sky"};
        Cell cell{family.name, decade(excess), excess, answer, [excess] {
                      return SceneFiles{scene_xml(100,
                                                  perspective({}, {0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 10, 1e-2) +
                                                      shape("sphere", {}, "", glass(excess)) + kConstant,
                                                  100)};
                  }};
        cell.benign = excess == 0.5;
        cell.quick = excess == 0.5 || excess == 1e-6;
        cell.rare = "light";
        family.cells.push_back(cell);
    }
    return family;
}

Family panes(const std::string& name, const std::string& parameter, double degrees, const Frame& frame) {
    Family family{name, parameter, {}};
    const double a = degrees * M_PI / 180, distance = 2 * std::sqrt(2);
    const Point eye = {distance * std::sin(a), 0, distance * std::cos(a)};
    for (const int k : {-1, -2, -3, -4, -5, -6, -7}) {
        const double thickness = std::pow(10.0, k);
        const Answer answer{AnswerKind::closed_form, 1, true, "L: a lossless body under a uniform sky"};
        Cell cell{family.name, decade(thickness), thickness, answer, [thickness, eye, degrees, frame] {
                      return SceneFiles{
                          scene_xml(100,
                                    perspective(frame, eye, {0, 0, 0}, {0, 1, 0}, degrees > 80 ? 0.1 : 10, 1e-2) +
                                        shape("cube", frame, scale_xyz(1, 1, thickness), glass(0.5)) + kConstant,
                                    100)};
                  }};
        cell.benign = k == -1;
        cell.quick = k == -1 || k == -3 || k == -6;
        cell.rare = "light";
        if (thickness < 4e-5) cell.limit = "Contact shadows and thin panes";
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> material_families() {
    Frame away;
    away.rigid = rotate(1, 2, 3, 37) + translate(1, -1, 1);
    return {
        roughness(), ior(), panes("thin-panes", "thickness of a pane of glass over its width", 45, {}),
        panes("thin-panes-grazing", "the same, seen at 89 degrees, one length off the origin and turned", 89, away)};
}

}  // namespace ambilux::stress
