#include "experiments/parallel/crew.h"

#include <chrono>
#include <utility>

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
        worker.order.reset();
        lock.unlock();
        if (!render(index, *renderer, order)) return;
        lock.lock();
    }
}

/// False if it was stopped.
bool Crew::render(size_t index, Renderer& renderer, const Order& order) {
    auto start = Clock::now();
    const uint64_t end = order.trial_seconds > 0 ? 1 : std::min(order.node.end(), order.ranges.count());
    for (uint64_t range = order.node.first(); range < end; ++range) {
        Piece piece;
        piece.finished.order = order;
        piece.range = range;
        piece.last = range + 1 == end;
        renderer.clear_film();
        if (order.trial_seconds > 0) {
            piece.finished.order.ranges.size = render_for(renderer, order.trial_seconds, &stop_);
        } else {
            const uint32_t samples = order.ranges.length(range);
            if (renderer.render(order.ranges.first_sample(range), samples, &stop_) < samples) return false;
        }
        piece.finished.film = renderer.film();
        piece.finished.worker = index;
        piece.finished.seconds = seconds_since(start);
        start = Clock::now();
        post(index, std::move(piece), renderer.stats());
        if (is_set(&stop_)) return false;
    }
    return true;
}

/// Waits while two films of the worker are not added up: there would be ever more of them.
void Crew::post(size_t index, Piece piece, RenderStats stats) {
    Worker& worker = *workers_[index];
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return worker.waiting < 2 || is_set(&stop_); });
    worker.stats = std::move(stats);
    ++worker.waiting;
    pieces_.push_back(std::move(piece));
    changed_.notify_all();
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
    changed_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return error_ || !pieces_.empty(); });
    if (error_) std::rethrow_exception(error_);
    std::vector<Finished> finished;
    while (!pieces_.empty()) {
        Piece piece = std::move(pieces_.front());
        pieces_.pop_front();
        Worker& worker = *workers_[piece.finished.worker];
        --worker.waiting;
        changed_.notify_all();
        lock.unlock();
        Finished& f = piece.finished;
        worker.seconds += f.seconds;
        worker.ranges.add({0, piece.range}, std::move(f.film));
        if (piece.last) {
            f.film = worker.ranges.take_sum();
            f.seconds = std::exchange(worker.seconds, 0);
            finished.push_back(std::move(f));
        }
        lock.lock();
    }
    return finished;
}

}  // namespace ambilux
