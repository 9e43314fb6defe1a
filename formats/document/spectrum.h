// Spectra as colours.
#pragma once

#include <utility>
#include <vector>

#include "core/vec.h"

namespace ambilux::document {

enum class SpectrumUse {
    reflectance,  ///< seen under D65 and at most 1
    unbounded,    ///< seen under D65: refractive indices
    emission,     ///< as it is
};

/// Linear Rec.709 of a piecewise linear spectrum, samples (wavelength in nm, value) with rising wavelengths, at least
/// two; zero outside. Scaled so that a spectrum of ones has luminance 1, as in Mitsuba's RGB mode. Colours out of gamut
/// are clipped at 0 (reflectance also at 1).
Rgb spectrum_to_rgb(const std::vector<std::pair<double, double>>& samples, SpectrumUse use);

/// A light that is 1 at all wavelengths (XYZ of 1, 1, 1).
constexpr Rgb kEqualEnergy = {1.204794f, 0.948291f, 0.908916f};
/// Planck's law in W/(m² sr nm), every 5 nm of the visible range.
std::vector<std::pair<double, double>> planck(double kelvin, double scale);

}  // namespace ambilux::document
