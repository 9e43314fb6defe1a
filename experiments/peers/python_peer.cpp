#include "experiments/peers/python_peer.h"

#include <fmt/format.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/log.h"
#include "experiments/peers/child_process.h"
#include "experiments/peers/pass_peer.h"
#include "experiments/peers/peer_scripts.h"

namespace ambilux {
namespace {

nlohmann::json to_json(const PeerJob& job) {
    const Sensor& sensor = job.scene->sensor;
    nlohmann::json parameters = nlohmann::json::object();
    for (const auto& [key, value] : job.parameters) parameters[key] = value;
    nlohmann::json json = {{"scene", job.scene_path},
                           {"parameters", parameters},
                           {"film", {sensor.film_width, sensor.film_height}},
                           {"crop", {sensor.crop_x, sensor.crop_y, sensor.crop_width, sensor.crop_height}},
                           {"max_depth", job.max_depth},
                           {"rr_depth", job.rr_depth},
                           {"folder", job.folder}};
    nlohmann::json settings = nlohmann::json::array();
    for (const auto& [key, value] : job.run->settings) {
        if (key == "integrator" || key == "variant" || key == "module") json[key] = value;
        if (key != "module") settings.push_back({key, value});
    }
    json["settings"] = settings;
    return json;
}

PeerDescription read_description(const nlohmann::json& ready) {
    PeerDescription d;
    d.version = ready.at("version").get<std::string>();
    d.device = ready.at("device").get<std::string>();
    d.backend = ready.at("backend").get<std::string>();
    d.load_seconds = ready.at("load_seconds").get<double>();
    d.compile_seconds = ready.at("compile_seconds").get<double>();
    d.changes = ready.at("changes").get<std::vector<std::string>>();
    d.differences = ready.at("differences").get<std::vector<std::string>>();
    return d;
}

class PythonPeer : public PassPeer {
public:
    explicit PythonPeer(const PeerJob& job)
        : PassPeer(job), name_(job.run->renderer), folder_(job.folder),
          child_(write_scripts(job), job.folder + "/log.txt") {
        const nlohmann::json answer = receive(job.interrupt);
        if (answer.contains("missing")) throw PeerRefusal(true, answer["missing"].get<std::string>());
        if (answer.contains("refused")) throw PeerRefusal(false, answer["refused"].get<std::string>());
        description_ = read_description(answer.at("ready"));
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        child_.send(nlohmann::json{
            {"seed", pass_seed(seed_, first)}, {"samples", count}, {"first", first}, {"render_seed", seed_}}
                        .dump());
        nlohmann::json answer;
        try {
            answer = receive(interrupt);
        } catch (const Error& e) {
            if (e.code == ExitCode::interrupted) return 0;
            throw;
        }
        if (answer.contains("refused")) throw PeerRefusal(false, answer["refused"].get<std::string>());
        const auto done = answer.value("samples", count);  // some end only after a little more than asked for
        const double seconds = answer.at("seconds").get<double>();
        if (answer.value("signed", false))  // a difference of sums
            film_.add_signed(read_pass(), done, seconds);
        else
            film_.add(read_pass(), done, seconds);
        return done;
    }

private:
    std::vector<std::string> write_scripts(const PeerJob& job) const {
        for (const auto& [file, text] : peer_scripts()) write_file_atomic(folder_ + "/" + file, text);
        write_file_atomic(folder_ + "/job.json", to_json(job).dump(2) + "\n");

        return {peers_python(), "-u", folder_ + "/peer_" + name_ + ".py", folder_ + "/job.json"};
    }

    nlohmann::json receive(const volatile bool* interrupt) {
        for (;;) {
            const auto line = child_.read_line(interrupt);
            if (!line && is_set(interrupt)) throw Error(ExitCode::interrupted, "interrupted");
            if (!line) throw PeerRefusal(false, fmt::format("{} ended: {}", peers_python(), child_.last_words()));
            nlohmann::json answer = nlohmann::json::parse(*line, nullptr, false);
            if (!answer.is_object()) throw PeerRefusal(false, "an answer that is not JSON: " + *line);
            if (!answer.contains("progress")) return answer;
            log_info(fmt::format("{}: {}", name_, answer["progress"].get<std::string>()));
        }
    }

    /// Three floats a pixel, row-major from the top left.
    Image read_pass() const {
        Image image{film_.moments().width, film_.moments().height, {}};
        const std::string bytes = read_file(folder_ + "/pass.f32");
        image.rgb.resize(size_t(image.width) * image.height * 3);
        if (bytes.size() != image.rgb.size() * sizeof(float))
            throw PeerRefusal(false, fmt::format("an image of {} bytes, not of {}x{} pixels", bytes.size(), image.width,
                                                 image.height));
        std::memcpy(image.rgb.data(), bytes.data(), bytes.size());
        return image;
    }

    const std::string name_, folder_;
    ChildProcess child_;
};

}  // namespace

std::string peers_python() {
    if (const char* set = std::getenv("AMBILUX_PEERS_PYTHON"); set && *set) return set;
    const std::string local = ".venv/bin/python";
    std::error_code ignored;
    return std::filesystem::exists(local, ignored) ? local : "python3";
}

std::unique_ptr<PeerRenderer> start_python_peer(const PeerJob& job) { return std::make_unique<PythonPeer>(job); }

}  // namespace ambilux
