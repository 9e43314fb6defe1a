#include "view/viewed_render.h"

#include <algorithm>

#include "backends/cuda/mean_on_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/seconds.h"
#include "film/metrics.h"
#include "integrators/registry.h"
#include "integrators/warnings.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

/// Between pictures that somebody waits for, between looks at what is asked for, and for a picture while the camera
/// moves.
constexpr double kFrameSeconds = 1.0 / 60, kSliceSeconds = 0.01, kMovingSeconds = 0.025, kCompareSeconds = 0.5;

nlohmann::json vector_json(Vec3f v) { return {v.x, v.y, v.z}; }

nlohmann::json look_json(const LookAt& look) {
    return {{"origin", vector_json(look.origin)}, {"target", vector_json(look.target)}, {"up", vector_json(look.up)}};
}

/// Waves of one sample, unless a pilot is to choose for more: a camera that moves asks for one.
RenderSettings settings_of_a_view(RenderSettings s) {
    if (!s.automatic && s.expected_samples == 0) s.expected_samples = 1;
    return s;
}

nlohmann::json error_json(const std::optional<DeviceImage>& image, const FilmMoments& film,
                          const Reference& reference) {
    if (!image) return to_json(compare_images(film, reference));
    Image copied = {image->width, image->height, {}};
    copy_to_host(*image, copied.rgb);
    return to_json(compare_images(copied, reference));
}

}  // namespace

ViewedRender::ViewedRender(Scene scene, const RenderSettings& settings, ViewOptions options)
    : scene_(std::move(scene)), sensor_(scene_.sensor), first_(settings), options_(std::move(options)),
      accels_(scene_) {
    wish_.settings = settings;
    restart(wish_);
    if (!problem_.empty()) throw Error(ExitCode::usage, problem_);
    worker_ = std::thread([this] { work(); });
}

ViewedRender::~ViewedRender() {
    {
        const std::lock_guard lock(mutex_);
        ends_ = true;
        set_flag(&interrupt_);
        set_flag(&give_up_);
    }
    wished_.notify_all();
    worker_.join();
}

nlohmann::json ViewedRender::description() const {
    nlohmann::json methods = nlohmann::json::array();
    for (const Variant& v : variants())
        methods.push_back({{"integrator", v.integrator}, {"variant", v.variant}, {"help", v.help}});
    return {{"scene", scene_.path},
            {"width", sensor_.crop_width},
            {"height", sensor_.crop_height},
            {"camera", look_json(look_of(sensor_, scene_.bounds_center, scene_.bounds_radius))},
            {"methods", methods},
            {"integrator", first_.integrator},
            {"variant", first_.variant},
            {"reference", options_.reference.has_value()}};
}

uint64_t ViewedRender::ask(Change kind, const std::function<void(Wish&)>& change) {
    uint64_t number = 0;
    {
        const std::lock_guard lock(mutex_);
        change(wish_);
        number = ++wish_.number;
        anew_ |= kind != Change::repaint;
        repaint_ = true;
        if (kind == Change::restart) set_flag(&interrupt_);
        if (kind == Change::restart && !patient_) set_flag(&give_up_);
    }
    wished_.notify_all();
    return number;
}

uint64_t ViewedRender::look(const LookAt& look, bool moving) {
    placed(sensor_, look);
    bool same = false;
    {
        const std::lock_guard lock(mutex_);
        same = wish_.look == look;
    }
    return ask(same ? Change::settle : Change::restart, [&](Wish& w) { w.look = look, w.moving = moving; });
}

uint64_t ViewedRender::reset_camera() {
    return ask(Change::restart, [](Wish& w) { w.look.reset(), w.moving = false; });
}

uint64_t ViewedRender::choose(const std::vector<std::pair<std::string, std::string>>& assignments) {
    RenderSettings settings = first_;
    for (const auto& [key, value] : assignments) apply_setting(settings, key, value);
    return ask(Change::restart, [&](Wish& w) { w.settings = settings, w.moving = false, ++w.method; });
}

