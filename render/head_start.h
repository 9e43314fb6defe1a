// What a device does while the host runs the pilot of bdpt.auto=true.
#pragma once

#include <algorithm>
#include <exception>
#include <memory>
#include <thread>

#include "core/flag.h"
#include "core/seconds.h"
#include "render/selection.h"

namespace ambilux {

/// The path tracer of a device, which has nothing else to do while the host runs the pilot. Its samples are those that
/// the render begins with if it is chosen: the pilot, on which that depends, has random numbers of its own. Otherwise
/// they are dropped. For renders that end by the clock: others gain nothing.
class HeadStart {
public:
    HeadStart(const RenderSettings& settings, const MakeRenderer& make)
        : thread_([this, settings, &make] {
              try {
                  const auto start = Clock::now();
                  renderer_ = make(settings);
                  build_seconds_ = seconds_since(start);
                  run();
              } catch (const std::exception&) {
                  samples_ = 0;
                  renderer_.reset();  // it is tried again, and complains, if it is chosen
              }
          }) {}
    ~HeadStart() { stop(); }

    void stop() {
        set_flag(&stop_);
        if (thread_.joinable()) thread_.join();
    }
    uint32_t samples() const { return samples_; }
    double build_seconds() const { return build_seconds_; }
    /// Of every pixel, while there was nothing else to do; 0: unknown.
    double seconds_per_sample() const { return seconds_per_sample_; }
    std::unique_ptr<Renderer> take() { return std::move(renderer_); }

private:
    void run() {
        constexpr double kBatchSeconds = 0.008;  // which the host may have to wait for
        for (uint32_t batch = 1; samples_ == 0 || !is_set(&stop_);) {
            const auto start = Clock::now();
            samples_ += renderer_->render(samples_, batch);
            const double seconds = seconds_since(start);
            if (seconds > 0.5 * kBatchSeconds && samples_ > batch)
                seconds_per_sample_ = seconds / batch;  // the first bears what later ones do not
            batch = std::clamp(uint32_t(kBatchSeconds / seconds * batch), 1u, 4 * batch);
        }
    }

    volatile bool stop_ = false;
    uint32_t samples_ = 0;
    double build_seconds_ = 0, seconds_per_sample_ = 0;
    std::unique_ptr<Renderer> renderer_;
    std::thread thread_;
};

}  // namespace ambilux
