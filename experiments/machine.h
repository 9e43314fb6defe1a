// What the figures were measured on.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace ambilux {

/// cpu (model), cores, system, driver (of NVIDIA devices; null without), read from /proc.
nlohmann::json describe_machine();

/// Now as "2026-01-31T12:34:56Z".
std::string utc_now();

}  // namespace ambilux
