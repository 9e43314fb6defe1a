// As many samples as a comparison needs, and no more.
#pragma once

#include <algorithm>
#include <cmath>

#include "tests/support/injected_bias.h"
#include "tests/support/render_scene.h"

namespace ambilux {

/// An image almost without variance, whose few random events are too few to be tested, may be off by this from one that
/// is known.
constexpr double kNoVariance = 1e-3;

/// `few` samples, and as many again until a difference of `sees` from `truth` is noticed, at most `most`. The error
/// says when to stop. The mean does so for images almost without variance alone, and after the first `few`: whoever may
/// stop whenever it is near passes sooner or later. `image(done, n)`: the estimate of all samples once n are added to
/// those done.
template <class Image>
Estimate until_seen(uint32_t few, uint32_t most, const Estimate& truth, double sees, const ZTestOptions& options,
                    Image image) {
    for (uint32_t done = 0, n = few;; n = std::min(done, most - done)) {
        const Estimate so_far = image(done, n);
        done += n;
        const ZTestResult z = z_test(so_far, truth, options);
        const bool enough = z.undecided
                                ? done == few && truth.samples == 0 && std::abs(z.relative_difference) < kNoVariance
                                : z.detectable < sees && sees_bias(so_far, truth, sees, options);
        if (enough || done >= most) return so_far;
    }
}

/// The same of a render whose pixels are independent, from a quarter of `most` on: fewer miss what is rare.
inline Estimate render_until_seen(const Scene& scene, const RenderSettings& settings, uint32_t most,
                                  const Estimate& truth, double sees, const ZTestOptions& options = {}) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    const Estimate result =
        until_seen(std::max(most / 4, 16u), most, truth, sees, options, [&](uint32_t done, uint32_t n) {
            REQUIRE(renderer->render(done, n) == n);
            return to_estimate(renderer->film());
        });
    CHECK(renderer->stats().invalid.total() == 0);
    return result;
}

}  // namespace ambilux
