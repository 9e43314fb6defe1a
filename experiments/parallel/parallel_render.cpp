#include "experiments/parallel/parallel_render.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "core/error.h"
#include "core/flag.h"
#include "core/log.h"
#include "experiments/parallel/checkpoint.h"
#include "experiments/parallel/wire.h"
#include "experiments/statistics.h"
#include "experiments/stats_sum.h"

namespace ambilux {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Other ranks are looked at as often; a film of theirs is seconds of work.
constexpr double kPollSeconds = 2e-3, kPatience = 0.05;
/// A render in seconds begins with a range of one device: this long, or this share of its time.
constexpr double kTrialSeconds = 1, kTrialShare = 1.0 / 64;

class ParallelRender {
public:
    ParallelRender(const Scene& scene, const ParallelRequest& request, Ranks& ranks)
        : scene_(scene), request_(request), ranks_(ranks), settings_(request.settings), state_(request.state_path) {}

    ParallelResult run() {
        identity_ = identity();
        restore();
        choose();
        gather();
        start_ = Clock::now();
        saved_ = start_;
        if (ranges_.size == 0) find_range_size();
        if (!interrupted_) render();
        return end();
    }

private:
    struct Worker {
        WorkerShare share;
        size_t index = 0;  ///< in its process
        bool busy = false;
        double per_range = 0;  ///< seconds; 0: unknown
        RenderStats stats;     ///< since it began
    };

    /// What must be the same for a state to be continued.
    nlohmann::json identity() const {
        nlohmann::json settings = settings_json(request_.settings);
        return {{"scene_hash", scene_hash(scene_)}, {"spp", request_.budget.samples}, {"settings", settings}};
    }

    void restore() {
        const bool cuda = choose_devices(request_.devices, settings_, ranks_)[0].cuda >= 0;
        const uint64_t pixels = uint64_t(scene_.sensor.crop_width) * scene_.sensor.crop_height;
        ranges_ = {request_.range_size, request_.budget.samples};
        if (ranges_.size == 0 && ranges_.samples) ranges_.size = default_range_size(ranges_.samples, pixels, cuda);
        if (!state_.exists()) return;
        if (!request_.resume)
            throw Error(ExitCode::usage, fmt::format("{} holds a render that was stopped: go on with it with --resume, "
                                                     "or remove the file",
                                                     state_.path()));
        const nlohmann::json notes = state_.read(tree_);
        if (notes.is_null()) return;
        const auto refuse = [&](const std::string& what) {
            throw input_error(
                state_.path(), 0,
                fmt::format("holds another render: its {} differs. Give another -o, or remove the file", what));
        };
        for (const char* key : {"scene_hash", "spp"})
            if (notes.at("identity").at(key) != identity_.at(key)) refuse(key);
        for (const auto& [key, value] : identity_.at("settings").items())
            if (notes.at("identity").at("settings").value(key, nlohmann::json()) != value) refuse(key);
        if (request_.range_size && notes.at("range_size") != request_.range_size) refuse("range size");
        ranges_.size = notes.at("range_size");
        earlier_ = restore_stats(notes.at("stats"));
        earlier_seconds_ = notes.at("seconds");
        log_info(fmt::format("{}: {} samples per pixel were rendered earlier", state_.path(), tree_.samples()));
    }

    /// bdpt.auto chooses once, for all.
    void choose() {
        choice_ = earlier_.choice;
        if (settings_.automatic && choice_.name.empty()) {
            RenderSettings probe = settings_;
            const Device device = choose_devices(request_.devices, settings_, ranks_)[0];
            probe.backend = device.cuda >= 0 ? Backend::cuda : Backend::cpu;
            choice_ = make_renderer(scene_, probe)->stats().choice;
            earlier_seconds_ += choice_.seconds;
        }
        settings_.automatic = false;
        for (const auto& [key, value] : choice_.settings) apply_setting(settings_, key, value);
        settings_.expected_samples = ranges_.size;  // each range by itself
    }

