#include <fmt/format.h>

#include <iostream>

#include "backends/cuda_device.h"
#include "cli/commands.h"
#include "cli/interrupt.h"
#include "core/error.h"
#include "core/log.h"
#include "core/ranks.h"
#include "experiments/dry_run.h"
#include "experiments/runner.h"

namespace ambilux {

void add_experiment(CLI::App& app, Run& run) {
    auto request = std::make_shared<ExperimentRequest>();
    auto dry = std::make_shared<bool>(false);
    CLI::App& command = *app.add_subcommand("experiment", "Run an experiment and measure it against references");
    command.add_option("CONFIG", request->config, "Experiment configuration (TOML)")->required();
    command.add_option("-o,--output", request->output, "Folder for results");
    command.add_option("--references", request->references,
                       "Folder that keeps references between experiments. Default: OUTPUT/references");
    command.add_flag("--resume", request->resume, "Continue the experiment in the folder");
    command.add_flag(
        "--reduced", request->reduced,
        "Sizes, seeds and budgets of the section [reduced] of the configuration: for a machine without a GPU");
    command.add_flag("--shared-devices", request->shared_devices,
                     "Let several ranks share devices or cores even though budgets are in seconds");
    command.add_flag("--dry-run", *dry,
                     "Print what would be done, with an estimate of time and memory, and write nothing");
    command.callback([request, dry, &run] {
        run = [request, dry] {
            // The ranks of a host take its devices in turn.
            if (ranks().launched() && cuda_available()) use_cuda_device(ranks().local_rank() % cuda_device_count());
            request->on_prepared = [r = request.get()] { r->interrupt = save_when_interrupted(); };
            if (*dry && ranks().rank() > 0) return int(ExitCode::done);
            if (*dry) {
                std::cout << describe_plan(*request, default_hooks()) << std::flush;
                return int(ExitCode::done);
            }
            if (request->output.empty())
                throw Error(ExitCode::usage, "experiment: -o FOLDER is needed, unless --dry-run is given");
            const ExitCode code = run_experiment(*request, default_hooks());
            if (code == ExitCode::interrupted)
                log_error("interrupted: all that was finished is saved; the same command with --resume goes on");
            else
                log_info(fmt::format("{}/runs.csv is complete", request->output));
            return int(code);
        };
    });
}

}  // namespace ambilux
