#include "session/parallel/parallel_render.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "core/error.h"
#include "core/flag.h"
#include "core/log.h"
#include "core/seconds.h"
#include "render/shared_renderer.h"
#include "session/parallel/checkpoint.h"
#include "session/parallel/collector.h"
#include "session/parallel/state_log.h"
#include "session/parallel/wire.h"
#include "session/statistics.h"
#include "session/stats_sum.h"

namespace ambilux {
namespace {

/// Other ranks are looked at as often; a film of theirs is seconds of work, and a look costs a core 25 us.
constexpr double kPollSeconds = 5e-3, kPatience = 0.05;
/// A render in seconds begins with a range of one device: this long, or this share of its time.
constexpr double kTrialSeconds = 1, kTrialShare = 1.0 / 64;

class ParallelRender {
public:
    ParallelRender(const Scene& scene, const ParallelRequest& request, Ranks& ranks)
        : scene_(scene), request_(request), ranks_(ranks), settings_(request.settings), state_(request.state_path) {
        host_.emplace(scene);
    }

    ParallelResult run() {
        identity_ = identity();
        restore();
        choose();
        gather();
        if (!interrupted_) begin_iterations();
        start_ = Clock::now();
        saved_ = start_;
        try {
            if (ranges_.size == 0) find_range_size();
            if (!interrupted_) render();
        } catch (const Error& fault) {
            if (fault.code == ExitCode::device) save_after_fault(fault);
            throw;
        }
        return end();
    }

private:
    /// A rank with its devices.
    struct Party {
        int rank = 0;
        size_t first_device = 0;  ///< its number among those of all ranks
        std::string host;
        std::vector<DeviceWork> devices;
        uint64_t open = 0;     ///< nodes that it has not rendered
        size_t wanted = 0;     ///< ranges that it could begin
        double per_range = 0;  ///< seconds of one of its devices, as last measured; 0: unknown
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
        if (!state_.exists()) {
            if (request_.resume) log_info(fmt::format("{} is not there: the render begins anew", state_.path()));
            return;
        }
        if (!request_.resume)
            throw Error(ExitCode::usage, fmt::format("{} holds a render that was stopped: go on with it with --resume, "
                                                     "or remove the file",
                                                     state_.path()));
        const nlohmann::json notes = state_.read(tree_, kept_);
        if (notes.is_null()) return;
        state_.check_same(notes, identity_, request_.range_size);
        ranges_.size = notes.at("range_size");
        earlier_ = restore_stats(notes.at("stats"));
        earlier_seconds_ = notes.at("seconds");
        log_info(fmt::format("{}: {} samples per pixel were rendered earlier", state_.path(), tree_.samples()));
    }

    /// bdpt.auto chooses once, for all.
    void choose() {
        selection_ = earlier_.selection;
        if (settings_.automatic && selection_.name.empty()) {
            RenderSettings probe = settings_;
            const Device device = choose_devices(request_.devices, settings_, ranks_)[0];
            probe.backend = device.cuda >= 0 ? Backend::cuda : Backend::cpu;
            SharedAccels accels(scene_, *host_);
            selection_ = make_renderer(scene_, probe, accels)->stats().selection;
            earlier_seconds_ += selection_.seconds;
        }
        end_selection(settings_);
        for (const auto& [key, value] : selection_.settings) apply_setting(settings_, key, value);
        settings_.expected_samples = ranges_.size;  // each range by itself
    }

    /// Until all ranks have their renderers: the clock of a budget starts then.
    void gather() {
        for (int rank = 1; rank < ranks_.size(); ++rank)
            tell(ranks_, rank, Say::setup,
                 {{"scene_hash", identity_["scene_hash"]},
                  {"expected_samples", settings_.expected_samples},
                  {"selection", selection_.settings}});
        crew_.emplace(scene_, settings_, choose_devices(request_.devices, settings_, ranks_), *host_);
        host_.reset();
        parties_.resize(size_t(ranks_.size()));
        parties_[0].host = host_name();
        parties_[0].devices = crew_->work();
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
            Party& party = parties_[size_t(told->from)];
            party.rank = told->from;
            party.host = told->text.at("host");
            party.devices = restore_work(told->text.at("devices"));
            party.wanted = party.devices.size();
            ++ready;
        }
    }

