#include <thread>

#include "core/error.h"
#include "core/flag.h"
#include "experiments/parallel/parallel_render.h"
#include "experiments/parallel/wire.h"
#include "experiments/statistics.h"
#include "experiments/stats_sum.h"
#include "integrators/setting.h"

namespace ambilux {
namespace {

/// The first rank looks for messages as often.
constexpr double kPollSeconds = 2e-3;

Told wait_for_setup(Ranks& ranks) {
    for (;;) {
        if (std::optional<Told> told = hear(ranks)) return std::move(*told);
        std::this_thread::sleep_for(std::chrono::duration<double>(kPollSeconds));
    }
}

}  // namespace

void serve_parallel(const Scene& scene, const ParallelRequest& request, Ranks& ranks) {
    const Told setup = wait_for_setup(ranks);
    if (setup.kind == Say::stop) return;
    if (setup.text.at("scene_hash") != scene_hash(scene))
        throw Error(ExitCode::bad_input, "the scene is not that of the first rank: its files differ");
    RenderSettings settings = request.settings;
    settings.automatic = false;
    settings.expected_samples = setup.text.at("expected_samples");
    for (const auto& [key, value] : setup.text.at("choice").get<std::vector<std::pair<std::string, std::string>>>())
        apply_setting(settings, key, value);
    std::optional<Crew> crew(std::in_place, scene, settings, choose_devices(request.devices, settings, ranks));
    nlohmann::json devices = nlohmann::json::array();
    for (size_t i = 0; i < crew->size(); ++i) devices.push_back(save_stats(crew->stats(i)));
    tell(ranks, 0, Say::ready, {{"host", host_name()}, {"devices", devices}});
    for (;;) {
        if (crew && is_set(request.interrupt)) crew.reset();  // the first rank decides what comes of it
        while (const std::optional<Told> told = hear(ranks)) {
            if (told->kind == Say::stop) return;
            const nlohmann::json& t = told->text;
            if (crew)
                crew->give(t.at("worker"),
                           {{t.at("size"), t.at("samples")}, {t.at("level"), t.at("index")}, t.at("trial")});
        }
        if (!crew) {
            std::this_thread::sleep_for(std::chrono::duration<double>(kPollSeconds));
            continue;
        }
        for (const Finished& f : crew->take(kPollSeconds))
            tell(ranks, 0, Say::finished,
                 {{"worker", f.worker},
                  {"size", f.order.ranges.size},
                  {"level", f.order.node.level},
                  {"index", f.order.node.index},
                  {"seconds", f.seconds},
                  {"stats", save_stats(crew->stats(f.worker))}},
                 &f.film);
    }
}

}  // namespace ambilux
