// The setting strategies: groups such as "hits+next_event", or single strategies such as "s1t2+s2t2".
#pragma once

#include "integrators/settings.h"

namespace ambilux {

/// What is allowed, for help.
std::string allowed_strategies();
/// Throws Error(usage).
void set_strategies(RenderSettings& settings, const std::string& value);
/// As set_strategies takes them.
std::string strategies_text(const RenderSettings& settings);

}  // namespace ambilux
