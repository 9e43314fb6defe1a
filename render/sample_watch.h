// A render that is looked at sample by sample: which sample of a pixel was its largest. On either backend without a
// word of device code, since a film of one sample tells all.
#pragma once

#include "render/renderer.h"

namespace ambilux {

/// The largest sample of a pixel.
struct WatchedPixel {
    uint32_t x = 0, y = 0, sample = 0;
    double value[3] = {};
    double excess = 0;  ///< by which its largest channel exceeds the mean of the pixel's other samples; that value if
                        ///< there are none
};

/// Renders one sample of all pixels at a time and adds up the films on the host, in the same order: the image is that
/// of the renderer, unless its waves hold several samples that depend on each other (variant lvc on CUDA). Costs
/// about 130 bytes per pixel and, on CUDA, a transfer of the film per sample.
class SampleWatch final : public Renderer {
public:
    explicit SampleWatch(std::unique_ptr<Renderer> renderer) : renderer_(std::move(renderer)) {}

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt = nullptr) override;
    FilmMoments film() override { return film_; }
    void clear_film() override;
    RenderStats stats() override { return renderer_->stats(); }
    std::vector<StrategyImage> strategy_images() override { return renderer_->strategy_images(); }
    StateKind state_kind() const override { return renderer_->state_kind(); }
    std::vector<std::byte> save_state() override { return renderer_->save_state(); }
    void load_state(std::span<const std::byte> saved) override { renderer_->load_state(saved); }
    uint32_t iteration_samples() const override { return renderer_->iteration_samples(); }
    uint32_t preferred_batch() const override { return renderer_->preferred_batch(); }

    /// The `count` pixels whose largest sample exceeds the mean of the others most, the worst first.
    std::vector<WatchedPixel> worst(uint32_t count) const;

private:
    struct Largest {
        double value[3] = {};
        uint32_t sample = 0;
    };

    void look(uint32_t sample, const FilmMoments& one);

    std::unique_ptr<Renderer> renderer_;
    FilmMoments film_;
    std::vector<Largest> largest_;
};

}  // namespace ambilux
