// What the figures were measured on.
#pragma once

#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>

namespace ambilux {

/// cpu (model), cores, memory_bytes, system, driver (of NVIDIA devices; null without), read from /proc.
nlohmann::json describe_machine();

/// Of a line such as "NVRM version: NVIDIA UNIX Open Kernel Module for x86_64  580.65.06  Release Build": the first
/// word of digits and dots; all of it without one.
std::string parse_driver_version(const std::string& line);

struct CpuMhz {
    double lowest = 0, mean = 0, highest = 0;  ///< over cores; 0: unknown
};
/// From /proc/cpuinfo.
CpuMhz cpu_mhz();
/// From lines such as "cpu MHz\t\t: 2100.000" of that file; lines without a number do not count.
CpuMhz parse_cpu_mhz(std::istream& cpuinfo);

/// What a command of the shell prints; empty if it fails.
std::string printed_by(const std::string& command);

/// What the clocks run at now, as {when, cpu_mhz {lowest, mean, highest}, gpu [{sm_mhz, memory_mhz, celsius}]}: figures
/// of a machine that was throttled or shared can be told. From /proc/cpuinfo and nvidia-smi; null where those do not
/// say. `cuda`: a device renders, whose clocks they are; else null. A GPU without work shows its idle clocks.
nlohmann::json describe_clocks(const std::string& when, bool cuda);

/// What the program and its libraries are: ambilux, git_revision, compiler, flags, embree, tbb, cuda (null without).
nlohmann::json describe_versions();

/// How this process was called.
std::string command_line();

/// The "gpu" list from nvidia-smi's lines "1980, 2619, 41"; what is no number becomes null.
nlohmann::json parse_gpu_clocks(const std::string& lines);

/// Now as "2026-01-31T12:34:56Z".
std::string utc_now();

}  // namespace ambilux
