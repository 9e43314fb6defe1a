// Images that another renderer left at known times: they take part as if it rendered now.
#pragma once

#include "experiments/peers/peer.h"

namespace ambilux {

/// Settings of such a run: `files` with placeholders {name} (of the scene), {seed} and {number} (from 1), and lists
/// `samples` and `seconds`, rising, of equal length, with a number for each image. Empty, or what is wrong.
std::string check_images(const Settings& settings);

/// Its passes are the differences of successive images, which are means of all samples so far.
std::unique_ptr<PeerRenderer> start_image_peer(const PeerJob& job);

}  // namespace ambilux