uint64_t ViewedRender::expose(float stops) {
    return ask(Change::repaint, [&](Wish& w) { w.stops = stops; });
}

SharedPicture ViewedRender::wait(uint64_t after, std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    const auto newer = [&] { return ends_ || (frame_ && frame_->number > after); };
    ++waiting_;
    const bool come = shown_now_.wait_for(lock, patience, newer);
    --waiting_;
    return come && !ends_ ? frame_ : nullptr;
}

void ViewedRender::work() {
    Wish wish = wish_;
    for (;;) {
        bool anew = false, repaint = false;
        {
            std::unique_lock lock(mutex_);
            const auto something = [&] {
                return ends_ || anew_ || repaint_ || (renderer_ && samples_ < options_.most_samples);
            };
            wished_.wait(lock, something);
            if (ends_) break;
            wish = wish_;
            anew = std::exchange(anew_, false);
            repaint = std::exchange(repaint_, false);
            patient_ = anew && wish.moving;
            interrupt_ = false;
            give_up_ = false;
        }
        try {
            if (anew && !shows(wish)) restart(wish);
            shown_ = wish;
            if (renderer_ && samples_ < options_.most_samples) render_some();
        } catch (const std::exception& e) {  // of memory too
            problem_ = e.what();
            renderer_ = nullptr;
            renderers_ = {};
        }
        if (!lost_ && (repaint || !problem_.empty() || is_due())) publish(wish);
    }
    shown_now_.notify_all();
}

/// As large as there is time for a sample of every pixel.
uint32_t ViewedRender::size_of(const Wish& wish) const {
    uint32_t size = 0;
    while (wish.moving && size + 1 < kSizes && first_seconds_ > kMovingSeconds * double(1u << (2 * size))) ++size;
    return size;
}

bool ViewedRender::shows(const Wish& wish) const {
    return renderer_ && !lost_ && wish.look == shown_.look && wish.method == shown_.method && size_of(wish) == size_;
}

void ViewedRender::restart(const Wish& wish) {
    const auto start = Clock::now();
    if (wish.method != shown_.method) renderers_ = {};
    size_ = size_of(wish);
    renderer_ = nullptr;
    samples_ = 0;
    lost_ = false;
    error_ = warnings_ = nullptr;
    compared_ = {};
    scene_.sensor = smaller(wish.look ? placed(sensor_, *wish.look) : sensor_, 1u << size_);
    problem_.clear();
    if (!renderers_[size_] || !renderers_[size_]->move_camera()) make_renderer_of(wish, size_);
    renderer_ = renderers_[size_].get();
    if (renderer_) renderer_->give_up_when(&give_up_);
    restart_seconds_ = seconds_since(start);
}

/// Beside those of other sizes, unless memory is short.
void ViewedRender::make_renderer_of(const Wish& wish, uint32_t size) {
    renderers_[size].reset();
    if (wish.settings.memory > 0) renderers_ = {};
    const RenderSettings settings = settings_of_a_view(wish.settings);
    for (;;) {
        try {
            renderers_[size] = make_renderer(scene_, settings, accels_);
            return;
        } catch (const Error& e) {
            const bool alone =
                std::none_of(renderers_.begin(), renderers_.end(), [](const auto& r) { return bool(r); });
            if (alone || e.code != ExitCode::device) {
                problem_ = e.what();
                return;
            }
            renderers_ = {};
        }
    }
}

void ViewedRender::render_some() {
    const double pixels = double(scene_.sensor.crop_width) * scene_.sensor.crop_height /
                          (double(sensor_.crop_width) * sensor_.crop_height);
    // Samples that lie ready cost nothing; else about as many as there is time for.
    const uint32_t k = renderer_->iteration_samples(), ready = samples_ == 0 ? renderer_->ready() : 0;
    const double one = whole_seconds_ * pixels;
    uint32_t count = samples_ && one > 0 ? uint32_t(std::clamp(kSliceSeconds / one, 1.0, 64.0)) : std::max(1u, ready);
    count = std::max(k, count / k * k);
    const auto start = Clock::now();
    const bool first = samples_ == 0;
    const uint32_t done = renderer_->render(samples_, count, patient_ ? nullptr : &interrupt_);
    const double seconds = seconds_since(start);
    lost_ = is_set(&give_up_);
    // Of one that was given up it is known that it takes longer.
    if (lost_) whole_seconds_ = first_seconds_ = std::max(first_seconds_, seconds / count / pixels);
    if (lost_ || done == 0) return;
    if (done > ready) whole_seconds_ = seconds / (done - ready) / pixels;
    if (first) first_seconds_ = whole_seconds_;
    if (first) render_seconds_ = seconds;
    samples_ += done;
}