    /// Until all ranks have their renderers: the clock of a budget starts then.
    void gather() {
        for (int rank = 1; rank < ranks_.size(); ++rank)
            tell(ranks_, rank, Say::setup,
                 {{"scene_hash", identity_["scene_hash"]},
                  {"expected_samples", settings_.expected_samples},
                  {"choice", choice_.settings}});
        crew_.emplace(scene_, settings_, choose_devices(request_.devices, settings_, ranks_));
        for (size_t i = 0; i < crew_->size(); ++i) add_worker(0, host_name(), i, crew_->stats(i));
        for (int ready = 1; ready < ranks_.size();) {
            const std::optional<Told> told = hear(ranks_);
            if (!told) {
                std::this_thread::sleep_for(std::chrono::duration<double>(kPollSeconds));
                if (is_set(request_.interrupt)) {
                    interrupted_ = true;
                    return;
                }
                continue;
            }
            const auto& devices = told->text.at("devices");
            for (size_t i = 0; i < devices.size(); ++i)
                add_worker(told->from, told->text.at("host"), i, restore_stats(devices[i]));
            ++ready;
        }
    }
    void add_worker(int rank, const std::string& host, size_t index, const RenderStats& stats) {
        workers_.push_back({{rank, host, stats.device}, index, false, 0, stats});
    }

    double elapsed() const { return earlier_seconds_ + seconds_since(start_); }

    void find_range_size() {
        const double seconds = std::min(kTrialSeconds, kTrialShare * request_.budget.seconds);
        order(workers_[0], {{1, 0}, {}, seconds});
        while (ranges_.size == 0 && !interrupted_) {
            for (Finished& f : crew_->take(kPatience)) {
                ranges_.size = f.order.ranges.size;
                arrived(workers_[0], f.order.node, std::move(f.film), f.seconds, crew_->stats(0));
            }
            interrupted_ = is_set(request_.interrupt);
        }
    }

    /// Ranges a second of all together, those that are not known yet as fast as the mean.
    double rate() const {
        double sum = 0;
        size_t known = 0;
        for (const Worker& w : workers_)
            if (w.per_range > 0) sum += 1 / w.per_range, ++known;
        return known ? sum * double(workers_.size()) / double(known) : 0;
    }

    void order(Worker& worker, const Order& what) {
        worker.busy = true;
        if (worker.share.rank == 0) return crew_->give(worker.index, what);
        tell(ranks_, worker.share.rank, Say::order,
             {{"worker", worker.index},
              {"size", what.ranges.size},
              {"samples", what.ranges.samples},
              {"level", what.node.level},
              {"index", what.node.index},
              {"trial", what.trial_seconds}});
    }

    void render() {
        Dealer dealer(ranges_, request_.budget.seconds, tree_);
        for (;;) {
            bool working = false;
            for (Worker& worker : workers_) {
                if (!worker.busy)
                    if (const auto node = dealer.next(elapsed(), worker.per_range, rate()))
                        order(worker, {ranges_, *node});
                working |= worker.busy;
            }
            if (!working) return;
            take();
            // Films of all workers take half of this thread's time at most.
            dealer.set_node_seconds(std::max(Dealer::kNodeSeconds, 2 * double(workers_.size()) * film_seconds()));
            if (is_set(request_.interrupt)) {
                interrupted_ = true;
                return;
            }
            if (seconds_since(saved_) >= request_.checkpoint_seconds) {
                state_.write(tree_, notes());
                saved_ = Clock::now();
            }
        }
    }

    /// That a film costs this thread.
    double film_seconds() const {
        uint64_t films = 0;
        for (const Worker& w : workers_) films += w.share.nodes;
        return films ? (merge_seconds_ + receive_seconds_) / double(films) : 0;
    }

    std::optional<Told> hear_timed() {
        const auto start = Clock::now();
        std::optional<Told> told = hear(ranks_);
        if (told) receive_seconds_ += seconds_since(start);
        return told;
    }

