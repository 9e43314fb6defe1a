// The devices of one process, each with a renderer and a thread of its own.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

#include "experiments/parallel/ranges.h"
#include "render/renderer.h"

namespace ambilux {

/// What a worker is told to render.
struct Order {
    Ranges ranges;
    RangeNode node;
    /// Instead: samples from 0 on until these seconds are over. Their number becomes the size of ranges.
    double trial_seconds = 0;
};

/// What it rendered.
struct Finished {
    size_t worker = 0;
    Order order;
    FilmMoments film;
    double seconds = 0;
};

/// A device as --devices names it: the number of a CUDA device, or "cpu".
struct Device {
    int cuda = -1;  ///< -1: the CPU
    std::string name() const { return cuda < 0 ? "cpu" : std::to_string(cuda); }
};

class Crew {
public:
    /// Makes a renderer for each device, all at the same time. Throws what one of them throws.
    Crew(const Scene& scene, const RenderSettings& settings, const std::vector<Device>& devices);
    /// Gives up what is being rendered.
    ~Crew();

    size_t size() const { return workers_.size(); }
    /// To a worker that has nothing to do.
    void give(size_t worker, const Order& order);
    /// What was finished meanwhile; waits for it up to `seconds`. Throws what a worker threw.
    std::vector<Finished> take(double seconds);
    /// Of all that it has done.
    RenderStats stats(size_t worker) const {
        const std::lock_guard lock(mutex_);
        return workers_[worker]->stats;
    }

private:
    struct Worker {
        Device device;
        RenderStats stats;
        bool ready = false;
        std::optional<Order> order;
        int waiting = 0;     ///< its films that are not taken yet
        MergeTree ranges;    ///< of the node in work; of the thread that takes, as the next
        double seconds = 0;  ///< that it took
        std::thread thread;
    };
    /// A range that was rendered: the device goes on while its film is added up.
    struct Piece {
        Finished finished;
        uint64_t range = 0;
        bool last = false;  ///< of the node
    };

    void work(size_t index, const Scene& scene, RenderSettings settings);
    bool render(size_t index, Renderer& renderer, const Order& order);
    void post(size_t index, Piece piece, RenderStats stats);

    std::vector<std::unique_ptr<Worker>> workers_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Piece> pieces_;
    std::exception_ptr error_;
    volatile bool stop_ = false;
};

}  // namespace ambilux
