// How much light passes the layer between a coating and what lies below it.
#pragma once

#include "core/vec.h"

namespace ambilux::pbrt {

/// As pbrt walks through it: each crossing at the cosine c loses all but exp(-thickness / c), even where nothing
/// scatters, and walks end after `depth` interfaces.
struct Coating {
    double eta = 1.5, thickness = 0.01;
    int64_t depth = 10;

    /// The reflectance with which a diffuse surface below a coating that loses nothing is as bright on average over all
    /// directions as one of `reflectance` is below this one.
    Rgb diffuse_below(Rgb reflectance) const;
};

}  // namespace ambilux::pbrt
