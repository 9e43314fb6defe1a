// The one exception type of the project. What a user did wrong is an Error with an exit code; what we did wrong is an
// assert.
#pragma once

#include <stdexcept>
#include <string>

namespace ambilux {

enum class ExitCode : int { done = 0, usage = 2, bad_input = 3, device = 4, interrupted = 5 };

struct Error : std::runtime_error {
    ExitCode code;
    Error(ExitCode exit_code, const std::string& message) : std::runtime_error(message), code(exit_code) {}
};

/// Bad input file: "FILE:LINE: message"; line 0 leaves the number out.
inline Error input_error(const std::string& file, int line, const std::string& message) {
    std::string text = file;
    if (line > 0) text.append(":").append(std::to_string(line));
    return {ExitCode::bad_input, text.append(": ").append(message)};
}

}  // namespace ambilux
