// Environment maps of pbrt.
#pragma once

#include <vector>

#include "formats/pbrt/tokens.h"

namespace ambilux::pbrt {

struct Environment {
    std::string image;   ///< in the document: latitude and longitude about +y, as Mitsuba's envmap has it
    double illuminance;  ///< of a surface that faces +z
};

/// An image of the sphere in equal-area octahedral coordinates (Clarberg 2008), linear and nowhere negative.
struct SphereImage {
    size_t size = 0;  ///< texels a side
    std::vector<Rgb> texels;

    Rgb at(double x, double y, double z) const;  ///< of the texel that unit (x,y,z) falls into
};
SphereImage read_sphere_image(document::Document& document, const std::string& path, const Where& where,
                              const char* light);

/// Reads the image of an infinite light.
Environment read_environment(document::Document& document, const std::string& path, const Where& where);

}  // namespace ambilux::pbrt