bool ViewedRender::is_due() {
    if (samples_ >= options_.most_samples) return true;
    const std::lock_guard lock(mutex_);
    return waiting_ > 0 && seconds_since(published_) >= kFrameSeconds;
}

/// What comes of it is shown once it is there: the render does not wait, but for the last picture.
void ViewedRender::compare(const Wish& wish) {
    const std::optional<Reference>& reference = options_.reference;
    const bool comparable = reference && !wish.look && samples_ && size_ == 0, last = samples_ >= options_.most_samples;
    if (comparison_.valid() && (last || comparison_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)) {
        nlohmann::json found = comparison_.get();
        if (comparable && compared_ != Clock::time_point()) error_ = std::move(found);
    }
    if (!comparable || comparison_.valid() || (!last && seconds_since(compared_) < kCompareSeconds)) return;
    compared_ = Clock::now();
    const std::optional<DeviceImage> image = renderer_->device_image();
    comparison_ = std::async(std::launch::async, [image, film = image ? FilmMoments() : renderer_->film(), &reference] {
        return error_json(image, film, *reference);
    });
    if (last) error_ = comparison_.get();
}

nlohmann::json ViewedRender::facts(const Wish& wish) {
    nlohmann::json out = {
        {"asked", wish.number}, {"samples", samples_}, {"problem", problem_}, {"fps", frames_per_second_}};
    if (!renderer_) return out;
    const RenderStats stats = renderer_->stats();
    out["seconds"] = stats.render_seconds;
    out["device"] = stats.device;
    const std::string name = wish.settings.integrator + " " + wish.settings.variant;
    out["method"] = stats.selection.name.empty() ? name : stats.selection.name;
    const double rays = double(stats.rays_extend) + double(stats.rays_occlude);
    out["rays_per_second"] = stats.render_seconds > 0 ? rays / stats.render_seconds : 0;
    out["invalid"] = stats.invalid.total();
    if (warnings_.is_null()) warnings_ = render_warnings(scene_, used_settings(wish.settings, stats));
    out["warnings"] = warnings_;
    out["picture_seconds"] = {
        {"restart", restart_seconds_}, {"first_sample", render_seconds_}, {"picture", picture_seconds_}};
    nlohmann::json& stages = out["stages"] = nlohmann::json::array();
    for (const StageStats& s : stats.stages)
        if (s.items) stages.push_back({{"name", s.name}, {"seconds", s.seconds}, {"items", s.items}});
    compare(wish);
    if (!error_.is_null()) out["error"] = error_;
    return out;
}

void ViewedRender::publish(const Wish& wish) {
    const auto start = Clock::now();
    auto frame = std::make_shared<Picture>();
    try {
        if (renderer_) frame->image = renderer_->picture(wish.stops);
        picture_seconds_ = seconds_since(start);
        frame->facts = facts(wish);
    } catch (const std::exception& e) {
        problem_ = e.what();
        renderer_ = nullptr;
        renderers_ = {};
        *frame = {0, {}, facts(wish)};
    }
    const double since = seconds_since(published_);
    if (published_ != Clock::time_point()) frames_per_second_ += 0.1 * (1 / since - frames_per_second_);
    published_ = Clock::now();
    {
        const std::lock_guard lock(mutex_);
        patient_ = false;
        frame->number = frame_ ? frame_->number + 1 : 1;
        frame_ = std::move(frame);
    }
    shown_now_.notify_all();
}

}  // namespace ambilux
