#include <fmt/format.h>

#include <algorithm>
#include <iostream>

#include "cli/commands.h"
#include "cli/manual.h"
#include "core/error.h"
#include "integrators/settings_help.h"

namespace ambilux {
namespace {

/// Of all commands if `names` is empty; of {"bench", "rays"} that of `bench rays`.
std::string help_of_command(const CLI::App& app, const std::vector<std::string>& names) {
    // app.help() would be that of the command `help`.
    if (names.empty()) return app.get_formatter()->make_help(&app, app.get_name(), CLI::AppFormatMode::Normal);
    const CLI::App* command = &app;
    std::string path;
    for (const std::string& name : names) {
        path += (path.empty() ? "" : " ") + command->get_name();
        const auto below = commands_of(*command);
        const auto found = std::find_if(below.begin(), below.end(), [&](auto* c) { return c->get_name() == name; });
        if (found == below.end())
            throw Error(ExitCode::usage,
                        fmt::format("help: there is no command '{}'; {} --help lists them", name, path));
        command = *found;
    }
    return command->help(path);
}

}  // namespace

void add_help(CLI::App& app, Run& run) {
    CLI::App& command = *app.add_subcommand(
        "help",
        "Options of a command; settings and integrators with their values and defaults; manual page, completion");
    command.require_subcommand(0, 1);
    auto asked = std::make_shared<std::vector<std::string>>();
    command.add_option("COMMAND", *asked, "A command whose options to print, such as render or bench rays");
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
