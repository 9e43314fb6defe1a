// Which devices a process renders on.
#pragma once

#include <string>
#include <vector>

#include "core/ranks.h"
#include "session/parallel/crew.h"

namespace ambilux {

/// `names`: what --devices lists: numbers of CUDA devices, or "cpu". Where a host has several ranks they share them, in
/// turn, at least one each; without names a rank takes one of the devices of its host, or the CPU. Throws Error(usage).
std::vector<Device> choose_devices(const std::vector<std::string>& names, const RenderSettings& settings,
                                   const Ranks& ranks);

}  // namespace ambilux
