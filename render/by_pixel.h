// Numbers of connections for each pixel from the figures of estimators that have one number for all (docs/theory.md,
// "Connections by pixel").
#pragma once

#include "render/selection.h"

namespace ambilux {

/// Variance and work of a sample in each block of a film, `[option][block]`.
struct BlockFigures {
    uint32_t width, height;  ///< blocks
    std::vector<std::vector<double>> variance, work;
};

/// The option of each block with which the product of mean variance plus `unseen` and mean work is least, as far as
/// steps find it that change all blocks at once: no worse than any one option for all. Figures are means over
/// neighbouring blocks, which so agree; those of the few brightest blocks are left out.
std::vector<uint32_t> options_by_block(const BlockFigures& of, double unseen);

/// What the candidates `all` with one number of draws from a cache, up to 9, and as many light subpaths as `by_pixel`
/// say of it: its setting connections_map is added, its variance goes into `pilot`, and its work is returned. 0 where
/// all pixels have the same number, or there are not two to choose from. `excluded`: those that cannot be chosen.
double set_connections_map(SelectionCandidate& by_pixel, const std::vector<SelectionCandidate>& all,
                           const std::vector<std::string>& excluded, bool cuda, double unseen, Pilot& pilot);

}  // namespace ambilux
