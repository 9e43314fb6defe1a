#include <thread>

#include "core/error.h"
#include "core/flag.h"
#include "integrators/setting.h"
#include "session/parallel/collector.h"
#include "session/parallel/parallel_render.h"
#include "session/parallel/wire.h"
#include "session/statistics.h"
#include "session/stats_sum.h"

namespace ambilux {
namespace {

/// Looks for messages: while an order is waited for, and else. A look costs a core 25 us.
constexpr double kServePollSeconds = 2e-3, kBusyPollSeconds = 10e-3;

Told wait_for_setup(Ranks& ranks) {
    for (;;) {
        if (std::optional<Told> told = hear(ranks)) return std::move(*told);
        std::this_thread::sleep_for(std::chrono::duration<double>(kServePollSeconds));
    }
}

/// What this rank adds up for the first one.
class Collecting {
public:
    explicit Collecting(Ranks& ranks) : ranks_(ranks) {}

    /// False if it says something else.
    bool heard(Told& told) {
        if (told.kind == Say::hand_over) {
            send(films_.hand_over(told.text.at("last")));
        } else if (told.kind == Say::part) {
            send(films_.add(read_node(told.text.at("block")), read_node(told.text.at("node")), std::move(told.film)));
            if (memory_.empty()) memory_ = memory_of(films_.take_spare());
        } else {
            return false;
        }
        return true;
    }
    Arrays* memory() { return &memory_; }

private:
    void send(const std::vector<MergeTree::Entry>& films) {
        for (const auto& [node, film] : films) tell(ranks_, 0, Say::collected, {{"node", node_text(node)}}, &film);
    }

    Ranks& ranks_;
    Collector films_;
    Arrays memory_;  ///< for the next film
};

}  // namespace

void serve_parallel(const Scene& scene, const ParallelRequest& request, Ranks& ranks) {
    const Told setup = wait_for_setup(ranks);
    if (setup.kind == Say::stop) return;
    if (setup.text.at("scene_hash") != scene_hash(scene))
        throw Error(ExitCode::bad_input, "the scene is not that of the first rank: its files differ");
    RenderSettings settings = request.settings;
    end_selection(settings);
    settings.expected_samples = setup.text.at("expected_samples");
    for (const auto& [key, value] : setup.text.at("selection").get<std::vector<std::pair<std::string, std::string>>>())
        apply_setting(settings, key, value);
    std::optional<SharedAccels> host(scene);
    std::optional<Crew> crew(std::in_place, scene, settings, choose_devices(request.devices, settings, ranks), *host);
    host.reset();
    tell(ranks, 0, Say::ready, {{"host", host_name()}, {"devices", work_text(crew->work())}});
    Collecting collecting(ranks);
    for (bool asked = true;;) {                               // the first orders come by themselves
        if (crew && is_set(request.interrupt)) crew.reset();  // the first rank decides what comes of it
        while (std::optional<Told> told = hear(ranks, collecting.memory())) {
            if (told->kind == Say::stop) return;
            if (collecting.heard(*told)) continue;
            if (told->kind == Say::states) {
                if (crew) crew->load(std::move(told->states));
                continue;
            }
            if (told->text.at("last").get<bool>()) asked = false;
            if (crew) crew->give(read_order(told->text));
        }
        if (!crew) {
            std::this_thread::sleep_for(std::chrono::duration<double>(kServePollSeconds));
            continue;
        }
        const std::vector<Finished> finished = crew->take(asked ? kServePollSeconds : kBusyPollSeconds);
        // Before its last film: the render ends when no film is missing.
        if (const size_t ranges = asked ? 0 : crew->wanted()) {
            tell(ranks, 0, Say::wanted, {{"ranges", ranges}});
            asked = true;  // where no answer comes nothing is left
        }
        for (const Finished& f : finished) {
            if (f.order.collector) tell_part(ranks, f);
            const nlohmann::json text = {
                {"node", node_text(f.order.node)}, {"seconds", f.seconds}, {"devices", work_text(crew->work())}};
            tell(ranks, 0, Say::finished, text, f.order.collector ? nullptr : &f.film, crew->take_states());
        }
    }
}

}  // namespace ambilux
