#include "session/parallel/crew.h"

#include <chrono>
#include <future>
#include <utility>

#include "backends/cuda_device.h"
#include "core/flag.h"
#include "core/seconds.h"
#include "render/shared_renderer.h"
#include "session/drive.h"

namespace ambilux {

Crew::Crew(const Scene& scene, const RenderSettings& settings, const std::vector<Device>& devices, SharedAccels& host) {
    for (const Device& device : devices) {
        workers_.push_back(std::make_unique<Worker>());
        workers_.back()->device = device;
    }
    for (size_t i = 0; i < workers_.size(); ++i)
        workers_[i]->thread = std::thread([this, i, &scene, settings, &host] {
            try {
                run(i, scene, settings, host);
            } catch (...) {
                failed(std::current_exception());
            }
        });
    std::unique_lock lock(mutex_);
    const auto all_ready = [&] {
        return std::all_of(workers_.begin(), workers_.end(), [](const auto& w) { return w->ready; });
    };
    changed_.wait(lock, [&] { return error_ || all_ready(); });
    const std::exception_ptr error = error_;
    lock.unlock();
    if (!error) return;
    set_flag(&stop_);
    changed_.notify_all();
    for (const auto& worker : workers_) worker->thread.join();
    std::rethrow_exception(error);
}

Crew::~Crew() {
    {
        const std::lock_guard lock(mutex_);
        set_flag(&stop_);
    }
    changed_.notify_all();
    for (const auto& worker : workers_) worker->thread.join();
}

void Crew::run(size_t index, const Scene& scene, RenderSettings settings, SharedAccels& host) {
    Worker& worker = *workers_[index];
    // Which device CUDA works on is a property of a thread.
    if (worker.device.cuda >= 0) use_cuda_device(worker.device.cuda);
    settings.backend = worker.device.cuda >= 0 ? Backend::cuda : Backend::cpu;
    const std::unique_ptr<Renderer> renderer = [&] {
        SharedAccels accels(scene, host);
        return make_renderer(scene, settings, accels);
    }();
    std::future<void> handing;  // over the film before; before the lock, which it needs to end
    std::unique_lock lock(mutex_);
    worker.work.stats = renderer->stats();
    state_kind_ = renderer->state_kind();
    iteration_samples_ = renderer->iteration_samples();
    worker.ready = true;
    changed_.notify_all();
    for (Task task;;) {
        changed_.wait(lock, [&] { return is_set(&stop_) || next_task(index, task); });
        if (is_set(&stop_)) return;
        worker.busy = true;
        const std::vector<std::byte> earlier = std::exchange(worker.state, {});
        lock.unlock();
        if (!earlier.empty()) renderer->load_state(earlier);
        std::optional<Piece> piece = render(index, *renderer, task);
        if (!piece) return;
        if (handing.valid()) handing.get();
        auto hand_over = [this, device = worker.device, stats = renderer->stats(), piece = std::move(*piece),
                          film = renderer->take_film()]() mutable {
            try {
                if (device.cuda >= 0) use_cuda_device(device.cuda);
                piece.film = film();
                post(std::move(piece), std::move(stats));
            } catch (...) {
                failed(std::current_exception());
            }
        };
        task = {};
        lock.lock();
        worker.busy = false;  // before its film comes: who takes that asks at once what is wanted
        handing = std::async(std::launch::async, std::move(hand_over));
    }
}

void Crew::failed(std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = error;
    changed_.notify_all();
}

/// The next range, if there is one for this worker.
bool Crew::next_task(size_t index, Task& task) {
    for (auto node = open_.begin(); node != open_.end(); ++node) {
        Open& o = **node;
        if (o.order.trial_seconds > 0 ? index != 0 : is_too_slow(index, o)) continue;
        task = {*node, o.next++};
        if (o.next == o.end) open_.erase(node);
        return true;
    }
    return false;
}

/// It would end long after the budget, and another device takes half as long for a range or less.
bool Crew::is_too_slow(size_t index, const Open& node) const {
    if (node.order.seconds_left <= 0) return false;
    const auto per_range = [](const Worker& w) { return w.work.ranges ? w.work.seconds / double(w.work.ranges) : 0.0; };
    const double own = per_range(*workers_[index]);
    return seconds_between(Clock::now(), node.deadline) < 0.5 * own &&
           std::any_of(
               workers_.begin(), workers_.end(),
               [&](const auto& w) { return per_range(*w) > 0 && per_range(*w) <= 0.5 * own; });
}

/// Without the film. Nothing if it was stopped.
std::optional<Crew::Piece> Crew::render(size_t index, Renderer& renderer, const Task& task) {
    const auto start = Clock::now();
    Order& order = task.node->order;
    if (order.trial_seconds > 0) {
        order.ranges.size = uint32_t(drive(renderer, {}, {0, order.trial_seconds}, &stop_).samples);
    } else {
        const uint32_t samples = order.ranges.length(task.range);
        if (renderer.render(order.ranges.first_sample(task.range), samples, &stop_) < samples) return {};
    }
    if (is_set(&stop_)) return {};
    const double seconds = seconds_since(start);
    const bool keeps = renderer.state_kind() == StateKind::per_device;
    return Piece{task, index, {}, seconds, keeps ? renderer.save_state() : std::vector<std::byte>()};
}

/// Waits while two films of the worker are not added up: there would be ever more of them.
void Crew::post(Piece piece, RenderStats stats) {
    Worker& worker = *workers_[piece.worker];
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return worker.waiting < 2 || is_set(&stop_); });
    worker.work.stats = std::move(stats);
    worker.work.samples += piece.film.samples;
    worker.work.seconds += piece.seconds;
    ++worker.work.ranges;
    ++worker.waiting;
    pieces_.push_back(std::move(piece));
    changed_.notify_all();
}

