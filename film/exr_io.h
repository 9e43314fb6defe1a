// OpenEXR files: images, and references with their standard errors. All writes are atomic.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "film/image.h"
#include "film/layer.h"

namespace ambilux {

/// What made an image. A flat JSON object; strings, integers and floating-point numbers become typed header attributes
/// of the same names (integers that do not fit 32 bits become strings). Usual names: scene, scene_hash, integrator,
/// variant, estimator, spp, seed, max_depth, backend, device, seconds, git_revision.
using Attributes = nlohmann::json;

/// Writes R, G, B and the channels of `layers` as 32-bit floats, ZIP compression. Throws Error(device) if the file
/// cannot be written.
void write_exr(const std::string& path, const Image& image, const Attributes& attributes = Attributes::object(),
               const std::vector<Layer>& layers = {});

/// Writes R, G, B and the standard errors of the means se.R, se.G, se.B; adds the attribute spp, and behind the image a
/// checksum of the file, which read_reference_exr() verifies.
void write_reference_exr(const std::string& path, const Reference& reference,
                         Attributes attributes = Attributes::object());

/// Reads R, G, B (or Y, repeated) of any pixel type and compression; alpha is ignored. `attributes`, if given, receives
/// the header's strings and numbers. Throws Error(bad_input) that names the file and what is wrong with it.
Image read_exr(const std::string& path, Attributes* attributes = nullptr);

/// Reads a reference; without se.* channels or spp attribute those fields stay empty.
Reference read_reference_exr(const std::string& path, Attributes* attributes = nullptr);

}  // namespace ambilux
