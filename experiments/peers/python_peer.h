// A peer that is a Python module: a script of scripts/peers renders with it and talks in lines of JSON.
#pragma once

#include "experiments/peers/peer.h"

namespace ambilux {

/// The interpreter: $AMBILUX_PEERS_PYTHON, else .venv/bin/python of the current folder if it is there, else python3.
std::string peers_python();

/// Starts peer_KIND.py with the job as JSON and waits until it has loaded the scene.
std::unique_ptr<PeerRenderer> start_python_peer(const PeerJob& job);

}  // namespace ambilux
