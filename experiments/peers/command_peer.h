// Any program that writes an EXR of a given number of samples per pixel.
#pragma once

#include "experiments/peers/peer.h"

namespace ambilux {

/// Placeholders of a command: {output}, {spp} and {seed} must be there; {scene} (path of the scene's file), {name} (of
/// the scene), {width}, {height} and {depth} (segments, -1: no bound) may be. Empty, or what is wrong with the setting
/// `command`.
std::string check_command(const Settings& settings);

/// `command` with `values` in the place of the placeholders, quoted for a shell.
std::string fill_command(const std::string& command, const Settings& values);

/// One run of the program for each pass. Its time is what it says in a line "seconds: NUMBER" on standard output, else
/// that of the whole process.
std::unique_ptr<PeerRenderer> start_command_peer(const PeerJob& job);

}  // namespace ambilux
