#include "experiments/parallel/crew.h"

#include <chrono>

#include "backends/cuda_device.h"
#include "core/flag.h"

namespace ambilux {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Samples from 0 on, in batches that grow, until about `seconds` are over.
uint32_t render_for(Renderer& renderer, double seconds, const volatile bool* stop) {
    const auto start = Clock::now();
    uint32_t done = 0;
    for (;;) {
        const double passed = seconds_since(start);
        if (is_set(stop) || passed >= seconds) return done;
        const double left = done ? (seconds - passed) / passed * done : 1;
        const auto count = uint32_t(std::clamp<double>(left, 1, std::max<uint32_t>(1, 4 * done)));
        done += renderer.render(done, count, stop);
    }
}

}  // namespace

Crew::Crew(const Scene& scene, const RenderSettings& settings, const std::vector<Device>& devices) {
    for (const Device& device : devices) {
        workers_.push_back(std::make_unique<Worker>());
        workers_.back()->device = device;
    }
    for (size_t i = 0; i < workers_.size(); ++i)
        workers_[i]->thread = std::thread([this, i, &scene, settings] {
            try {
                work(i, scene, settings);
            } catch (...) {
                const std::lock_guard lock(mutex_);
                if (!error_) error_ = std::current_exception();
                changed_.notify_all();
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

void Crew::work(size_t index, const Scene& scene, RenderSettings settings) {
    Worker& worker = *workers_[index];
    // Which device CUDA works on is a property of a thread.
    if (worker.device.cuda >= 0) use_cuda_device(worker.device.cuda);
    settings.backend = worker.device.cuda >= 0 ? Backend::cuda : Backend::cpu;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    std::unique_lock lock(mutex_);
    worker.stats = renderer->stats();
    worker.ready = true;
    changed_.notify_all();
    for (;;) {
        changed_.wait(lock, [&] { return worker.order || is_set(&stop_); });
        if (is_set(&stop_)) return;
        const Order order = *worker.order;
        lock.unlock();
        std::optional<Finished> finished = render(*renderer, order);
        RenderStats stats = renderer->stats();
        lock.lock();
        if (!finished) return;
        worker.stats = std::move(stats);
        worker.order.reset();
        finished->worker = index;
        finished_.push_back(std::move(*finished));
        changed_.notify_all();
    }
}

/// Nothing if it was stopped.
std::optional<Finished> Crew::render(Renderer& renderer, const Order& order) const {
    const auto start = Clock::now();
    Finished finished;
    finished.order = order;
    renderer.clear_film();
    if (order.trial_seconds > 0) {
        finished.order.ranges.size = render_for(renderer, order.trial_seconds, &stop_);
        finished.film = renderer.film();
    } else {
        MergeTree tree;
        const uint64_t first = order.node.first(), end = std::min(order.node.end(), order.ranges.count());
        for (uint64_t range = first; range < end; ++range) {
            if (range > first) renderer.clear_film();
            const uint32_t samples = order.ranges.length(range);
            if (renderer.render(order.ranges.first_sample(range), samples, &stop_) < samples) return std::nullopt;
            tree.add({0, range}, renderer.film());
        }
        finished.film = tree.sum();
    }
    if (is_set(&stop_)) return std::nullopt;
    finished.seconds = seconds_since(start);
    return finished;
}

void Crew::give(size_t worker, const Order& order) {
    {
        const std::lock_guard lock(mutex_);
        workers_[worker]->order = order;
    }
    changed_.notify_all();
}

std::vector<Finished> Crew::take(double seconds) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return error_ || !finished_.empty(); });
    if (error_) std::rethrow_exception(error_);
    std::vector<Finished> taken(std::make_move_iterator(finished_.begin()), std::make_move_iterator(finished_.end()));
    finished_.clear();
    return taken;
}

}  // namespace ambilux
