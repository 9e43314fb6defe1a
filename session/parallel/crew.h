// The devices of one process, each with a renderer and a thread of its own. Nodes of the tree over ranges are given to
// all of them together: each device takes the next range, and one film comes of a node.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

#include "accel/shared_accels.h"
#include "render/renderer.h"
#include "session/parallel/ranges.h"

namespace ambilux {

/// What a crew is told to render.
struct Order {
    Ranges ranges;
    RangeNode node;
    double seconds_left = 0;  ///< from now on, of a budget in time; 0: none
    /// Instead of the node: samples from 0 on by the first device until these seconds are over. Their number becomes
    /// the size of ranges.
    double trial_seconds = 0;
    RangeNode block = {};  ///< that the node is part of
    int collector = 0;     ///< the rank that its film is for
};

/// What it rendered.
struct Finished {
    Order order;
    FilmMoments film;
    double seconds = 0;  ///< of all devices together
};

/// What a device keeps (Renderer::save_state) after a range.
struct RangeState {
    size_t device = 0;  ///< of its crew
    uint64_t range = 0;
    std::vector<std::byte> state;
};

/// A device as --devices names it: the number of a CUDA device, or "cpu".
struct Device {
    int cuda = -1;  ///< -1: the CPU
    std::string name() const { return cuda < 0 ? "cpu" : std::to_string(cuda); }
};

/// What a device has done so far.
struct DeviceWork {
    uint64_t samples = 0, ranges = 0;
    double seconds = 0;  ///< that it was busy
    RenderStats stats;
};

class Crew {
public:
    /// Makes a renderer for each device, all at the same time, with what `host` has for all of them. Throws what one of
    /// them throws.
    Crew(const Scene& scene, const RenderSettings& settings, const std::vector<Device>& devices, SharedAccels& host);
    /// Gives up what is being rendered.
    ~Crew();

    size_t size() const { return workers_.size(); }
    /// Of the renderers' method.
    StateKind state_kind() const { return state_kind_; }
    uint32_t iteration_samples() const { return iteration_samples_; }
    /// Before the first order: what devices keep from an earlier part of the render.
    void load(std::vector<RangeState> states);
    void give(const Order& order);
    /// Ranges that its devices could begin now, beside those that it was given.
    size_t wanted() const;
    /// Nodes that were finished meanwhile; waits up to `seconds` for a film of any device. Throws what a device threw,
    /// after what was finished before.
    std::vector<Finished> take(double seconds);
    /// Of methods that keep a state per device: after each range whose film was taken since, in the order of each
    /// device.
    std::vector<RangeState> take_states() { return std::exchange(states_, {}); }
    /// Of each device.
    std::vector<DeviceWork> work() const;

private:
    using Clock = std::chrono::steady_clock;

    /// An order in work.
    struct Open {
        Order order;
        Clock::time_point deadline;
        uint64_t next = 0, end = 0;  ///< ranges that no device has begun
        uint64_t missing = 0;        ///< ranges whose films are not added up
        double seconds = 0;
        MergeTree films;  ///< of the thread that takes
    };
    struct Worker {
        Device device;
        DeviceWork work;
        bool ready = false, busy = false;
        int waiting = 0;               ///< its films that are not taken yet
        std::vector<std::byte> state;  ///< of an earlier part, before its first range
        std::thread thread;
    };
    struct Task {
        std::shared_ptr<Open> node;
        uint64_t range = 0;
    };
    /// A range that was rendered: the device goes on while its film is added up.
    struct Piece {
        Task task;
        size_t worker = 0;
        FilmMoments film;
        double seconds = 0;
        std::vector<std::byte> state;  ///< of methods that keep one per device
    };

    void run(size_t index, const Scene& scene, RenderSettings settings, SharedAccels& host);
    bool next_task(size_t index, Task& task);
    bool is_too_slow(size_t index, const Open& node) const;
    std::optional<Piece> render(size_t index, Renderer& renderer, const Task& task);
    void post(Piece piece, RenderStats stats);
    void failed(std::exception_ptr error);

    std::vector<std::unique_ptr<Worker>> workers_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::shared_ptr<Open>> open_;  ///< with ranges that no device has begun
    std::deque<Piece> pieces_;
    std::vector<RangeState> states_;  ///< of the thread that takes
    StateKind state_kind_ = StateKind::none;
    uint32_t iteration_samples_ = 1;
    std::exception_ptr error_;
    bool failed_ = false;  ///< take() has seen it
    volatile bool stop_ = false;
};

}  // namespace ambilux
