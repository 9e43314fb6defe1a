// Which pixels and samples the waves of a device hold, and how they get smaller where memory is short.
#pragma once

#include <functional>

#include "integrators/integrator.h"
#include "render/device_wave.h"

namespace ambilux {

/// For an integrator whose light may land anywhere on the film (`film_wide`) a sample is complete when all of it is.
/// Its waves hold the whole film, or, where there is no memory for that, parts of it one after the other.
class DevicePlan {
public:
    /// `waves` is told what depends on the size of a wave, and must outlive the plan.
    DevicePlan(const Scene& scene, const RenderSettings& settings, WavePolicy& waves, bool film_wide);

    Wave wave{};       ///< in flight
    Wave film_wave{};  ///< added to the film at once
    double mean = 0;   ///< light vertices of a light subpath that queues are planned for

    bool streams() const { return waves_.slots_in_flight > 0; }
    /// A wave holds a part of the film.
    bool in_parts() const { return film_wide_ && wave.tiles < tile_count(wave); }
    /// Light subpaths of a wave from `tile` on, in one sample.
    uint32_t light_subpaths(uint32_t tile) const;
    /// Light vertices that queues have room for.
    uint32_t kept() const;
    /// A wave of this shape had so many: plans for no fewer from now on.
    void keep(uint64_t vertices);

    /// The smallest wave that may be: what was set, where it was.
    void shape_least();
    /// A wave that does well, in about `room` bytes.
    void shape_preferred(uint64_t bytes_per_path, uint64_t room);
    /// Makes the wave smaller until needed() bytes fit into `room`. A size that was set stays, but for what was added
    /// to it to have the whole film in one wave. False, with the smallest wave, if that does not fit.
    bool fit(uint64_t room, const std::function<uint64_t()>& needed);

private:
    /// A wave of `size` slots. Paths of streaming are many more than its slots, and always those of the whole film.
    void shape(uint32_t size);
    void check_numbers() const;
    uint32_t least_size() const { return settings_.wave_size ? settings_.wave_size : kTilePixels; }

    const Scene& scene_;
    const RenderSettings& settings_;
    WavePolicy& waves_;
    bool film_wide_;
    uint32_t size_ = 0;  ///< of shape()
    uint32_t light_subpaths_ = 0;
};

}  // namespace ambilux