    /// What follows from the method: whole iterations, and what each device keeps.
    void begin_iterations() {
        const uint32_t k = crew_->iteration_samples();
        const RenderSettings method = parties_[0].devices[0].stats.settings;
        check_iterations("spp", request_.budget.samples, k, method);
        check_iterations("range-size", request_.range_size, k, method);
        if (tree_.samples() == 0) ranges_.size = (ranges_.size + k - 1) / k * k;
        size_t devices = 0;
        for (Party& p : parties_) p.first_device = std::exchange(devices, devices + p.devices.size());
        if (crew_->state_kind() != StateKind::per_device) return;
        if (tree_.samples()) check_devices(kept_, devices, state_.path());
        kept_.resize(devices);
        for (const Party& p : parties_) {
            std::vector<RangeState> own;
            for (size_t d = 0; d < p.devices.size(); ++d) {
                const std::vector<std::byte>& state = kept_[p.first_device + d];
                own.push_back({d, 0, state});
            }
            if (p.rank == 0)
                crew_->load(std::move(own));
            else
                tell(ranks_, p.rank, Say::states, {}, nullptr, own);
        }
        log_ = StateLog(std::move(kept_));
    }

    double elapsed() const { return earlier_seconds_ + seconds_since(start_); }

    void find_range_size() {
        const double seconds = std::min(kTrialSeconds, kTrialShare * request_.budget.seconds);
        ++parties_[0].open;
        crew_->give({{1, 0}, {}, 0, seconds});
        while (ranges_.size == 0 && !interrupted_) {
            for (Finished& f : crew_->take(kPatience)) {
                ranges_.size = f.order.ranges.size;
                rendered(parties_[0], f.order.node, f.seconds, crew_->work());
                log_.add(0, crew_->take_states());
                arrived(f.order.node, std::move(f.film));
            }
            interrupted_ = is_set(request_.interrupt);
        }
    }

    /// Ranges a second of all together, those that are not known yet as fast as the mean.
    double rate() const {
        double sum = 0;
        size_t known = 0, all = 0;
        for (const Party& p : parties_) {
            all += p.devices.size();
            if (p.per_range <= 0) continue;
            sum += double(p.devices.size()) / p.per_range;
            known += p.devices.size();
        }
        return known ? sum * double(all) / double(known) : 0;
    }

    /// Gives a party what it could begin; what it does not get it will not get later either.
    void deal(Dealer& dealer, Party& party) {
        std::vector<Order> orders;
        for (size_t given = 0; given < party.wanted;) {
            const auto node = dealer.next(elapsed(), party.per_range, rate(), party.devices.size());
            if (!node) break;
            const double left = request_.budget.seconds > 0 ? request_.budget.seconds - elapsed() : 0;
            const int collector = collector_of(dealer.block(), *node, ranks_.size());
            orders.push_back({ranges_, *node, left, 0, dealer.block(), collector});
            given += node->end() - node->first();
            if (collector) collected_later_ += node->end() - node->first();
        }
        party.wanted = 0;
        party.open += orders.size();
        for (const Order& order : orders) {
            if (party.rank == 0)
                crew_->give(order);
            else
                tell(ranks_, party.rank, Say::order, order_text(order, &order == &orders.back()));
        }
    }

    void render() {
        // Without blocks films come soon, and few states wait for them.
        const bool keeps = crew_->state_kind() == StateKind::per_device;
        const unsigned some = request_.block_nodes ? request_.block_nodes : default_block_nodes(ranks_.size());
        const unsigned nodes = keeps ? 1 : some;
        Dealer dealer(ranges_, request_.budget.seconds, tree_, nodes);
        bool last = false;
        for (;;) {
            parties_[0].wanted = crew_->wanted();
            bool working = false;
            for (Party& party : parties_) {
                deal(dealer, party);
                working |= party.open > 0;
            }
            if (!working && collected_later_ == 0) return;
            if (!working && !std::exchange(last, true)) want_collected(true);
            take();
            dealer.set_node_seconds(Dealer::node_seconds(parties_.size(), nodes, film_seconds()));
            if (is_set(request_.interrupt)) {
                interrupted_ = true;
                return;
            }
            checkpoint();
        }
    }

    /// What was finished half an interval before is in a state, be its block whole or not.
    void checkpoint() {
        const double since = seconds_since(saved_);
        if (since >= 0.5 * request_.checkpoint_seconds && !wanted_collected_ && collected_later_ > 0)
            want_collected(false);
        if (since < request_.checkpoint_seconds) return;
        save();
        saved_ = Clock::now();
        wanted_collected_ = false;
    }

    void want_collected(bool last) {
        wanted_collected_ = true;
        for (int rank = 1; rank < ranks_.size(); ++rank) tell(ranks_, rank, Say::hand_over, {{"last", last}});
    }

