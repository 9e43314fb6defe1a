// Where coordinates of a scene count from.
#pragma once

#include "formats/mitsuba/xml.h"

namespace ambilux::mitsuba {

/// The point of the file's world that becomes (0,0,0): its own, unless all shapes and the camera lie so far from it,
/// for their size, that floats would lose digits there which they have near it. Judged by transforms, centres and
/// radii; the vertices of mesh files, floats themselves, do not matter.
Vec3d scene_origin(const Document& document);

}  // namespace ambilux::mitsuba
