// BSDF plugins without adapters.
#pragma once

#include "formats/document/builder.h"

namespace ambilux::document {

/// The record of a BSDF object.
BsdfRecord read_bsdf(Builder& builder, const Object& object);
/// Its `distribution` of microfacets.
Microfacets read_distribution(Builder& builder, Reader& in);
/// That of a diffuse surface.
BsdfRecord diffuse_record(float reflectance);
/// A thin plate of index 1, which changes nothing.
BsdfRecord clear_pane_record();

}  // namespace ambilux::document
