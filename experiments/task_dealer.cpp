#include "experiments/task_dealer.h"

#include <fmt/format.h>
#include <sched.h>

#include <chrono>
#include <thread>

#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/log.h"
#include "core/ranks.h"
#include "core/sha256.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

enum Say : int { hello = 101, rows, done, gone, task, stop };

void tell(int to, Say kind, const nlohmann::json& text) { ranks().send(to, kind, text.dump()); }

void wait_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(5)); }

/// Cores that this process may run on.
std::vector<int> own_cores() {
    cpu_set_t set;
    std::vector<int> cores;
    if (::sched_getaffinity(0, sizeof set, &set) != 0) return cores;
    for (int core = 0; core < CPU_SETSIZE; ++core)
        if (CPU_ISSET(core, &set)) cores.push_back(core);
    return cores;
}

/// Who this is, what it renders on, and what it was asked for.
nlohmann::json greeting(const Prepared& prepared) {
    std::string asked = resolved_toml(prepared.config);
    for (const LoadedEntry& scene : prepared.scenes) asked += scene_hash(scene.scene);
    const bool cuda = prepared.backends.contains("cuda"), cpu = prepared.backends.contains("cpu");
    return {{"rank", ranks().rank()},
            {"host", host_name()},
            {"devices", prepared.devices},
            {"gpu", cuda ? cuda_device_bus_id() : ""},
            {"cores", cpu ? own_cores() : std::vector<int>{}},
            {"asked", to_hex(sha256(asked))}};
}

/// What two ranks share; empty if nothing.
std::string shared_by(const nlohmann::json& a, const nlohmann::json& b) {
    if (a["host"] != b["host"]) return "";
    if (a["gpu"] == b["gpu"] && a["gpu"] != "") return "the device " + a["gpu"].get<std::string>();
    for (const auto& core : a["cores"])
        for (const auto& other : b["cores"])
            if (core == other) return fmt::format("core {}", core.get<int>());
    return "";
}

/// Which ranks share what; empty if none do.
std::string check_shares(const nlohmann::json& greetings, const Prepared& prepared, bool allowed) {
    for (size_t i = 0; i < greetings.size(); ++i)
        for (size_t k = 0; k < i; ++k) {
            const std::string shared = shared_by(greetings[i], greetings[k]);
            if (shared.empty()) continue;
            const std::string text =
                fmt::format("ranks {} and {} on {} share {}", greetings[k]["rank"].get<int>(),
                            greetings[i]["rank"].get<int>(), greetings[i]["host"].get<std::string>(), shared);
            if (!prepared.config.seconds.empty() && !allowed)
                throw Error(ExitCode::usage, text +
                                                 ": times would not be those of a render alone. Start one rank for a "
                                                 "device (for the CPU: mpirun --bind-to), or say --shared-devices");
            log_warning(text + ": the times of this experiment are not those of renders alone");
            return text;
        }
    return "";
}

}  // namespace

ResultTable::Tell tell_first_rank(const std::string& table) {
    return [table](const char* what, const std::vector<std::string>& lines) {
        tell(0, rows, {{"table", table}, {"what", what}, {"lines", lines}});
    };
}

void TaskDealer::greet(const Prepared& prepared, const ExperimentRequest& request, ExperimentFolder& folder) {
    interrupt_ = request.interrupt;
    if (ranks().size() == 1) return;
    for (const RunEntry& run : prepared.config.runs)
        if (!run.renderer.empty())
            throw Error(ExitCode::usage, fmt::format("run '{}': other renderers are timed by one process alone: leave "
                                                     "mpirun out",
                                                     run.name));
    greetings_.push_back(greeting(prepared));
    while (greetings_.size() < size_t(ranks().size()))
        if (!hear_one()) wait_a_little();
    for (const auto& other : greetings_)
        if (other["asked"] != greetings_[0]["asked"])
            throw Error(ExitCode::bad_input, fmt::format("rank {} on {} read another configuration or other scenes",
                                                         other["rank"].get<int>(), other["host"].get<std::string>()));
    shared_ = check_shares(greetings_, prepared, request.shared_devices);
    folder.describe_ranks(greetings_, shared_);
}

bool TaskDealer::hear_one() {
    const std::optional<RankMessage> message = ranks().poll();
    if (!message) return false;
    const nlohmann::json text = nlohmann::json::parse(message->bytes);
    switch (Say(message->kind)) {
        case hello:
            greetings_.push_back(text);
            idle_.push_back(message->from);
            break;
        case rows: {
            const auto lines = text.at("lines").get<std::vector<std::string>>();
            if (text.at("table") == "states") {
                folder_.remove_state(lines.at(0));
                break;
            }
            ResultTable& table = text.at("table") == "runs" ? folder_.runs() : folder_.batches();
            if (text.at("what") == "add")
                table.add(lines);
            else
                table.remove(lines.at(0));
            break;
        }
        case done:
            --busy_;
            idle_.push_back(message->from);
            break;
        case gone:
            --busy_;
            ++gone_;
            break;
        default: throw Error(ExitCode::device, "another rank says what it should not");
    }
    return true;
}

void TaskDealer::feed() {
    while (!idle_.empty() && !open_.empty()) {
        const ExperimentTask t = open_.front();
        open_.pop_front();
        if (!work_(t, false)) continue;
        tell(idle_.back(), task, {{"reference", t.reference}, {"scene", t.scene}, {"run", t.run}, {"seed", t.seed}});
        idle_.pop_back();
        ++busy_;
    }
}

void TaskDealer::listen() {
    if (ranks().size() == 1 || ranks().rank() > 0) return;
    while (hear_one()) {}
    feed();
}

bool TaskDealer::deal(const std::vector<ExperimentTask>& tasks,
                      const std::function<bool(const ExperimentTask&, bool)>& work) {
    open_.assign(tasks.begin(), tasks.end());
    work_ = work;
    for (;;) {
        listen();
        if (!open_.empty()) {
            const ExperimentTask t = open_.front();
            open_.pop_front();
            if (!work(t, true)) return false;
        } else if (busy_ > 0) {
            if (is_set(interrupt_) || gone_ > 0) return false;
            wait_a_little();
        } else {
            return gone_ == 0;
        }
    }
}

void TaskDealer::stop() {
    for (int rank = 1; rank < ranks().size(); ++rank) tell(rank, Say::stop, {});
}

void TaskDealer::wait_for_others() {
    constexpr int kPatience = 1000;  // times 5 ms
    open_.clear();
    for (int i = 0; i < kPatience && busy_ > 0; ++i)
        if (!hear_one()) wait_a_little();
}

void serve_tasks(const Prepared& prepared, const ExperimentRequest& request,
                 const std::function<bool(const ExperimentTask&)>& work) {
    tell(0, hello, greeting(prepared));
    for (bool interrupted = false;; wait_a_little()) {
        if (!interrupted && is_set(request.interrupt)) interrupted = true;
        const std::optional<RankMessage> message = ranks().poll();
        if (!message) continue;
        if (message->kind == stop) return;
        const nlohmann::json t = nlohmann::json::parse(message->bytes);
        if (!interrupted) interrupted = !work({t.at("reference"), t.at("scene"), t.at("run"), t.at("seed")});
        tell(0, interrupted ? gone : done, {});
    }
}

}  // namespace ambilux
