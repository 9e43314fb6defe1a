// Parameters that are functions of others, textures included: what becomes a bitmap when a scene is loaded, so that
// kernels need no trees of textures.
#pragma once

#include <functional>

#include "formats/mitsuba/builder.h"

namespace ambilux::mitsuba {

/// Values of the inputs at one point.
using BakedFunction = std::function<Rgb(const std::vector<Rgb>&)>;

/// `f` of the inputs: a constant if they are, else a bitmap with the coordinates that all their textures must have. Of
/// textures of one size it has the texels of `f`; others are put on a grid finer than each. When only validating, a
/// constant.
ParamRgb baked_color(Builder& builder, const Reader& in, const std::vector<ParamRgb>& inputs, const BakedFunction& f);

/// The same of numbers.
ParamFloat baked_number(Builder& builder, const Reader& in, const std::vector<ParamFloat>& inputs,
                        const std::function<float(const std::vector<float>&)>& f);

}  // namespace ambilux::mitsuba
