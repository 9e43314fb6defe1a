// Samples of a render once more, on the CPU, with all that happened on their way: a fifth sink of the same primitives.
#pragma once

#include <memory>
#include <optional>

#include "accel/shared_accels.h"
#include "integrators/settings.h"
#include "render/replay/record.h"

namespace ambilux {

struct KeptGuide;

struct ReplayRequest {
    uint32_t x = 0, y = 0;  ///< pixel of the image, from the top left
    uint32_t sample = 0;
    std::optional<uint32_t> light_subpath;  ///< is described too; eye vertices that draw are connected with it
                                            ///< instead of a cache
    bool splats = true;   ///< looks for those of all light subpaths of the sample: as many as the image has pixels
    bool details = true;  ///< vertices and densities are described
};

/// Replays samples of one render. Safe to use from many threads.
class Replay {
public:
    std::shared_ptr<const void> accel;  ///< that rays are traced through

    virtual ~Replay() = default;
    virtual ReplaySample sample(const ReplayRequest& request) const = 0;
    /// Samples of every pixel that share light subpaths: of an iteration.
    virtual uint32_t iteration_samples() const { return 1; }
    /// Light subpaths of one sample of all pixels; 0 where there are none.
    virtual uint32_t light_subpaths() const { return 0; }
    /// Numbers below light_subpaths() have gaps where there is no whole number of light subpaths per pixel.
    virtual bool has_light_subpath(uint32_t) const { return false; }
    /// What paths of this sample follow, where a method guides them; else null.
    virtual std::shared_ptr<const KeptGuide> guide(uint32_t /*sample*/) const { return nullptr; }
    /// A light subpath alone and its splats anywhere on the film. Throws Error(usage) if there is none of that number.
    virtual ReplaySubpath light_subpath(uint32_t number, uint32_t sample, bool details,
                                        std::vector<ReplayCandidate>& splats) const = 0;
};

/// Throws Error(usage) if there are no replays of renders with these settings.
void check_replay(const RenderSettings& settings);

/// For renders with these settings, bdpt.auto among them excepted. On the CPU the sample of a replay has the bits of
/// that of a render whose kernels hold all features (specialise=false), and is equal to others within rounding. Of a
/// render on CUDA (backend=cuda) rays go through the same structure, but compilers round differently. Throws
/// Error(usage) for integrators that are not known to it. The scene must outlive it.
std::unique_ptr<Replay> make_replay(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

/// The largest channel of a candidate's contribution or of a sample.
inline double largest(Rgb v) { return double(max_component(v)); }

}  // namespace ambilux
