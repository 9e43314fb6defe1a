#include <fmt/format.h>

#include "cli/commands.h"
#include "core/error.h"
#include "core/log.h"
#include "formats/convert/convert.h"

namespace ambilux {
namespace {

struct ConvertArguments {
    SceneOptions scene;
    std::string output;
};

int convert(const ConvertArguments& o) {
    if (!o.output.ends_with(".xml"))
        throw Error(ExitCode::usage,
                    fmt::format("OUT {}: Mitsuba scenes are written, whose names end in .xml", o.output));
    const LoadedScene loaded = load_scene(o.scene, {{"OUT", o.output}});
    for (const std::string& note : write_mitsuba(loaded.scene, o.output)) log_warning(o.output + ": " + note);
    log_info(fmt::format("{}: {} shapes", o.output, loaded.scene.shapes.size()));
    return int(ExitCode::done);
}

}  // namespace

void add_convert(CLI::App& app, Run& run) {
    auto o = std::make_shared<ConvertArguments>();
    CLI::App& command = *app.add_subcommand(
        "convert", "Write a scene as Mitsuba 3 XML, with its meshes and images in a folder beside it");
    o->scene.add_to(command);
    command.add_option("OUT", o->output, "File to write; its name ends in .xml")->required();
    command.callback([o, &run] { run = [o] { return convert(*o); }; });
}

}  // namespace ambilux
