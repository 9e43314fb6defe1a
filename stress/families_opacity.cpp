#include <fmt/format.h>

#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

std::string masked(double opacity) {
    return fmt::format("<bsdf type=\"mask\"><float name=\"opacity\" value=\"{:.9g}\"/>{}</bsdf>", opacity, diffuse(0));
}

/// Opacity belongs to the BSDF: what a lamp sends out does not depend on it.
Family masked_emitter() {
    Family family{"masked-emitter", "opacity of a lamp", {}};
    for (const double opacity : {1.0, 0.9, 0.5, 0.1, 0.001}) {
        const Plate plate;
        Cell cell{family.name, decade(opacity), opacity, plate_answer(plate), [plate, opacity] {
                      return SceneFiles{plate_scene(plate, {},
                                                    rectangle({}, plate.lamp_half, plate.lamp_half, plate.height, true,
                                                              masked(opacity) + area_emitter(plate.radiance)))};
                  }};
        cell.benign = opacity == 1;
        cell.quick = opacity == 1 || opacity == 0.5;
        if (opacity < 1) cell.limit = "Emitters behind a mask";
        family.cells.push_back(cell);
    }
    return family;
}

/// A masked black sheet between floor and lamp lets 1 - opacity through. Mitsuba counts the passage as a segment.
Family mask_before_emitter() {
    Family family{"mask-before-emitter", "opacity of a black sheet before a lamp", {}};
    for (const double opacity : {0.0, 0.1, 0.5, 0.9, 0.999}) {
        Plate plate;
        plate.max_depth = 3;
        Answer answer = plate_answer(plate);
        answer.value *= 1 - opacity;
        answer.source = "(1 - opacity) " + answer.source;
        Cell cell{family.name, decade(opacity), opacity, answer, [plate, opacity] {
                      return SceneFiles{plate_scene(plate, {},
                                                    rectangle({}, plate.lamp_half, plate.lamp_half, plate.height, true,
                                                              diffuse(0) + area_emitter(plate.radiance)) +
                                                        rectangle({}, 2, 2, 0.75, true, masked(opacity)))};
                  }};
        cell.benign = opacity == 0;
        cell.quick = opacity == 0 || opacity == 0.5;
        if (opacity > 0.99) cell.rare = "path-naive path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> opacity_families() { return {masked_emitter(), mask_before_emitter()}; }

}  // namespace ambilux::stress
