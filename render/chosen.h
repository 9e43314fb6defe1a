// The renderer that bdpt.auto chose.
#pragma once

#include <memory>
#include <utility>

#include "render/renderer.h"

namespace ambilux {

/// A renderer that also tells how it was chosen. `ready`: samples that are in its film.
class Chosen final : public Renderer {
public:
    Chosen(std::unique_ptr<Renderer> renderer, uint32_t ready, SelectionStats selection)
        : renderer_(std::move(renderer)), ready_(ready), selection_(std::move(selection)) {}

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        if (first != 0 || count < ready_) drop();
        const uint32_t done = ready_;
        ready_ = 0;
        return done == count ? done : done + renderer_->render(first + done, count - done, interrupt);
    }
    FilmMoments film() override {
        drop();
        return renderer_->film();
    }
    void clear_film() override {
        ready_ = 0;
        renderer_->clear_film();
    }
    std::function<FilmMoments()> take_film() override { return drop(), renderer_->take_film(); }
    std::optional<DeviceImage> device_image() override { return drop(), renderer_->device_image(); }
    ByteImage picture(float stops) override { return drop(), renderer_->picture(stops); }
    void give_up_when(const volatile bool* flag) override { renderer_->give_up_when(flag); }
    uint32_t ready() const override { return ready_; }
    RenderStats stats() override {
        RenderStats s = renderer_->stats();
        s.selection = selection_;
        return s;
    }
    std::vector<StrategyImage> strategy_images() override { return renderer_->strategy_images(); }
    StateKind state_kind() const override { return renderer_->state_kind(); }
    std::vector<std::byte> save_state() override { return renderer_->save_state(); }
    void load_state(std::span<const std::byte> saved) override { drop(), renderer_->load_state(saved); }
    uint32_t iteration_samples() const override { return renderer_->iteration_samples(); }
    uint32_t preferred_batch() const override { return renderer_->preferred_batch(); }

private:
    void drop() {
        if (ready_ > 0) clear_film();
    }

    std::unique_ptr<Renderer> renderer_;
    uint32_t ready_;
    SelectionStats selection_;
};

}  // namespace ambilux
