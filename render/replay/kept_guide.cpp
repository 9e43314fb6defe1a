#include "render/replay/kept_guide.h"

namespace ambilux {

std::shared_ptr<const KeptGuide> ReplayedGuide::at(uint32_t sample) const {
    const uint32_t iteration = sample / iteration_samples();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (kept_ && last_ == iteration) return kept_;
    kept_ = made(iteration);
    last_ = iteration;
    return kept_;
}

std::shared_ptr<const KeptGuide> ReplayedGuide::made(uint32_t iteration) const {
    const uint32_t samples = iteration_samples();
    std::unique_ptr<Renderer> first;
    Renderer* from = nullptr;
    if (iteration == 0) {
        // Training is part of the first iteration: one that nothing is learned from leaves the trees that it followed.
        RenderSettings s = settings_;
        s.own["guide_until"] = "0";
        first = make_renderer(scene_, s);
        first->render(0, samples);
        from = first.get();
    } else {
        if (!renderer_ || done_ > iteration) renderer_ = make_renderer(scene_, settings_), done_ = 0;
        renderer_->render(done_ * samples, (iteration - done_) * samples);
        done_ = iteration;
        from = renderer_.get();
    }
    const auto kept = std::make_shared<KeptGuide>(policy_);
    kept->memory.allocate();
    kept->memory.load(from->save_state());
    kept->state = kept->state.around(scene_.view());
    return kept;
}

}  // namespace ambilux
