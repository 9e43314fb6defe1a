// A render that goes on while it is looked at, and begins anew when camera or method change.
#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <future>
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
    ByteImage image;
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
    /// Each of these returns the number of what is asked for; pictures that show it have facts["asked"] of at least
    /// that. `moving`: more pictures a second matter more than their size. Throws Error(usage).
    uint64_t look(const LookAt& look, bool moving);
    /// Back to the camera of the file.
    uint64_t reset_camera();
    /// Values of settings in place of those that it began with. Throws Error(usage).
    uint64_t choose(const std::vector<std::pair<std::string, std::string>>& assignments);
    uint64_t expose(float stops);
    /// A frame newer than `after`, or null after `patience`.
    SharedPicture wait(uint64_t after, std::chrono::milliseconds patience);

private:
    struct Wish {
        RenderSettings settings;
        std::optional<LookAt> look;  ///< none: the file's camera
        bool moving = false;
        float stops = 0;
        uint64_t number = 0, method = 0;  ///< how often something, and the settings, changed
    };
    enum class Change { repaint, settle, restart };
    /// Each has 1/2^i of the pixels along each side.
    static constexpr uint32_t kSizes = 4;

    void work();
    uint64_t ask(Change kind, const std::function<void(Wish&)>& change);
    bool shows(const Wish& wish) const;
    void restart(const Wish& wish);
    void make_renderer_of(const Wish& wish, uint32_t size);
    void render_some();
    bool is_due();
    void publish(const Wish& wish);
    uint32_t size_of(const Wish& wish) const;
    nlohmann::json facts(const Wish& wish);
    void compare(const Wish& wish);

    // The worker's own.
    Scene scene_;
    const Sensor sensor_;
    const RenderSettings first_;
    const ViewOptions options_;
    SharedAccels accels_;
    std::array<std::unique_ptr<Renderer>, kSizes> renderers_;  ///< of one method
    Renderer* renderer_ = nullptr;                             ///< one of them
    Wish shown_;                                               ///< what it renders
    uint32_t size_ = 0, samples_ = 0;
    bool lost_ = false;  ///< a sample was left unfinished
    /// Of a sample of every pixel of the whole picture, as last measured: among others, and after a restart.
    double whole_seconds_ = 0, first_seconds_ = 0;
    std::string problem_;
    std::chrono::steady_clock::time_point published_, compared_;
    double frames_per_second_ = 0, restart_seconds_ = 0, render_seconds_ = 0, picture_seconds_ = 0;
    nlohmann::json error_, warnings_;
    std::future<nlohmann::json> comparison_;

    std::mutex mutex_;
    std::condition_variable wished_, shown_now_;
    Wish wish_;
    bool anew_ = false, repaint_ = false, ends_ = false;
    /// The first picture of a moving camera is finished, whatever comes: else none would be while it moves.
    bool patient_ = false;
    int waiting_ = 0;  ///< for a picture
    volatile bool interrupt_ = false, give_up_ = false;
    SharedPicture frame_;
    std::thread worker_;
};

}  // namespace ambilux
