#include "render/wave_plan.h"

#include <fmt/format.h>

#include "core/error.h"
#include "integrators/parse_value.h"

namespace ambilux {

uint32_t largest_that_fits(uint32_t least, uint32_t most, const std::function<bool(uint32_t)>& fits) {
    if (most >= least && fits(most)) return most;
    if (most <= least || !fits(least)) return 0;
    uint32_t lower = least, upper = most;  // the first fits, the second does not
    while (upper - lower > 1) {
        const uint32_t middle = lower + (upper - lower) / 2;
        (fits(middle) ? lower : upper) = middle;
    }
    return lower;
}

void refuse_budget(const RenderSettings& settings, const RenderBytes& least) {
    // Rounded up, so that what is named works.
    const auto mib = [](uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; };
    const bool texels = settings.textures == TextureMemory::device && least.scene.textures > 0;
    throw Error(ExitCode::device,
                fmt::format("memory={}: this render needs at least {}M: {} of geometry, {} of textures, {} of "
                            "acceleration structure, {} of the rest of the scene, {} of film, {} of waves{}. Give it "
                            "more memory, or a smaller --size{}",
                            text_of_bytes(settings.memory), mib(least.total()), mib(least.scene.geometry),
                            mib(least.scene.textures), mib(least.accel), mib(least.scene.rest), mib(least.film),
                            mib(least.waves), settings.wave_size ? fmt::format(" of {} paths", settings.wave_size) : "",
                            texels ? ", or, on a CUDA device, --textures host" : ""));
}

}  // namespace ambilux
