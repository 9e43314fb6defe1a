#include <cmath>

#include "experiments/stress/families.h"
#include "experiments/stress/scenes.h"

namespace ambilux::stress {
namespace {

Family emission_scale() {
    Family family{"emission-scale", "radiance of the lamp in a white cavity", {}};
    for (const int k : {0, -15, -12, -9, -6, -4, -2, 2, 4, 6, 7, 8, 9, 12, 15}) {
        Cavity cavity;
        cavity.reflectance = 0.9;
        cavity.radiance = std::pow(10.0, k);
        Cell cell{family.name, decade(cavity.radiance), cavity.radiance, cavity_answer(cavity),
                  [cavity] { return SceneFiles{cavity_scene(cavity)}; }};
        cell.benign = k == 0;
        cell.quick = k == 0 || k == -12 || k == -6 || k == 9;
        family.cells.push_back(cell);
    }
    return family;
}

constexpr int kSpaceDecades[] = {0, -10, -9, -8, -6, -4, -2, 2, 4, 6, 8, 9, 10};

/// Scenes of quadrics (cavity), of triangles with direct light (plate), of a cube that emits (furnace).
template <class Scene>
Family space_scale(const std::string& name, const std::string& parameter, const Scene& scene,
                   std::string (*xml)(const Scene&), Answer (*answer)(const Scene&), int quick_decade) {
    Family family{name, parameter, {}};
    for (const int k : kSpaceDecades) {
        Scene scaled = scene;
        scaled.frame.scale = std::pow(10.0, k);
        Cell cell{name, decade(scaled.frame.scale), scaled.frame.scale, answer(scaled),
                  [scaled, xml] { return SceneFiles{xml(scaled)}; }};
        cell.benign = k == 0;
        cell.quick = k == 0 || std::abs(k) == quick_decade;
        family.cells.push_back(cell);
    }
    return family;
}

std::string plain_plate(const Plate& plate) { return plate_scene(plate); }

/// Coordinates of the scene are multiples of 1/4, so that floats hold them without rounding up to 2^21.
template <class Scene>
Family far_from_origin(const std::string& name, const Scene& scene, std::string (*xml)(const Scene&),
                       Answer (*answer)(const Scene&)) {
    Family family{name, "distance from the origin over the width of the scene", {}};
    for (const int k : {-1, 4, 8, 12, 14, 16, 18, 20, 21}) {
        Scene moved = scene;
        const double d = k < 0 ? 0 : std::exp2(k);
        moved.frame.rigid = translate(d, -d / 2, d / 4);
        Cell cell{name, decade(d), d, answer(moved), [moved, xml] { return SceneFiles{xml(moved)}; }};
        cell.benign = k < 0;
        cell.quick = k < 0 || k == 8 || k == 20;
        // Half a unit in the last place of the coordinates is 1e-3 of the width.
        if (k >= 14) cell.limit = "far-from-origin";
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> scale_families() {
    Cavity cavity;
    cavity.max_depth = 8;
    Plate plate;
    Furnace furnace;
    furnace.max_depth = 6;
    furnace.origin = {0.25, -0.25, 0.25};
    furnace.target = {1, 0.5, 0.25};
    return {
        emission_scale(),
        space_scale<Cavity>("space-scale", "radius of the cavity", cavity, cavity_scene, cavity_answer, 10),
        space_scale<Plate>("space-scale-plate", "scale of a floor under a lamp", plate, plain_plate, plate_answer, 8),
        space_scale<Furnace>("space-scale-furnace", "half side of the cube", furnace, furnace_scene, furnace_answer, 8),
        far_from_origin<Plate>("far-from-origin", plate, plain_plate, plate_answer),
        far_from_origin<Furnace>("far-furnace", furnace, furnace_scene, furnace_answer)};
}

}  // namespace ambilux::stress
