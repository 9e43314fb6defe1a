#include <iostream>

#include "cli/commands.h"
#include "core/error.h"
#include "session/devices.h"

namespace ambilux {
namespace {

int devices(const std::string& json) {
    const CudaReport report = cuda_report();
    if (!json.empty()) write_json(json, devices_json(report));
    if (json != "-") std::cout << devices_text(report);
    return int(ExitCode::done);
}

}  // namespace

void add_devices(CLI::App& app, Run& run) {
    auto json = std::make_shared<std::string>();
    CLI::App& command =
        *app.add_subcommand("devices", "CUDA devices, their kernels, the driver, and why a device cannot be used");
    command.add_option("--json", *json, "Write it to a file, or - for standard output");
    command.callback([json, &run] { run = [json] { return devices(*json); }; });
}

}  // namespace ambilux
