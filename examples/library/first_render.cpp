// first_render SCENE IMAGE.exr: 16 samples per pixel by bidirectional path tracing.
#include <cstdio>

#include "core/error.h"
#include "film/exr_io.h"
#include "formats/load.h"
#include "session/render_plan.h"

int main(int argc, char** argv) {
    using namespace ambilux;
    if (argc != 3) {
        std::fprintf(stderr, "usage: first_render SCENE IMAGE.exr\n");
        return int(ExitCode::usage);
    }
    try {
        LoadOptions options;
        options.width = 64;
        options.height = 48;
        const Scene scene = load_scene_file(argv[1], options);
        RenderSettings settings = default_settings(scene);
        apply_setting(settings, "integrator", "bdpt");
        const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
        const RenderPosition position = drive(*renderer, {}, {16, 0});
        write_exr(argv[2], mean_image(renderer->film()));
        std::printf("%llu samples per pixel in %.2f s\n", static_cast<unsigned long long>(position.samples),
                    position.seconds);
    } catch (const Error& e) {
        std::fprintf(stderr, "error: %s\n", e.what());
        return int(e.code);
    }
    return int(ExitCode::done);
}
