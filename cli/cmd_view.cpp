#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/interrupt.h"
#include "core/error.h"
#include "core/log.h"
#include "film/exr_io.h"
#if defined(AMBILUX_HAS_VIEW)
#include "view/server.h"
#endif

namespace ambilux {
namespace {

struct ViewArguments {
    SceneOptions scene;
    RenderOptions render;
    std::string reference, host = "127.0.0.1";
    uint16_t port = 8765;
};

int view(const ViewArguments& o) {
#if defined(AMBILUX_HAS_VIEW)
    ViewOptions options;
    if (!o.reference.empty()) options.reference = read_reference_exr(o.reference);
    LoadedScene loaded = load_scene(o.scene);
    const RenderSettings settings = o.render.settings(loaded.scene);
    if (options.reference && (options.reference->mean.width != loaded.scene.sensor.crop_width ||
                              options.reference->mean.height != loaded.scene.sensor.crop_height))
        throw Error(ExitCode::bad_input,
                    fmt::format("{}: it has {}x{} pixels, the scene {}x{}; --size changes the scene's", o.reference,
                                options.reference->mean.width, options.reference->mean.height,
                                loaded.scene.sensor.crop_width, loaded.scene.sensor.crop_height));
    ViewedRender render(std::move(loaded.scene), settings, std::move(options));
    serve(render, {o.host, o.port}, save_when_interrupted(),
          [](const std::string& url) { log_info(fmt::format("{} (Ctrl-C ends it)", url)); });
    return int(ExitCode::done);
#else
    throw Error(ExitCode::device, fmt::format("view {}: this program was built without cpp-httplib (Debian: "
                                              "libcpp-httplib-dev), which this command needs",
                                              o.scene.path));
#endif
}

}  // namespace

void add_view(CLI::App& app, Run& run) {
    auto o = std::make_shared<ViewArguments>();
    CLI::App& command = *app.add_subcommand("view", "Look at a scene in a browser while it is rendered");
    o->scene.add_to(command);
    o->render.add_to(command, false);
    command.add_option("--reference", o->reference,
                       "Reference (EXR): the error is shown while the camera is that of the scene file");
    command.add_option("--port", o->port, "Port of the page; 0: a free one")->capture_default_str();
    command.add_option("--host", o->host, "Address to listen on; any other than this lets other machines connect")
        ->capture_default_str();
    command.callback([o, &run] { run = [o] { return view(*o); }; });
}

}  // namespace ambilux
