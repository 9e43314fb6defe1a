// BSDF plugins without adapters.
#pragma once

#include "formats/mitsuba/builder.h"

namespace ambilux::mitsuba {

/// The record of a BSDF object.
BsdfRecord read_bsdf(Builder& builder, const Object& object);
/// That of a diffuse surface.
BsdfRecord diffuse_record(float reflectance);

}  // namespace ambilux::mitsuba
