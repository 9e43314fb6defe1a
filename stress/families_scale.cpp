#include <cmath>

#include "stress/families.h"
#include "stress/scenes.h"

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

using MovedScene = SceneFiles (*)(const Plate&, Point by);

SceneFiles moved_plate(const Plate& plate, Point) { return {plate_scene(plate)}; }
SceneFiles anchored_plate(const Plate& plate, Point) {
    return {plate_scene(plate, plate_floor(plate) + stone({}, {0, 0, -9}))};
}
/// The vertices of the floor's file lie where the floor does.
SceneFiles meshed_plate(const Plate& plate, Point by) {
    std::vector<Point> corners = {{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}};
    for (Point& c : corners) c = {c.x + by.x, c.y + by.y, c.z + by.z};
    const std::string file = "far-mesh_" + whole(by.x) + ".obj";
    return {plate_scene(plate, obj_shape({}, file, "", diffuse(plate.reflectance))),
            {{file, obj_text(corners, {1, 2, 3, 1, 3, 4})}}};
}

struct Distance {
    double value;
    Point by;
    bool benign, quick;
};

/// Coordinates of the scenes are multiples of 1/4, so that floats hold them without rounding up to 2^21.
std::vector<Distance> distances() {
    std::vector<Distance> list;
    for (const int k : {-1, 4, 8, 12, 14, 16, 18, 20, 21}) {
        const double d = k < 0 ? 0 : std::exp2(k);
        list.push_back({d, {d, -d / 2, d / 4}, k < 0, k < 0 || k == 8 || k == 20});
    }
    return list;
}

Family far_plates(const std::string& name, const std::string& parameter, MovedScene make, bool limited) {
    Family family{name, parameter, {}};
    for (const Distance& d : distances()) {
        Plate plate;
        plate.frame.rigid = translate(d.by.x, d.by.y, d.by.z);
        Cell cell{name, whole(d.value), d.value, plate_answer(plate), [plate, d, make] { return make(plate, d.by); }};
        cell.benign = d.benign;
        cell.quick = d.quick;
        if (limited && d.value >= 256) cell.limit = "Far from the origin";
        family.cells.push_back(cell);
    }
    return family;
}

Family far_furnaces(const Furnace& furnace) {
    Family family{"far-furnace", "distance of a cube that emits from the origin", {}};
    for (const Distance& d : distances()) {
        Furnace moved = furnace;
        moved.frame.rigid = translate(d.by.x, d.by.y, d.by.z);
        Cell cell{family.name, whole(d.value), d.value, furnace_answer(moved),
                  [moved] { return SceneFiles{furnace_scene(moved)}; }};
        cell.benign = d.benign;
        cell.quick = d.quick;
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
        far_plates("far-plate", "distance of a floor under a lamp from the origin", moved_plate, false),
        far_plates("far-mesh", "distance from the origin of a floor whose file holds it", meshed_plate, false),
        far_plates("far-anchored", "distance of a floor under a lamp from the origin, where a stone lies",
                   anchored_plate, true),
        far_furnaces(furnace)};
}

}  // namespace ambilux::stress
