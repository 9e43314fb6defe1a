// A render that remembers where stages dropped values, on either backend without a word of device code: the counters
// tell it batch by batch, and a batch that is rendered again sample by sample tells the rest.
#pragma once

#include "render/renderer.h"

namespace ambilux {

/// Samples of all pixels, `first` to `first + count`, in which stages dropped values.
struct InvalidBatch {
    uint32_t first = 0, count = 0;
    std::map<std::string, InvalidCounts> by_stage;
};

class InvalidWatch final : public Renderer {
public:
    static constexpr size_t kMostBatches = 8;  ///< that batches() remembers, the first ones

    explicit InvalidWatch(std::unique_ptr<Renderer> renderer) : renderer_(std::move(renderer)) {}

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt = nullptr) override;
    FilmMoments film() override { return renderer_->film(); }
    void clear_film() override { renderer_->clear_film(); }
    std::function<FilmMoments()> take_film() override { return renderer_->take_film(); }
    std::optional<DeviceImage> device_image() override { return renderer_->device_image(); }
    uint32_t ready() const override { return renderer_->ready(); }
    RenderStats stats() override { return renderer_->stats(); }
    std::vector<StrategyImage> strategy_images() override { return renderer_->strategy_images(); }
    StateKind state_kind() const override { return renderer_->state_kind(); }
    std::vector<std::byte> save_state() override { return renderer_->save_state(); }
    void load_state(std::span<const std::byte> saved) override { renderer_->load_state(saved); }
    uint32_t iteration_samples() const override { return renderer_->iteration_samples(); }
    uint32_t preferred_batch() const override { return renderer_->preferred_batch(); }

    const std::vector<InvalidBatch>& batches() const { return batches_; }
    /// What all samples dropped that were rendered.
    const std::map<std::string, InvalidCounts>& by_stage() const { return counted_; }
    /// The iterations of a batch (most methods: samples) that drop values, each as a batch of its own, by rendering
    /// them again: at most `most`, the first ones. The film is of no use any more.
    std::vector<InvalidBatch> samples(const InvalidBatch& batch, size_t most, const volatile bool* interrupt);

private:
    /// Drops since the last call.
    std::map<std::string, InvalidCounts> news();

    std::unique_ptr<Renderer> renderer_;
    std::map<std::string, InvalidCounts> counted_;
    std::vector<InvalidBatch> batches_;
};

}  // namespace ambilux
