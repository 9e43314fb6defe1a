// The options of all commands as a manual page and as a completion for bash.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace ambilux {

/// All commands below `app`, given or not.
std::vector<const CLI::App*> commands_of(const CLI::App& app);

/// A page of man(7) macros.
std::string manual_page(const CLI::App& app);

/// A script that bash-completion loads for the program.
std::string bash_completion(const CLI::App& app);

}  // namespace ambilux