void Crew::load(std::vector<RangeState> states) {
    const std::lock_guard lock(mutex_);
    for (RangeState& s : states) workers_.at(s.device)->state = std::move(s.state);
}

void Crew::give(const Order& order) {
    const auto node = std::make_shared<Open>();
    node->order = order;
    node->deadline =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(order.seconds_left));
    node->next = order.node.first();
    node->end = order.trial_seconds > 0 ? node->next + 1 : std::min(order.node.end(), order.ranges.count());
    node->missing = node->end - node->next;
    {
        const std::lock_guard lock(mutex_);
        open_.push_back(node);
    }
    changed_.notify_all();
}

size_t Crew::wanted() const {
    const std::lock_guard lock(mutex_);
    uint64_t idle = 0, open = 0;
    for (const auto& worker : workers_) idle += worker->busy ? 0 : 1;
    for (const auto& node : open_) open += node->end - node->next;
    return size_t(idle > open ? idle - open : 0);
}

std::vector<Finished> Crew::take(double seconds) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return error_ || !pieces_.empty(); });
    // What was finished before a worker failed is taken first.
    if (error_ && (pieces_.empty() || std::exchange(failed_, true))) std::rethrow_exception(error_);
    std::vector<Finished> finished;
    while (!pieces_.empty()) {
        Piece piece = std::move(pieces_.front());
        pieces_.pop_front();
        --workers_[piece.worker]->waiting;
        changed_.notify_all();
        lock.unlock();
        Open& node = *piece.task.node;
        node.seconds += piece.seconds;
        if (state_kind_ == StateKind::per_device)
            states_.push_back({piece.worker, piece.task.range, std::move(piece.state)});
        node.films.add({0, piece.task.range}, std::move(piece.film));
        if (--node.missing == 0) finished.push_back({node.order, node.films.take_sum(), node.seconds});
        lock.lock();
    }
    return finished;
}

std::vector<DeviceWork> Crew::work() const {
    const std::lock_guard lock(mutex_);
    std::vector<DeviceWork> all;
    for (const auto& worker : workers_) all.push_back(worker->work);
    return all;
}

}  // namespace ambilux
