// Spots whose light falls off in another way than Mitsuba's.
#pragma once

#include <functional>

#include "formats/document/document.h"

namespace ambilux {

constexpr const char* kSpotNote =
    "the falloff of a spot, which is linear in Mitsuba, is a texture of up to 2048 texels a side";

/// Gives the spot, an emitter whose beam is as wide as its cone, a texture by which it falls off between `inner` and
/// `outer`, angles to its axis in radians: by `profile` of the share of cosines, 0 at `outer` and 1 at `inner`.
void add_spot_falloff(document::Document& document, document::Object& spot, double outer, double inner,
                      const std::function<double(double)>& profile);

}  // namespace ambilux
