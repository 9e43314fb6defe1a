// Replayed paths that follow the trees of a guided method.
#pragma once

#include "integrators/shared/guide/directions.h"
#include "render/replay/context.h"
#include "render/replay/kept_guide.h"

namespace ambilux {

/// `ctx` with paths that follow the trees of a sample.
template <class Mis>
std::shared_ptr<const ReplayContext<Mis>> guided_context(const ReplayContext<Mis>& ctx, const ReplayedGuide& guide,
                                                         uint32_t sample) {
    struct Whole {
        std::shared_ptr<const KeptGuide> kept;
        ReplayContext<Mis> ctx;
    };
    const auto whole = std::make_shared<Whole>(Whole{guide.at(sample), ctx});
    whole->ctx.rules.mis.trees = followed<Mis::kBidirectional>(whole->kept->state, guide.settings());
    whole->ctx.rules.directions = {whole->ctx.rules.mis.trees, guide.settings().roulette};
    return {whole, &whole->ctx};
}
/// What the camera ray of a sample knows of its pixel (ReplayJoins::start).
template <class Mis>
auto guided_start(const ReplayContext<Mis>& ctx, const ReplayedGuide& guide, const ReplayRequest& request) {
    const uint32_t across = (ctx.view.sensor.crop_width + kTileSide - 1) / kTileSide,
                   tile = request.y / kTileSide * across + request.x / kTileSide;
    const float over_pixel = guide.at(request.sample)->state.eye.over_pixel[tile];
    return [over_pixel](Subpath<Mis>& path) { path.sums.over_pixel = over_pixel; };
}

}  // namespace ambilux
