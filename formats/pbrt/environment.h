// Environment maps of pbrt.
#pragma once

#include "formats/pbrt/tokens.h"

namespace ambilux::pbrt {

struct Environment {
    std::string image;   ///< in the document: latitude and longitude about +y, as Mitsuba's envmap has it
    double illuminance;  ///< of a surface that faces +z
};

/// Reads an image of the sphere in equal-area octahedral coordinates.
Environment read_environment(mitsuba::Document& document, const std::string& path, const Where& where);

}  // namespace ambilux::pbrt
