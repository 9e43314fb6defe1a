#include <cmath>

#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

const std::string kConstant = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1\"/></emitter>\n";

Family grazing_view() {
    Family family{"grazing-view", "degrees between the view and the normal of a floor under a uniform sky", {}};
    for (const double degrees : {0.0, 60.0, 80.0, 89.0, 89.9, 89.99, 89.999}) {
        const double a = degrees * M_PI / 180, reflectance = 0.5;
        const Answer answer{AnswerKind::closed_form, reflectance, true, "rho L"};
        Cell cell{
            family.name, decade(degrees), degrees, answer, [a, reflectance] {
                const Point eye{3 * std::sin(a), 0, 3 * std::cos(a)}, up{-std::cos(a), 0, std::sin(a)};
                return SceneFiles{scene_xml(2, orthographic({}, eye, {0, 0, 0}, up, 0.75 * std::cos(a), 1e-3) +
                                                   rectangle({}, 4, 4, 0, false, diffuse(reflectance)) + kConstant)};
            }};
        cell.benign = degrees == 0;
        cell.quick = degrees == 0 || degrees == 89 || degrees == 89.999;
        if (degrees > 85) cell.rare = "light";  // the camera sees cos² of the floor
        family.cells.push_back(cell);
    }
    return family;
}

Family corners() {
    Family family{"corners", "degrees of a view into the corner of a furnace", {}};
    for (const double fov : {60.0, 10.0, 1.0, 0.1, 0.01, 0.001}) {
        Furnace furnace;
        furnace.reflectance = 0.8;
        furnace.max_depth = 6;
        furnace.fov = fov;
        furnace.target = {1, 1, 1};
        furnace.origin = {0.1, -0.2, 0.3};
        Cell cell{family.name, decade(fov), fov, furnace_answer(furnace),
                  [furnace] { return SceneFiles{furnace_scene(furnace)}; }};
        cell.benign = fov == 60;
        cell.quick = fov == 60 || fov == 0.01;
        // The hit point's rounding is 1e-7 of the room, the view's width 3e-5.
        if (fov == 0.001) cell.limit = "Contact shadows and thin panes";
        // The second moment of next event estimation has no bound where two lamps meet.
        if (fov <= 1) cell.rare = "path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

/// A lamp that covers a floor at a small height: what leaves the floor must not start behind the lamp.
Family gaps(const std::string& name, const std::string& parameter, const std::string& rigid) {
    Family family{name, parameter, {}};
    for (const int k : {0, -1, -2, -3, -4, -5, -6, -7, -8}) {
        Plate plate;
        plate.height = std::pow(10.0, k);
        plate.frame.rigid = rigid;
        plate.seen = plate.height / 2;
        plate.lamp_half = 1;
        Cell cell{family.name, decade(plate.height), plate.height, plate_answer(plate),
                  [plate] { return SceneFiles{plate_scene(plate)}; }};
        cell.benign = k == 0;
        cell.quick = k == 0 || k == -3 || k == -7;
        // Shapes of half side 2: rays start some 4e-7 of that above them.
        if (k <= -6) cell.limit = "Contact shadows and thin panes";
        if (k <= -1) cell.rare = "path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

Family films() {
    struct Size {
        unsigned width, height;
        bool quick;
    };
    Family family{"film-size", "pixels", {}};
    for (const Size size : {Size{32, 32, true}, Size{1, 1, true}, Size{2, 3, false}, Size{1024, 1, false},
                            Size{1, 1024, false}, Size{2048, 64, false}, Size{16384, 1024, false}}) {
        Furnace furnace;
        furnace.reflectance = 0.5;
        furnace.max_depth = 3;
        furnace.film = {size.width, size.height};
        const double pixels = double(size.width) * size.height;
        Cell cell{family.name, decade(size.width) + "x" + decade(size.height), pixels, furnace_answer(furnace),
                  [furnace] { return SceneFiles{furnace_scene(furnace)}; }};
        cell.benign = size.width == 32;
        cell.quick = size.quick;
        cell.device_only = pixels > 1 << 20;
        if (size.width == 1 && size.height > 1) cell.rare = "light";  // few connections meet so narrow a film
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> view_families() {
    return {
        grazing_view(), corners(), gaps("gap", "height of a lamp over a floor, over half the lamp's side", ""),
        gaps("gap-away", "the same, one length off the origin and turned", rotate(1, 2, 3, 37) + translate(1, -1, 1)),
        films()};
}

}  // namespace ambilux::stress
