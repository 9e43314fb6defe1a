#include "cli/manual.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/version.h"

namespace ambilux {
namespace {

std::vector<const CLI::Option*> options_of(const CLI::App& app) {
    return app.get_options([](const CLI::Option*) { return true; });
}

/// Text as roff shows it: hyphens that can be copied, no line taken for a macro.
std::string roff(const std::string& text) {
    std::string out;
    bool line_begins = true;
    for (const char c : text) {
        if (line_begins && (c == '.' || c == '\'')) out += "\\&";
        out += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
        line_begins = c == '\n';
    }
    return out;
}

std::string names_of(const CLI::Option& option) {
    std::vector<std::string> names;
    for (const std::string& name : option.get_snames()) names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
    return names.empty() ? option.get_name() : fmt::format("{}", fmt::join(names, ", "));
}

std::string synopsis(const CLI::App& command) {
    std::string text;
    if (!commands_of(command).empty()) text += " COMMAND";
    for (const CLI::Option* option : options_of(command))
        if (option->get_positional()) text += " " + option->get_name();
    return text + " [OPTION]...";
}

void add_options(const CLI::App& command, std::string& page) {
    for (const CLI::Option* option : options_of(command)) {
        const std::string value = option->get_positional() ? "" : option->get_type_name();
        page += fmt::format(".TP\n\\fB{}\\fR{}\n{}", roff(names_of(*option)), value.empty() ? "" : " " + roff(value),
                            roff(option->get_description()));
        if (!option->get_default_str().empty()) page += fmt::format(" Default: {}.", roff(option->get_default_str()));
        page += "\n";
    }
}

void add_commands(const CLI::App& parent, const std::string& path, std::string& page) {
    for (const CLI::App* command : commands_of(parent)) {
        const std::string name = path + " " + command->get_name();
        page +=
            fmt::format(".SS \"{}{}\"\n{}\n", roff(name), roff(synopsis(*command)), roff(command->get_description()));
        add_options(*command, page);
        add_commands(*command, name, page);
    }
}

/// What can follow a command: commands first, so that a list that begins with an option has none.
void add_words(const CLI::App& app, const std::string& path, std::string& known, std::string& words) {
    std::vector<std::string> list;
    for (const CLI::App* command : commands_of(app)) {
        list.push_back(command->get_name());
        known += fmt::format("{}\"{} {}\"", known.empty() ? "" : " | ", path, command->get_name());
    }
    for (const CLI::Option* option : options_of(app)) {
        for (const std::string& name : option->get_snames()) list.push_back("-" + name);
        for (const std::string& name : option->get_lnames()) list.push_back("--" + name);
    }
    words += fmt::format("        \"{}\") words=\"{}\" ;;\n", path, fmt::join(list, " "));
    for (const CLI::App* command : commands_of(app))
        add_words(*command, path + " " + command->get_name(), known, words);
}

}  // namespace

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
    return app.get_subcommands([](const CLI::App*) { return true; });
}

std::string manual_page(const CLI::App& app) {
    std::string page = fmt::format(
        ".TH AMBILUX 1 \"\" \"ambilux {0}\"\n.SH NAME\nambilux \\- a testbed for bidirectional light transport\n"
        ".SH SYNOPSIS\n.B ambilux\nCOMMAND [OPTION]...\n.SH OPTIONS\n",
        version());
    add_options(app, page);
    page += ".SH COMMANDS\n";
    add_commands(app, "ambilux", page);
    page +=
        ".SH EXIT STATUS\n.TP\n0\ndone\n.TP\n2\nwrong use\n.TP\n3\nbad input: the message names file and line\n"
        ".TP\n4\na device or a resource failed\n.TP\n5\ninterrupted; what was finished is saved\n.TP\n6\nstress: some "
        "rows failed, are invalid or were refused\n";
    return page;
}

std::string bash_completion(const CLI::App& app) {
    std::string known, words;
    add_words(app, "ambilux", known, words);
    return fmt::format(R"(# Completion of ambilux for bash.
_ambilux() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} path=ambilux words= i
    for ((i = 1; i < COMP_CWORD; ++i)); do
        case "$path ${{COMP_WORDS[i]}}" in
        {}) path+=" ${{COMP_WORDS[i]}}" ;;
        esac
    done
    case "$path" in
{}    esac
    COMPREPLY=()
    # Without commands to choose from, a word that is no option is a file.
    if [[ $word == -* || $words != -* ]]; then mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word"); fi
}}
complete -o default -F _ambilux ambilux
)",
                       known, words);
}

}  // namespace ambilux
