#include <iostream>

#include "cli/commands.h"
#include "cli/manual.h"
#include "core/error.h"
#include "integrators/settings_help.h"

namespace ambilux {

void add_help(CLI::App& app, Run& run) {
    CLI::App& command =
        *app.add_subcommand("help", "Settings and integrators with their values and defaults; manual page, completion");
    command.require_subcommand(1);
    CLI::App& settings = *command.add_subcommand("settings", "All settings and variants of integrators");
    auto markdown = std::make_shared<bool>(false);
    settings.add_flag("--markdown", *markdown, "As docs/reference.md");
    settings.callback([markdown, &run] {
        run = [markdown] {
            std::cout << (*markdown ? settings_reference() : settings_help()) << std::flush;
            return int(ExitCode::done);
        };
    });
    using Print = std::string (*)(const CLI::App&);
    const auto add = [&](const char* name, const char* help, Print print) {
        command.add_subcommand(name, help)->callback([&app, print, &run] {
            run = [&app, print] {
                std::cout << print(app) << std::flush;
                return int(ExitCode::done);
            };
        });
    };
    add("man", "The manual page, for man(1)", manual_page);
    add("completion", "A completion for bash", bash_completion);
}

}  // namespace ambilux
