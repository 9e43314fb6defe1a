// The principled BSDF of Mitsuba 3 as what it is made of.
#pragma once

#include "formats/document/builder.h"

namespace ambilux::document {

/// With the weight (1 - metallic)·spec_trans it is rough glass, else opaque: terms of the principled BSDF are linear in
/// their weights, so that the sum is the same BSDF.
struct PrincipledParts {
    Textured<Principled> opaque;
    Textured<RoughDielectric> glass;
    ParamFloat glass_weight = {0, -1};
};
PrincipledParts read_principled(Builder& builder, Reader& in);

Textured<PrincipledThin> read_principled_thin(Builder& builder, Reader& in);

}  // namespace ambilux::document
