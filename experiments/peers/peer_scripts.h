// The files of scripts/peers, as they were when this program was built.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace ambilux {

/// Names and texts.
const std::vector<std::pair<std::string, std::string>>& peer_scripts();

}  // namespace ambilux
