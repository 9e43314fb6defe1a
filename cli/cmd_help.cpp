#include <fmt/format.h>

#include <iostream>

#include "cli/commands.h"
#include "cli/manual.h"
#include "core/error.h"
#include "integrators/settings_help.h"

namespace ambilux {
namespace {

/// Of all commands if `name` is empty.
std::string help_of_command(const CLI::App& app, const std::string& name) {
    // app.help() would be that of the command `help`.
    if (name.empty()) return app.get_formatter()->make_help(&app, app.get_name(), CLI::AppFormatMode::Normal);
    for (const CLI::App* const command : app.get_subcommands([](const CLI::App*) { return true; }))
        if (command->get_name() == name) return command->help(app.get_name());
    throw Error(ExitCode::usage, fmt::format("help: there is no command '{}'", name));
}

}  // namespace

void add_help(CLI::App& app, Run& run) {
    CLI::App& command = *app.add_subcommand(
        "help",
        "Options of a command; settings and integrators with their values and defaults; manual page, completion");
    command.require_subcommand(0, 1);
    auto asked = std::make_shared<std::string>();
    command.add_option("COMMAND", *asked, "A command whose options to print, such as render");
    command.callback([&app, &command, asked, &run] {
        if (!command.get_subcommands().empty()) return;
        run = [&app, asked] {
            std::cout << help_of_command(app, *asked) << std::flush;
            return int(ExitCode::done);
        };
    });
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
