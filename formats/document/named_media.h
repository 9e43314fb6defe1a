// Refractive indices by name.
#pragma once

#include <string>
#include <string_view>

#include "core/vec.h"

namespace ambilux {

/// Index of refraction of a dielectric ("bk7", "air", "diamond", ...; case does not matter). False if unknown.
bool find_ior(std::string_view name, float& ior);

/// Complex index eta + i·k of a conductor ("Au", "Cu", ...) per RGB channel; "none" is a perfect mirror. False if
/// unknown.
bool find_metal(std::string_view name, Rgb& eta, Rgb& k);

/// All names, separated by commas, for messages.
std::string ior_names();
std::string metal_names();

}  // namespace ambilux
