#include <fmt/format.h>

#include <iostream>

#include "cli/commands.h"
#include "cli/interrupt.h"
#include "core/error.h"
#include "core/log.h"
#include "stress/families.h"
#include "stress/folder.h"
#include "stress/runner.h"

namespace ambilux {
namespace {

struct StressArguments {
    stress::Request request;
    bool list = false;
    std::string export_to, judge;
};

int list_families() {
    for (const stress::Family& family : stress::families())
        std::cout << fmt::format("{:<28} {:>3} cells  {}\n", family.name, family.cells.size(), family.parameter);
    return int(ExitCode::done);
}

void need_output(const std::string& output, const char* for_what) {
    if (output.empty()) throw Error(ExitCode::usage, fmt::format("stress: {} needs -o FOLDER", for_what));
}

int sweep(stress::Request& request) {
    need_output(request.output, "a sweep");
    if (request.seconds < 0) throw Error(ExitCode::usage, "--time: more than zero seconds are needed");
    request.interrupt = save_when_interrupted();
    const stress::Summary summary = stress::run(request, stress::families(), default_hooks());
    std::cout << stress::report(summary) << std::flush;
    if (summary.interrupted) {
        log_error(
            "stopped before its end: all rows that were finished are saved; the same command with --resume goes on");
        return int(ExitCode::interrupted);
    }
    return summary.bad() ? stress::kFailedRows : int(ExitCode::done);
}

/// Judges what another renderer measured.
int judge(const StressArguments& o) {
    need_output(o.request.output, "--judge");
    std::cout << stress::report(stress::judge(o.judge, o.request.output, stress::families())) << std::flush;
    return int(ExitCode::done);
}

int stress_command(StressArguments& o) {
    if (o.list) return list_families();
    if (!o.judge.empty()) return judge(o);
    if (o.export_to.empty()) return sweep(o.request);
    stress::export_cells(o.export_to, stress::chosen_cells(stress::families(), o.request.families, o.request.quick));
    return int(ExitCode::done);
}

}  // namespace

void add_stress(CLI::App& app, Run& run) {
    auto o = std::make_shared<StressArguments>();
    CLI::App& command =
        *app.add_subcommand("stress", "Numerical stability: generated scenes with known answers, by every method");
    command.add_option("-o,--output", o->request.output, "Folder for stress.csv");
    command.add_flag("--quick", o->request.quick,
                     "Fewer cells, methods and samples: at most three minutes on two cores");
    command.add_option("--family", o->request.families, "Only this family; may be repeated")->allow_extra_args(false);
    command.add_option("--method", o->request.methods, "Only this method; may be repeated")->allow_extra_args(false);
    command.add_option("--backend", o->request.backend, "auto, cpu or cuda")->capture_default_str();
    command.add_option("--seed", o->request.seed, "Seed of all renders")->capture_default_str();
    command.add_option("--time", o->request.seconds, "Seconds for the whole sweep, which are divided among its rows");
    command.add_flag("--resume", o->request.resume, "Continue the sweep in the folder");
    command.add_flag("--list", o->list, "Print the families and what they sweep");
    command.add_option("--export", o->export_to,
                       "Write the scenes, in Mitsuba's format, and expected.csv into this folder, and render nothing");
    command.add_option(
        "--judge", o->judge,
        "Test what another renderer measured on the exported scenes (docs/stress.md), and render nothing");
    command.callback([o, &run] { run = [o] { return stress_command(*o); }; });
}

}  // namespace ambilux
