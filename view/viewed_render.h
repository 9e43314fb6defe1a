// A render that goes on while it is looked at, and begins anew when camera or method change.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "film/image.h"
#include "render/shared_renderer.h"
#include "scene/scene.h"
#include "view/camera.h"

namespace ambilux {

/// A picture as it is shown, and what is known of it.
struct Picture {
    uint64_t number = 0;
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> rgba;  ///< sRGB, row-major from the top left
    nlohmann::json facts;
};
using SharedPicture = std::shared_ptr<const Picture>;

struct ViewOptions {
    std::optional<Reference> reference;  ///< of the scene as its file has it
    uint64_t most_samples = 1 << 16;     ///< per pixel, after which it waits for changes
};

class ViewedRender {
public:
    /// Throws what making the first renderer throws.
    ViewedRender(Scene scene, const RenderSettings& settings, ViewOptions options);
    ~ViewedRender();
    ViewedRender(const ViewedRender&) = delete;
    ViewedRender& operator=(const ViewedRender&) = delete;

    /// The scene's camera and size, and the methods that there are.
    nlohmann::json description() const;
    /// `moving`: more pictures a second matter more than their size. Throws Error(usage).
    void look(const LookAt& look, bool moving);
    /// Back to the camera of the file.
    void reset_camera();
    /// Values of settings in place of those that it began with. Throws Error(usage).
    void choose(const std::vector<std::pair<std::string, std::string>>& assignments);
    void expose(float stops);
    /// A frame newer than `after`, or null after `patience`.
    SharedPicture wait(uint64_t after, std::chrono::milliseconds patience);

private:
    struct Wish {
        RenderSettings settings;
        std::optional<LookAt> look;  ///< none: the file's camera
        bool moving = false;
        float stops = 0;
    };

    void work();
    void ask(const std::function<void(Wish&)>& change, bool restart);
    void restart(const Wish& wish);
    void render_some();
    void publish(const Wish& wish);
    uint32_t divisor(const Wish& wish) const;
    nlohmann::json facts(const FilmMoments& film, const Wish& wish);

    // The worker's own.
    Scene scene_;
    const Sensor sensor_;
    const RenderSettings first_;
    const ViewOptions options_;
    SharedAccels accels_;
    std::unique_ptr<Renderer> renderer_;
    RenderSettings shown_;
    uint32_t samples_ = 0;
    double whole_seconds_ = 0;  ///< a sample of every pixel of the whole picture, as last measured
    std::string problem_;
    std::chrono::steady_clock::time_point published_, compared_;
    double frames_per_second_ = 0;
    nlohmann::json error_;

    std::mutex mutex_;
    std::condition_variable wished_, shown_now_;
    Wish wish_;
    bool anew_ = false, repaint_ = false, ends_ = false;
    volatile bool interrupt_ = false;
    SharedPicture frame_;
    std::thread worker_;
};

}  // namespace ambilux