    void take() {
        for (Finished& f : crew_->take(ranks_.size() > 1 ? kPollSeconds : kPatience))
            arrived(workers_[f.worker], f.order.node, std::move(f.film), f.seconds, crew_->stats(f.worker));
        while (std::optional<Told> told = hear_timed()) {
            const nlohmann::json& t = told->text;
            const auto sender = std::find_if(workers_.begin(), workers_.end(), [&](const Worker& w) {
                return w.share.rank == told->from && w.index == t.at("worker");
            });
            arrived(*sender, {t.at("level"), t.at("index")}, std::move(told->film), t.at("seconds"),
                    restore_stats(t.at("stats")));
        }
    }

    void arrived(Worker& worker, RangeNode node, FilmMoments film, double seconds, const RenderStats& stats) {
        worker.busy = false;
        worker.per_range = seconds / double(node.end() - node.first());
        worker.share.seconds += seconds;
        worker.share.samples += film.samples;
        ++worker.share.nodes;
        worker.stats = stats;
        const auto start = Clock::now();
        tree_.add(node, std::move(film));
        merge_seconds_ += seconds_since(start);
        if (request_.on_progress) request_.on_progress(position(), total());
    }

    RenderPosition position() const { return {tree_.samples(), elapsed(), interrupted_}; }

    /// Of all devices, and of what an earlier part did.
    RenderStats total() const {
        RenderStats sum = earlier_;
        uint64_t bytes = 0, predicted = 0;
        double build = 0;
        std::map<std::string, int> devices;
        for (const Worker& w : workers_) {
            add_part(sum, {}, w.stats);
            bytes += w.stats.memory_bytes;
            predicted += w.stats.memory_bytes_predicted;
            build = std::max(build, w.stats.build_seconds);
            ++devices[w.share.host + ": " + w.stats.device];
        }
        sum.device.clear();
        for (const auto& [name, count] : devices)
            sum.device +=
                fmt::format("{}{}{}", sum.device.empty() ? "" : "; ", count > 1 ? fmt::format("{} x ", count) : "",
                            devices.size() > 1 || ranks_.size() > 1 ? name : workers_[0].stats.device);
        sum.memory_bytes = bytes;
        sum.memory_bytes_predicted = predicted;
        sum.build_seconds = build;
        sum.choice = choice_;
        sum.samples = tree_.samples();
        sum.render_seconds = elapsed();
        return sum;
    }

    nlohmann::json notes() const {
        return {{"identity", identity_},
                {"range_size", ranges_.size},
                {"seconds", elapsed()},
                {"stats", save_stats(total())}};
    }

    ParallelResult end() {
        ParallelResult result;
        result.position = position();
        result.stats = total();
        if (interrupted_ && tree_.samples()) {
            state_.write(tree_, notes());
            state_.wait();
            result.state_path = state_.path();
        }
        for (int rank = 1; rank < ranks_.size(); ++rank) tell(ranks_, rank, Say::stop, {});
        crew_.reset();
        result.film = tree_.sum();
        result.ranges = ranges_;
        for (const Worker& w : workers_) result.workers.push_back(w.share);
        std::stable_sort(result.workers.begin(), result.workers.end(),
                         [](const WorkerShare& a, const WorkerShare& b) { return a.rank < b.rank; });
        result.merge_seconds = merge_seconds_;
        result.receive_seconds = receive_seconds_;
        if (!interrupted_) state_.remove();
        return result;
    }

    const Scene& scene_;
    const ParallelRequest& request_;
    Ranks& ranks_;
    RenderSettings settings_;
    CheckpointFile state_;
    nlohmann::json identity_;
    Ranges ranges_;
    MergeTree tree_;
    RenderStats earlier_;
    double earlier_seconds_ = 0, merge_seconds_ = 0, receive_seconds_ = 0;
    SelectionStats choice_;
    std::optional<Crew> crew_;
    std::vector<Worker> workers_;
    Clock::time_point start_, saved_;
    bool interrupted_ = false;
};

}  // namespace

ParallelResult render_parallel(const Scene& scene, const ParallelRequest& request, Ranks& ranks) {
    return ParallelRender(scene, request, ranks).run();
}

}  // namespace ambilux
