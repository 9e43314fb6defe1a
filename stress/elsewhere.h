// What other renderers measured on the exported scenes, judged as our own rows are.
#pragma once

#include <string>
#include <vector>

#include "stress/rows.h"

namespace ambilux::stress {

/// Rows of a table with the columns cell, method, backend, boxes_x, boxes_y, samples, pixels, seconds, invalid, state,
/// note and boxes: means over pixels and channels of every batch and box, batch * boxes + box, separated by blanks. A
/// line without boxes has the state "refused" or "left out". Throws Error(bad_input) with file and line.
std::vector<Row> judge_elsewhere(const std::string& path, const std::vector<Family>& all);

}  // namespace ambilux::stress
