#include <fmt/format.h>

#include <iostream>

#include "cli/commands.h"
#include "core/error.h"
#include "scene/info.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

struct InfoArguments {
    SceneOptions scene;
    RenderOptions render;
    std::string json;
};

void print(const nlohmann::json& value, int indent) {
    for (const auto& [key, v] : value.items()) {
        const bool list_of_objects = v.is_array() && !v.empty() && v[0].is_structured();
        std::cout << fmt::format("{:{}}{}:", "", indent, key);
        if (v.is_object() && v.empty()) {
            std::cout << " none\n";
        } else if (v.is_object() || list_of_objects) {
            std::cout << "\n";
            if (v.is_object()) {
                print(v, indent + 2);
            } else {
                for (const auto& element : v) std::cout << fmt::format("{:{}}- {}\n", "", indent + 2, element.dump());
            }
        } else if (v.is_array()) {
            for (size_t i = 0; i < v.size(); ++i)
                std::cout << (i ? ", " : " ") << (v[i].is_string() ? v[i].get<std::string>() : v[i].dump());
            std::cout << (v.empty() ? " none\n" : "\n");
        } else {
            std::cout << " " << (v.is_string() ? v.get<std::string>() : v.dump()) << "\n";
        }
    }
}

int info(const InfoArguments& o) {
    const LoadedScene loaded = load_scene(o.scene, {{"--json", o.json}});
    const RenderSettings settings = o.render.settings(loaded.scene);
    nlohmann::json json = scene_info(loaded.scene);
    // What this scene needs of the renderer is the renderer's own word.
    const RenderStats stats = make_renderer(loaded.scene, settings)->stats();
    json["kernels"] = {{"integrator", settings.integrator},
                       {"variant", settings.variant},
                       {"backend", stats.backend},
                       {"device", stats.device},
                       {"features", stats.features},
                       {"skipped", stats.skipped},
                       {"accel", stats.accel},
                       {"memory", setting_text(settings, "memory")},
                       {"memory_bytes", stats.memory_bytes}};
    json["seconds"] = seconds_json(stats, loaded.seconds);
    json["seconds"].update(
        {{"read", loaded.times.read}, {"place", loaded.times.place}, {"finish", loaded.times.finish}});
    if (!o.json.empty()) write_json(o.json, json);
    if (o.json != "-") print(json, 0);
    return int(ExitCode::done);
}

}  // namespace

void add_info(CLI::App& app, Run& run) {
    auto o = std::make_shared<InfoArguments>();
    CLI::App& command =
        *app.add_subcommand("info", "What is in a scene; which kernels and stages it needs, which it skips");
    o->scene.add_to(command);
    o->render.add_to(command, false);
    command.add_option("--json", o->json, "Write it to a file, or - for standard output");
    command.callback([o, &run] { run = [o] { return info(*o); }; });
}

}  // namespace ambilux
