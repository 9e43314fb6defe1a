// What a render on a device has finished, kept on the host against faults of the device.
#pragma once

#include <chrono>

#include "render/renderer.h"

namespace ambilux {

class KeptFilm {
public:
    /// `renderer` must outlive this object.
    explicit KeptFilm(Renderer& renderer) : renderer_(renderer), copied_(Clock::now()) {}

    /// After each batch, with the renderer's statistics: copies the film as often as takes a thousandth of the time.
    void look(const RenderStats& stats);

    struct Finished {
        FilmMoments film;
        RenderStats stats;
    };
    /// After a fault: what the device still gives, or else the last copy; without samples if there is none.
    Finished last();

private:
    using Clock = std::chrono::steady_clock;

    Renderer& renderer_;
    Finished kept_;
    Clock::time_point copied_;
    Clock::duration cost_{};
};

}  // namespace ambilux
