#include "experiments/peers/command_peer.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/flag.h"
#include "experiments/peers/child_process.h"
#include "experiments/peers/pass_peer.h"

namespace ambilux {
namespace {

constexpr const char* kNeeded[] = {"output", "spp", "seed"};
constexpr const char* kPossible[] = {"scene", "name", "width", "height", "depth"};

std::string shell_word(const std::string& word) {
    std::string out = "'";
    for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

class CommandPeer : public PassPeer {
public:
    explicit CommandPeer(const PeerJob& job)
        : PassPeer(job), command_(setting_value(job.run->settings, "command")), folder_(job.folder) {
        values_ = {{"scene", job.scene_path},
                   {"name", job.scene_name},
                   {"width", std::to_string(film_.moments().width)},
                   {"height", std::to_string(film_.moments().height)},
                   {"depth", std::to_string(job.max_depth)}};
        description_.version = command_.substr(0, command_.find(' '));
        description_.device = "stated by no one";
        description_.backend = "command";
        description_.differences = {"scene, filter and roulette are as the command has them"};
        // The first pass shows whether the program runs at all, and whether it states its own time.
        description_.load_seconds = run_once(0, 1, job.interrupt);
        if (description_.load_seconds < 0) throw Error(ExitCode::interrupted, "interrupted");
        if (!states_time_)
            description_.differences.push_back("time is that of whole processes, start and loading included");
        film_.clear();
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        return run_once(first, count, interrupt) < 0 ? 0 : count;
    }
    /// Not fewer than 16, since starting the program is part of what a pass costs.
    uint32_t preferred_batch() const override { return std::max(16u, film_.preferred_batch()); }

private:
    /// Seconds of the whole process; negative if interrupted.
    double run_once(uint32_t first, uint32_t count, const volatile bool* interrupt) {
        const std::string output = folder_ + "/pass.exr";
        std::error_code ignored;
        std::filesystem::remove(output, ignored);
        Settings values = values_;
        values.emplace_back("output", output);
        values.emplace_back("spp", std::to_string(count));
        values.emplace_back("seed", std::to_string(pass_seed(seed_, first)));
        const double start = now();
        ChildProcess child({"/bin/sh", "-c", fill_command(command_, values)}, folder_ + "/log.txt");
        double stated = -1;
        while (const auto line = child.read_line(interrupt)) {
            constexpr std::string_view key = "seconds:";
            if (!line->starts_with(key)) continue;
            const double value = std::strtod(line->c_str() + key.size(), nullptr);
            if (value > 0 && std::isfinite(value)) stated = value;
        }
        const int status = child.wait(interrupt);
        if (status < 0 || is_set(interrupt)) return -1;
        const double whole = now() - start;
        if (status != 0)
            throw PeerRefusal(status == 127, fmt::format("exit status {}: {}", status, child.last_words()));
        const Image image = read_image(output, false);
        states_time_ = stated > 0;
        film_.add(image, count, states_time_ ? stated : whole);
        return whole;
    }

    const std::string command_, folder_;
    Settings values_;
    bool states_time_ = false;
};

}  // namespace

std::string check_command(const Settings& settings) {
    const std::string command = setting_value(settings, "command");
    for (const char* name : kNeeded)
        if (command.find(fmt::format("{{{}}}", name)) == std::string::npos)
            return fmt::format("'command' lacks the placeholder {{{}}}: it must have {{{}}}, and can have {{{}}}", name,
                               fmt::join(kNeeded, "}, {"), fmt::join(kPossible, "}, {"));
    return "";
}

std::string fill_command(const std::string& command, const Settings& values) {
    Settings words = values;
    for (auto& [key, value] : words) value = shell_word(value);
    return fill_placeholders(command, words);
}

std::unique_ptr<PeerRenderer> start_command_peer(const PeerJob& job) { return std::make_unique<CommandPeer>(job); }

}  // namespace ambilux
