// The files that a command is asked to write.
#pragma once

#include <string>
#include <vector>

namespace ambilux {

struct Output {
    std::string option;  ///< that names it, for messages
    std::string path;    ///< "" or "-": none
};

/// Makes the folders of the outputs that are missing. Fails before any work if an output cannot be written, or two of
/// them are the same file. Throws Error(usage) or Error(device).
void check_outputs(const std::vector<Output>& outputs);

/// Fails if an output is one of the files that were read. Throws Error(usage).
void check_not_inputs(const std::vector<Output>& outputs, const std::vector<std::string>& inputs);

}  // namespace ambilux
