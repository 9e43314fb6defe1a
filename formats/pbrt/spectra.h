// Spectra and colours of pbrt as linear Rec.709.
#pragma once

#include "formats/pbrt/parameters.h"

namespace ambilux::pbrt {

enum class ColorSpace { srgb, rec2020, dci_p3, aces2065_1 };
/// By pbrt's name.
ColorSpace color_space(const std::string& name, const Where& where);

enum class ColorUse {
    reflectance,
    unbounded,  ///< optical constants
    light,      ///< all but rgb have a luminance of 1, as pbrt's lights give them
};

struct SpectrumReader {
    const std::string& folder;  ///< of the main file
    document::Document& document;
    Report& report;

    /// Colour of a parameter of type rgb, spectrum, blackbody or, if grey, float.
    Rgb color(const Parameter& p, ColorUse use, ColorSpace space) const;
    /// Index of refraction: a number, a named glass, or the mean of a spectrum as the eye weighs it.
    double ior(const Parameters& in, const std::string& name, double fallback) const;

private:
    std::vector<std::pair<double, double>> samples(const Parameter& p) const;
};

/// Path of a file that a scene names: relative to the folder of the main file. Fails if there is none.
std::string resolve(const std::string& folder, const std::string& name, const Where& where);

}  // namespace ambilux::pbrt
