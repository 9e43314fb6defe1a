#include <fmt/format.h>

#include <iostream>

#include "cli/commands.h"
#include "cli/interrupt.h"
#include "core/error.h"
#include "core/log.h"
#include "experiments/stress/families.h"
#include "experiments/stress/runner.h"

namespace ambilux {
namespace {

int list_families() {
    for (const stress::Family& family : stress::families())
        std::cout << fmt::format("{:<22} {:>3} cells  {}\n", family.name, family.cells.size(), family.parameter);
    return int(ExitCode::done);
}

int stress_command(stress::Request& request) {
    if (request.output.empty()) throw Error(ExitCode::usage, "stress: -o FOLDER is needed, unless --list is given");
    request.interrupt = interrupt_flag();
    const stress::Summary summary = stress::run(request, default_hooks());
    std::cout << stress::report(summary) << std::flush;
    if (summary.interrupted) {
        log_error("interrupted: all rows that were finished are saved; the same command with --resume goes on");
        return int(ExitCode::interrupted);
    }
    return summary.bad() ? stress::kFailedCells : int(ExitCode::done);
}

}  // namespace

void add_stress(CLI::App& app, Run& run) {
    auto request = std::make_shared<stress::Request>();
    auto list = std::make_shared<bool>(false);
    CLI::App& command =
        *app.add_subcommand("stress", "Numerical stability: generated scenes with known answers, by every method");
    command.add_option("-o,--output", request->output, "Folder for scenes, expected.csv and stress.csv");
    command.add_flag("--quick", request->quick, "Fewer cells, methods and samples: at most three minutes on two cores");
    command.add_option("--family", request->families, "Only this family; may be given again")->allow_extra_args(false);
    command.add_option("--backend", request->backend, "auto, cpu or cuda")->capture_default_str();
    command.add_option("--seed", request->seed, "Seed of all renders")->capture_default_str();
    command.add_flag("--resume", request->resume, "Go on with the sweep that the folder holds");
    command.add_flag("--list", *list, "Print the families and what they sweep");
    command.callback([request, list, &run] {
        run = [request, list] { return *list ? list_families() : stress_command(*request); };
    });
}

}  // namespace ambilux
