#include "cli/program.h"

#include <fmt/format.h>

#include <charconv>
#include <iostream>
#include <new>

#include "cli/commands.h"
#include "cli/interrupt.h"
#include "cli/manual.h"
#include "core/error.h"
#include "core/log.h"
#include "core/ranks.h"
#include "core/version.h"
#include "session/devices.h"

namespace ambilux {
namespace {

/// The exit code, unless what was printed could not be written.
int flushed(int code) {
    std::cout.flush();
    if (std::cout) return code;
    log_error("cannot write to standard output");
    return code == int(ExitCode::done) ? int(ExitCode::device) : code;
}

std::string names_of(const std::vector<const CLI::App*>& commands) {
    std::string names;
    for (const CLI::App* c : commands) names += (names.empty() ? "" : ", ") + c->get_name();
    return names;
}

/// What CLI11 says of wrong options, and where to read on.
std::string wrong_use(const CLI::App* app, const CLI::Error& e) {
    std::string path = app->get_name();
    while (!app->get_subcommands().empty()) {
        app = app->get_subcommands().front();
        path += " " + app->get_name();
    }
    std::string what = e.what();
    if (e.get_name() == "ConversionError") what += ": that is no value of this option";
    if (const auto below = commands_of(*app); e.get_name() == "RequiredError" && !below.empty())
        what = "one of these is needed: " + names_of(below);
    return fmt::format("error: {}. See {} --help\n", what, path);
}

/// Reads integers as decimal ones of 64 bits: CLI11 takes 010 as eight, and -1 and 2^64 as the largest number.
template <class T>
std::string check_integer(std::string& text) {
    T value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (std::is_unsigned_v<T> && text.starts_with("-")) return "it must not be negative";
    if (error != std::errc() || end != text.data() + text.size())
        return fmt::format("'{}' is no integer of this option", text);
    text = std::to_string(value);
    return "";
}

void check_integers(CLI::App& app) {
    for (CLI::Option* option : app.get_options()) {
        if (option->get_type_name() == "UINT") option->transform(CLI::Validator(check_integer<uint64_t>, ""));
        if (option->get_type_name() == "INT") option->transform(CLI::Validator(check_integer<int64_t>, ""));
    }
    for (CLI::App* command : app.get_subcommands({})) check_integers(*command);
}

/// Each rank would do all of the work, and write the same files.
void check_ranks(const std::string& command) {
    if (launched_ranks() == 1) return;
    if (!ranks().launched())
        throw Error(ExitCode::usage, fmt::format("{} processes were started, but this program was built without MPI: "
                                                 "install libopenmpi-dev and build again",
                                                 launched_ranks()));
    if (command != "render" && command != "experiment")
        throw Error(ExitCode::usage, fmt::format("{}: only render and experiment work with several ranks", command));
}

}  // namespace

int run_program(int argc, const char* const* argv) {
    install_interrupt_handler();
    CLI::App app{"Ambilux: a testbed for bidirectional light transport", "ambilux"};
    app.set_version_flag("--version", [] {
        std::string devices = devices_text(cuda_report());
        devices.pop_back();  // it ends a line, and so does what prints this
        return fmt::format("ambilux {} ({})\n{}", version(), git_revision(), devices);
    });
    app.require_subcommand(1);
    app.fallthrough();
    app.failure_message(wrong_use);
    bool quiet = false;
    app.add_flag("--quiet", quiet, "Print errors only, no progress");
    Run run;
    add_render(app, run);
    add_info(app, run);
    add_convert(app, run);
    add_reference(app, run);
    add_compare(app, run);
    add_experiment(app, run);
    add_stress(app, run);
    add_bench(app, run);
    add_trace(app, run);
    add_view(app, run);
    add_devices(app, run);
    add_help(app, run);
    check_integers(app);
    const auto named = [&](CLI::App* command) { return argc > 1 && command->check_name(argv[1]); };
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(named).empty()) {
        log_error(fmt::format("unknown command '{}': {} are known", argv[1], names_of(commands_of(app))));
        return int(ExitCode::usage);
    }
    try {
        if (argc == 1) throw CLI::CallForHelp();
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        const int code = app.exit(e);
        return flushed(code == 0 && argc > 1 ? int(ExitCode::done) : int(ExitCode::usage));
    }
    set_quiet(quiet || ranks().rank() > 0);
    try {
        check_ranks(app.get_subcommands().front()->get_name());
        return flushed(run());
    } catch (const Error& e) {
        set_status_line("");
        log_error(ranks().rank() > 0 ? fmt::format("rank {} on {}: {}", ranks().rank(), host_name(), e.what())
                                     : e.what());
        return int(e.code);
    } catch (const std::bad_alloc&) {
        set_status_line("");
        log_error("out of memory: try a smaller --size");
        return int(ExitCode::device);
    } catch (const std::exception& e) {
        set_status_line("");
        log_error(fmt::format("unexpected: {}", e.what()));
        return int(ExitCode::device);
    }
}

}  // namespace ambilux
