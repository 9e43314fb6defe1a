#include "view/viewed_render.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"
#include "core/flag.h"
#include "core/seconds.h"
#include "core/srgb.h"
#include "film/metrics.h"
#include "integrators/registry.h"
#include "integrators/warnings.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

constexpr double kFrameSeconds = 1.0 / 30, kMovingSeconds = 1.0 / 20, kCompareSeconds = 0.5;
constexpr uint32_t kLargestDivisor = 8;

/// sRGB in 8 bits of the square of i / (size - 1): steps are even where the eye sees them.
const std::array<uint8_t, 4096>& tone_table() {
    static const auto table = [] {
        std::array<uint8_t, 4096> t{};
        for (size_t i = 0; i < t.size(); ++i) {
            const float root = float(i) / float(t.size() - 1);
            t[i] = uint8_t(linear_to_srgb(root * root) * 255.0f + 0.5f);
        }
        return t;
    }();
    return table;
}

std::vector<uint8_t> tone_mapped(const FilmMoments& film, float stops) {
    const auto& table = tone_table();
    const double scale = std::exp2(double(stops)) / double(std::max<uint64_t>(1, film.samples));
    std::vector<uint8_t> rgba(size_t(film.width) * film.height * 4);
    tbb::parallel_for(uint32_t(0), film.height, [&](uint32_t y) {
        for (size_t p = size_t(y) * film.width, end = p + film.width; p < end; ++p) {
            for (size_t c = 0; c < 3; ++c) {
                const double value = film.sum[p * 3 + c] * scale;
                // NaN fails the comparison and is black.
                const double root = value > 0 ? std::sqrt(std::min(value, 1.0)) : 0;
                rgba[p * 4 + c] = table[size_t(root * double(table.size() - 1) + 0.5)];
            }
            rgba[p * 4 + 3] = 255;
        }
    });
    return rgba;
}

nlohmann::json vector_json(Vec3f v) { return {v.x, v.y, v.z}; }

nlohmann::json look_json(const LookAt& look) {
    return {{"origin", vector_json(look.origin)}, {"target", vector_json(look.target)}, {"up", vector_json(look.up)}};
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

void ViewedRender::ask(const std::function<void(Wish&)>& change, bool restart) {
    {
        const std::lock_guard lock(mutex_);
        change(wish_);
        anew_ |= restart;
        repaint_ = true;
        if (restart) set_flag(&interrupt_);
    }
    wished_.notify_all();
}

void ViewedRender::look(const LookAt& look, bool moving) {
    placed(sensor_, look);
    ask([&](Wish& w) { w.look = look, w.moving = moving; }, true);
}

void ViewedRender::reset_camera() {
    ask([](Wish& w) { w.look.reset(), w.moving = false; }, true);
}

void ViewedRender::choose(const std::vector<std::pair<std::string, std::string>>& assignments) {
    RenderSettings settings = first_;
    for (const auto& [key, value] : assignments) apply_setting(settings, key, value);
    ask([&](Wish& w) { w.settings = settings, w.moving = false; }, true);
}

void ViewedRender::expose(float stops) {
    ask([&](Wish& w) { w.stops = stops; }, false);
}

SharedPicture ViewedRender::wait(uint64_t after, std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    const auto newer = [&] { return ends_ || (frame_ && frame_->number > after); };
    if (!shown_now_.wait_for(lock, patience, newer) || ends_) return nullptr;
    return frame_;
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
            interrupt_ = false;
        }
        try {
            if (anew) restart(wish);
            if (renderer_ && samples_ < options_.most_samples) render_some();
        } catch (const std::exception& e) {  // of memory too
            problem_ = e.what();
            renderer_.reset();
        }
        if (repaint || samples_ == 1 || seconds_since(published_) >= kFrameSeconds || !problem_.empty()) publish(wish);
    }
    shown_now_.notify_all();
}

uint32_t ViewedRender::divisor(const Wish& wish) const {
    uint32_t d = 1;
    while (wish.moving && d < kLargestDivisor && whole_seconds_ > kMovingSeconds * d * d) d *= 2;
    return d;
}

void ViewedRender::restart(const Wish& wish) {
    renderer_.reset();
    samples_ = 0;
    error_ = nullptr;
    scene_.sensor = smaller(wish.look ? placed(sensor_, *wish.look) : sensor_, divisor(wish));
    try {
        renderer_ = make_renderer(scene_, wish.settings, accels_);
        shown_ = wish.settings;
        problem_.clear();
    } catch (const Error& e) {
        problem_ = e.what();
    }
}

void ViewedRender::render_some() {
    // Samples that lie ready cost nothing; else about as many as a frame has time for.
    const double pixels = double(scene_.sensor.crop_width) * scene_.sensor.crop_height /
                          (double(sensor_.crop_width) * sensor_.crop_height);
    const double one = whole_seconds_ * pixels;
    uint32_t count = samples_ && one > 0 ? uint32_t(std::clamp(kFrameSeconds / one, 1.0, 64.0)) : 1;
    if (samples_ == 0) count = std::max(count, renderer_->ready());
    const uint32_t k = renderer_->iteration_samples();
    count = std::max(k, count / k * k);
    const auto start = Clock::now();
    const uint32_t done = renderer_->render(samples_, count, &interrupt_);
    if (done && done > renderer_->ready()) whole_seconds_ = seconds_since(start) / done / pixels;
    samples_ += done;
}

nlohmann::json ViewedRender::facts(const FilmMoments& film, const Wish& wish) {
    nlohmann::json out = {{"samples", film.samples}, {"problem", problem_}, {"fps", frames_per_second_}};
    if (!renderer_) return out;
    const RenderStats stats = renderer_->stats();
    out["seconds"] = stats.render_seconds;
    out["device"] = stats.device;
    out["method"] = stats.selection.name.empty() ? shown_.integrator + " " + shown_.variant : stats.selection.name;
    const double rays = double(stats.rays_extend) + double(stats.rays_occlude);
    out["rays_per_second"] = stats.render_seconds > 0 ? rays / stats.render_seconds : 0;
    out["invalid"] = stats.invalid.total();
    out["warnings"] = render_warnings(scene_, used_settings(shown_, stats));
    nlohmann::json& stages = out["stages"] = nlohmann::json::array();
    for (const StageStats& s : stats.stages)
        if (s.items) stages.push_back({{"name", s.name}, {"seconds", s.seconds}, {"items", s.items}});
    const std::optional<Reference>& reference = options_.reference;
    if (reference && !wish.look && film.samples && film.width == reference->mean.width &&
        film.height == reference->mean.height) {
        if (error_.is_null() || seconds_since(compared_) > kCompareSeconds) {
            error_ = to_json(compare_images(film, *reference));
            compared_ = Clock::now();
        }
        out["error"] = error_;
    }
    return out;
}

void ViewedRender::publish(const Wish& wish) {
    auto frame = std::make_shared<Picture>();
    if (renderer_) {
        const FilmMoments film = renderer_->film();
        frame->width = film.width;
        frame->height = film.height;
        frame->rgba = tone_mapped(film, wish.stops);
        frame->facts = facts(film, wish);
    } else {
        frame->facts = facts({}, wish);
    }
    const double since = seconds_since(published_);
    if (published_ != Clock::time_point()) frames_per_second_ += 0.1 * (1 / since - frames_per_second_);
    published_ = Clock::now();
    {
        const std::lock_guard lock(mutex_);
        frame->number = frame_ ? frame_->number + 1 : 1;
        frame_ = std::move(frame);
    }
    shown_now_.notify_all();
}

}  // namespace ambilux
