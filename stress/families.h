// All families of cells. A new one is a function and a line of the list in families.cpp.
#pragma once

#include <vector>

#include "stress/cell.h"

namespace ambilux::stress {

const std::vector<Family>& families();

// Each file makes its own.
std::vector<Family> scale_families();      ///< of emission, of space, far from the origin
std::vector<Family> mesh_families();       ///< needles, slivers, tessellation, overlap, T-junctions, mirrors, normals
std::vector<Family> view_families();       ///< grazing views, corners, films, gaps
std::vector<Family> light_families();      ///< sizes, numbers and ranges of emitters
std::vector<Family> direction_families();  ///< spots, parallel light, skies
std::vector<Family> room_families();       ///< what must not change a room of several materials
std::vector<Family> opacity_families();    ///< masked emitters and masks before them
std::vector<Family> material_families();   ///< roughness, indices of refraction, panes
std::vector<Family> depth_families();      ///< long paths with and without roulette
std::vector<Family> merging_families();    ///< radius, number and places of light vertices

}  // namespace ambilux::stress
