// Coatings of format 0.6.
#pragma once

#include "formats/document/builder.h"

namespace ambilux::document {

struct CoatPlace {
    uint32_t table;  ///< BsdfRecord::coat
    bool rough;
};

bool is_coating(const std::string& type);
/// Parameters of a coating, but not the BSDF below.
CoatPlace read_coat(Builder& builder, Reader& in);

}  // namespace ambilux::document