    /// That a film costs this thread.
    double film_seconds() const { return films_ ? (merge_seconds_ + receive_seconds_) / double(films_) : 0; }

    std::optional<Told> hear_timed() {
        const auto start = Clock::now();
        std::optional<Told> told = hear(ranks_, &memory_);
        if (told) receive_seconds_ += seconds_since(start);
        return told;
    }

    void take() {
        std::vector<Finished> all = crew_->take(ranks_.size() > 1 ? kPollSeconds : kPatience);
        log_.add(0, crew_->take_states());
        for (Finished& f : all) {
            rendered(parties_[0], f.order.node, f.seconds, crew_->work());
            if (f.order.collector)
                tell_part(ranks_, f);
            else
                arrived(f.order.node, std::move(f.film));
        }
        while (std::optional<Told> told = hear_timed()) {
            const nlohmann::json& t = told->text;
            Party& party = parties_[size_t(told->from)];
            if (told->kind == Say::wanted) {
                party.wanted = t.at("ranges");
                continue;
            }
            log_.add(party.first_device, std::move(told->states));
            const RangeNode node = read_node(t.at("node"));
            if (told->kind == Say::collected)
                collected_later_ -= node.end() - node.first();
            else
                rendered(party, node, t.at("seconds"), restore_work(t.at("devices")));
            if (told->film.samples) arrived(node, std::move(told->film));
        }
        log_.saved(tree_);  // forgets older ones
    }

    void rendered(Party& party, RangeNode node, double seconds, std::vector<DeviceWork> devices) const {
        --party.open;
        party.per_range = seconds / double(std::min(node.end(), ranges_.count()) - node.first());
        party.devices = std::move(devices);
    }

    void arrived(RangeNode node, FilmMoments film) {
        ++films_;
        const auto start = Clock::now();
        tree_.add(node, std::move(film));
        if (memory_.empty() && ranks_.size() > 1) memory_ = memory_of(tree_.take_spare());
        merge_seconds_ += seconds_since(start);
        if (request_.on_progress) request_.on_progress(position(), total());
    }

    RenderPosition position() const { return {tree_.samples(), elapsed(), interrupted_}; }

    /// Of all devices, and of what an earlier part did.
    RenderStats total() const {
        std::vector<std::pair<std::string, RenderStats>> devices;
        for (const Party& p : parties_)
            for (const DeviceWork& d : p.devices) devices.emplace_back(p.host, d.stats);
        RenderStats sum = sum_of_devices(earlier_, devices, ranks_.size() > 1);
        sum.selection = selection_;
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

    void save() { state_.write(tree_, notes(), log_.saved(tree_)); }

    /// A device failed, which ends the render: whole nodes are saved, and the message says so.
    void save_after_fault(const Error& fault) {
        if (tree_.samples() == 0) return;
        save();
        state_.wait();
        throw Error(fault.code,
                    fmt::format("{}. {} samples per pixel are in {}; the same command with --resume goes on",
                                fault.what(), tree_.samples(), state_.path()));
    }

    ParallelResult end() {
        ParallelResult result;
        result.position = position();
        result.stats = total();
        if (interrupted_ && tree_.samples()) {
            save();
            state_.wait();
            result.state_path = state_.path();
        }
        for (int rank = 1; rank < ranks_.size(); ++rank) tell(ranks_, rank, Say::stop, {});
        crew_.reset();
        result.film = tree_.sum();
        result.ranges = ranges_;
        for (const Party& p : parties_)
            for (const DeviceWork& d : p.devices)
                result.workers.push_back({p.rank, p.host, d.stats.device, d.samples, d.ranges, d.seconds});
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
    DeviceStates kept_;  ///< by an earlier part
    StateLog log_;
    RenderStats earlier_;
    double earlier_seconds_ = 0, merge_seconds_ = 0, receive_seconds_ = 0;
    uint64_t films_ = 0;            ///< that came here
    uint64_t collected_later_ = 0;  ///< ranges whose films other ranks add up before they come here
    bool wanted_collected_ = false;
    Arrays memory_;  ///< for the next film
    SelectionStats selection_;
    std::optional<SharedAccels> host_;  ///< of all devices here, until they have made what they need of it
    std::optional<Crew> crew_;
    std::vector<Party> parties_;  ///< by rank
    Clock::time_point start_, saved_;
    bool interrupted_ = false;
};

}  // namespace

ParallelResult render_parallel(const Scene& scene, const ParallelRequest& request, Ranks& ranks) {
    return ParallelRender(scene, request, ranks).run();
}

}  // namespace ambilux
