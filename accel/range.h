// The coordinates that rays can be traced among.
#pragma once

namespace ambilux {

/// Largest coordinate of a surface, a camera or a lamp. Embree takes up to 1.8e18; a ray may start at a few radii of
/// the scene from its centre, and squares of distances must be floats.
constexpr float kMostCoordinate = 1e17f;
/// Smallest extent of what has an inverse transform, whose entries are coordinates too.
constexpr float kLeastExtent = 1e-17f;

}  // namespace ambilux
