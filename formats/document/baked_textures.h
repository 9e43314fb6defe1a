// Parameters that are functions of others, textures included: what becomes a bitmap when a scene is loaded, so that
// kernels need no trees of textures.
#pragma once

#include <functional>

#include "formats/document/builder.h"

namespace ambilux::document {

inline bool is_constant(const ParamFloat& p) { return p.texture < 0; }

/// Values of the inputs at one point.
using BakedFunction = std::function<Rgb(const std::vector<Rgb>&)>;

/// `f` of the inputs: a constant if they are, else a bitmap, finer than their textures unless those are large. Textures
/// must have one wrap mode, and coordinates that are the same or, where they repeat, fit a whole number of times into
/// those of the longest period. When only validating, a constant.
ParamRgb baked_color(Builder& builder, const Reader& in, const std::vector<ParamRgb>& inputs, const BakedFunction& f);

/// The same of numbers.
ParamFloat baked_number(Builder& builder, const Reader& in, const std::vector<ParamFloat>& inputs,
                        const std::function<float(const std::vector<float>&)>& f);

}  // namespace ambilux::document
